"""Run by a Python that has Blender's module: the packed extension lights a scene from a photo.

python blender_extension_scene.py EXTENSION.zip DEEPLIGHT PHOTO OUT_FOLDER
"""

import json
import sys
import zipfile
from math import pi
from pathlib import Path

import bpy
from mathutils import Vector

PITCH = -0.3


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
    camera = bpy.data.objects.new("all around", bpy.data.cameras.new("all around"))
    camera.data.type, camera.data.panorama_type = "PANO", "EQUIRECTANGULAR"
    camera.rotation_euler = (pi / 2 + PITCH, 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    render = scene.render
    render.engine, render.film_transparent = "CYCLES", False
    scene.cycles.samples, scene.cycles.use_denoising = 64, False
    scene.cycles.pixel_filter_type = "BOX"  # the usual one blurs over the pixel's edge
    render.threads_mode, render.threads = "FIXED", 1
    render.resolution_x, render.resolution_y, render.resolution_percentage = 128, 64, 100
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.filepath = str(path)
    for thing in scene.objects:
        thing.hide_render = thing.type == "MESH"
    bpy.ops.render.render(write_still=True)


def main(archive, command, photo, out):
    """Write what was built to OUT_FOLDER/scene.json and around.exr."""
    out = Path(out)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon = installed(archive, out, command)
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
    addon.unregister()
    (out / "scene.json").write_text(json.dumps(facts))


main(*sys.argv[1:])
