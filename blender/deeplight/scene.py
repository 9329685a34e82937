"""A scene lit by a photo's light: world, suns, camera, floor.

The photo's camera looks along +Y with +Z up, `pitch` radians above the horizon.
"""

from dataclasses import dataclass, field
from math import pi, radians

import bpy
from mathutils import Matrix, Vector

ASSUMED_PITCH_RAD = radians(-15)
"""As `deeplight compose` assumes."""
FLOOR_M = 40


@dataclass
class Built:
    """What was added."""

    collection: bpy.types.Collection
    warnings: list[str] = field(default_factory=list)


def lit(scene, light, pitch):
    """World and suns; earlier ones of this add-on go. White is white: the Standard view."""
    forget(scene)
    collection = bpy.data.collections.new("DeepLight")
    scene.collection.children.link(collection)
    scene.world = world_of(light, pitch)
    for number, lamp in enumerate(light.lamps, 1):
        add_sun(collection, f"deeplight lamp {number}", lamp, pitch)
    scene.view_settings.view_transform = "Standard"
    return Built(collection)


def forget(scene):
    """Remove what an earlier photo brought."""
    for collection in [c for c in scene.collection.children if c.name.startswith("DeepLight")]:
        for thing in list(collection.objects):
            bpy.data.objects.remove(thing)
        bpy.data.collections.remove(collection)


def world_of(light, pitch):
    """The environment, turned to where the camera looks."""
    world = bpy.data.worlds.new("DeepLight")
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    place = nodes.new("ShaderNodeTexCoord")
    turn = nodes.new("ShaderNodeMapping")
    turn.inputs["Rotation"].default_value = (-pitch, 0, 0)  # directions go back to the photo's
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(light.environment))
    texture.image.colorspace_settings.name = "Linear Rec.709"
    texture.image.pack()  # the blend file keeps it
    background = nodes.new("ShaderNodeBackground")
    output = nodes.new("ShaderNodeOutputWorld")
    links.new(place.outputs["Generated"], turn.inputs["Vector"])
    links.new(turn.outputs["Vector"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], background.inputs["Color"])
    links.new(background.outputs["Background"], output.inputs["Surface"])
    return world


def add_sun(collection, name, lamp, pitch):
    """A sun of the lamp's size; its strength is the lamp's irradiance."""
    brightest = max(lamp.irradiance)
    if brightest <= 0:
        return
    data = bpy.data.lights.new(name, "SUN")
    data.energy = brightest
    data.color = [value / brightest for value in lamp.irradiance]
    data.angle = min(2 * lamp.angular_radius_rad, pi)
    x, y, z = lamp.direction
    towards = Matrix.Rotation(pitch, 3, "X") @ Vector((x, -z, y))
    sun = bpy.data.objects.new(name, data)
    sun.rotation_mode = "QUATERNION"
    sun.rotation_quaternion = towards.to_track_quat("Z", "Y")
    collection.objects.link(sun)


def add_camera(scene, light, built, pitch, height):
    """The photo's camera, with the photo behind what is rendered."""
    data = bpy.data.cameras.new("DeepLight camera")
    data.sensor_fit = "VERTICAL"
    data.angle_y = light.vertical_fov_rad
    camera = bpy.data.objects.new(data.name, data)
    camera.location = (0, 0, height)
    camera.rotation_euler = (pi / 2 + pitch, 0, 0)
    built.collection.objects.link(camera)
    scene.camera = camera
    render = scene.render
    render.resolution_x, render.resolution_y = light.width, light.height
    render.pixel_aspect_x = render.pixel_aspect_y = 1
    render.film_transparent = True
    try:
        photo = bpy.data.images.load(str(light.photo))
    except RuntimeError:
        built.warnings.append(f"Blender cannot show {light.photo.name} as a background")
        return
    if tuple(photo.size) != (light.width, light.height):
        built.warnings.append("The photo is stored turned: save it upright for a background")
        return
    data.show_background_images = True
    behind = data.background_images.new()
    behind.image = photo
    behind.alpha, behind.display_depth, behind.frame_method = 1, "BACK", "FIT"


def add_catcher(scene, built):
    """A floor at height 0 that shows nothing but shadows, in Cycles."""
    half = FLOOR_M / 2
    mesh = bpy.data.meshes.new("DeepLight floor")
    corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    floor = bpy.data.objects.new(mesh.name, mesh)
    floor.is_shadow_catcher = True
    built.collection.objects.link(floor)
    scene.render.engine = "CYCLES"
