"""Run by a Python that has Blender's module: the exported script, then two balls with Cycles.

python blender_balls.py LIGHT.py OUT_FOLDER SIZE SAMPLES name=albedo...
"""

import math
import runpy
import sys
from pathlib import Path

import bpy


def ball(material):
    """A smooth sphere of radius 1 at the origin."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=256, ring_count=128, radius=1.0)
    made = bpy.context.object
    bpy.ops.object.shade_smooth()
    made.data.materials.clear()
    made.data.materials.append(material)


def material(name, albedo):
    """A Lambert or a perfect mirror surface."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    kind = "ShaderNodeBsdfDiffuse" if name == "diffuse" else "ShaderNodeBsdfGlossy"
    surface, output = nodes.new(kind), nodes.new("ShaderNodeOutputMaterial")
    surface.inputs["Color"].default_value = (albedo, albedo, albedo, 1)
    surface.inputs["Roughness"].default_value = 0.0
    links.new(surface.outputs[0], output.inputs["Surface"])
    return made


def main(light, out, size, samples, *materials):
    """Render each material's ball to OUT/name.exr."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    runpy.run_path(light)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = int(samples), False
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.resolution_x = scene.render.resolution_y = int(size)
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 2.0
    camera.location, camera.rotation_euler = (0, -5, 0), (math.pi / 2, 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    for text in materials:
        name, albedo = text.split("=")
        for thing in [thing for thing in scene.objects if thing.type == "MESH"]:
            bpy.data.objects.remove(thing)
        ball(material(name, float(albedo)))
        scene.render.filepath = str(Path(out) / f"{name}.exr")
        bpy.ops.render.render(write_still=True)


main(*sys.argv[1:])
