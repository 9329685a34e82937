"""Run by a Python that has Blender's module: the packed extension lights a scene from a photo.

python blender_extension_scene.py EXTENSION.zip DEEPLIGHT PHOTO OUT_FOLDER
"""

import json
import sys
import zipfile
from math import cos, pi, sin
from pathlib import Path

import bpy
from mathutils import Vector

PITCH = -0.3
GREY = 0.345


def installed(archive, out, command):
    """The add-on from the archive, registered."""
    with zipfile.ZipFile(archive) as packed:
        packed.extractall(out / "addons" / "deeplight_packed")
    sys.path.insert(0, str(out / "addons"))
    import deeplight_packed

    deeplight_packed.command_of = lambda context: command
    deeplight_packed.register()
    return deeplight_packed


def panorama(scene, path):
    """The world as the photo's camera has it around itself: 128 x 64, the view in the middle."""
    camera = camera_of(scene, "PANO")
    camera.data.panorama_type = "EQUIRECTANGULAR"
    rendered(scene, path, 128, 64)


def grey_ball(scene, path):
    """A Lambert ball in the light, 64 x 64, seen from far away as the photo's camera looks."""
    camera = camera_of(scene, "ORTHO")
    camera.data.ortho_scale = 2
    camera.location = (0, -5 * cos(PITCH), -5 * sin(PITCH))
    bpy.ops.mesh.primitive_uv_sphere_add(segments=256, ring_count=128, radius=1)
    ball = bpy.context.object
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new("grey")
    material.use_nodes = True
    surface = material.node_tree.nodes["Principled BSDF"].inputs
    surface["Base Color"].default_value = (GREY, GREY, GREY, 1)
    surface["Roughness"].default_value = 1
    surface["Specular IOR Level"].default_value = 0
    ball.data.materials.append(material)
    rendered(scene, path, 64, 64, ball)


def camera_of(scene, kind):
    """Another camera, held as the photo's."""
    camera = bpy.data.objects.new(kind, bpy.data.cameras.new(kind))
    camera.data.type = kind
    camera.rotation_euler = (pi / 2 + PITCH, 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return camera


def rendered(scene, path, width, height, shown=None):
    """Write what Cycles makes of the light and of one mesh, or of none."""
    render = scene.render
    render.engine, render.film_transparent = "CYCLES", False
    scene.cycles.samples, scene.cycles.use_denoising = 64, False
    scene.cycles.pixel_filter_type = "BOX"  # the usual one blurs over the pixel's edge
    render.threads_mode, render.threads = "FIXED", 1
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.filepath = str(path)
    for thing in scene.objects:
        thing.hide_render = thing.type == "MESH" and thing is not shown
    bpy.ops.render.render(write_still=True)


def main(archive, command, photo, out):
    """Write what was built to OUT_FOLDER: scene.json, around.exr and ball.exr."""
    out = Path(out)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon = installed(archive, out, command)
    bpy.ops.deeplight.light_from_photo(filepath=photo)
    own_pitch = bpy.context.scene.camera.rotation_euler.x - pi / 2
    result = bpy.ops.deeplight.light_from_photo(filepath=photo, pitch=PITCH)
    scene = bpy.context.scene
    camera = scene.camera
    bpy.context.view_layer.update()
    facts = {
        "result": sorted(result),
        "suns": [
            {
                "towards": list(thing.matrix_world.to_quaternion() @ Vector((0, 0, 1))),
                "energy": [thing.data.energy * share for share in thing.data.color],
                "angle": thing.data.angle,
            }
            for thing in scene.objects
            if thing.type == "LIGHT"
        ],
        "view": list(camera.matrix_world.to_quaternion() @ Vector((0, 0, -1))),
        "own_pitch": own_pitch,
        "angle_y": camera.data.angle_y,
        "size": [scene.render.resolution_x, scene.render.resolution_y],
        "background": len(camera.data.background_images),
        "catchers": sum(
            thing.type == "MESH" and thing.is_shadow_catcher for thing in scene.objects
        ),
    }
    try:
        facts["bad"] = sorted(bpy.ops.deeplight.light_from_photo(filepath=__file__))
    except RuntimeError as error:  # how Blender's module reports errors to scripts
        facts["bad"] = str(error)
    facts["lamps_after"] = sum(thing.type == "LIGHT" for thing in scene.objects)
    panorama(scene, out / "around.exr")
    grey_ball(scene, out / "ball.exr")
    addon.unregister()
    (out / "scene.json").write_text(json.dumps(facts))


main(*sys.argv[1:])
