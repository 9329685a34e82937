"""DeepLight in Blender: choose or drop a photo, and the scene is lit as the photo's place was.

The light is estimated by an installed `deeplight` program on this machine; nothing goes online.
"""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, FloatProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from . import program, scene

PHOTOS = (".jpg", ".jpeg", ".png", ".webp", ".heic", ".avif", ".tif", ".tiff")
STEPS = 3


class Preferences(bpy.types.AddonPreferences):
    """Where the program is."""

    bl_idname = __package__

    command: StringProperty(
        name="deeplight",
        description="The installed program; empty: the one on the search path",
        subtype="FILE_PATH",
    )

    def draw(self, _context):
        """The one field."""
        self.layout.prop(self, "command")


class LightFromPhoto(bpy.types.Operator, ImportHelper):
    """Estimate the light of a photo's place, and light the scene with it"""

    bl_idname = "deeplight.light_from_photo"
    bl_label = "Light from a photo"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 - as Blender wants it

    filter_glob: StringProperty(default="*" + ";*".join(PHOTOS), options={"HIDDEN"})
    pitch: FloatProperty(
        name="Camera's pitch",
        description="How far the photo's camera looked up; negative is down. "
        "Until you set it: as the photo says",
        default=scene.ASSUMED_PITCH_RAD,
        soft_min=-1.4,
        soft_max=1.4,
        subtype="ANGLE",
    )
    height: FloatProperty(
        name="Camera's height",
        description="Above the floor, on which the shadow catcher lies",
        default=1.4,
        min=0.01,
        unit="LENGTH",
    )
    with_camera: BoolProperty(name="Camera and background", default=True)
    with_catcher: BoolProperty(name="Shadow catcher", default=True)

    def execute(self, context):
        """Estimate, then build; what goes wrong is reported, and nothing is changed."""
        window = context.window_manager
        window.progress_begin(0, STEPS)
        try:
            photo = Path(bpy.path.abspath(self.filepath))
            light = program.estimated(photo, command_of(context), window.progress_update)
            if light.pitch_rad is not None and not self.properties.is_property_set("pitch"):
                self.pitch = light.pitch_rad
            built = scene.lit(context.scene, light, self.pitch)
            if self.with_camera:
                scene.add_camera(context.scene, light, built, self.pitch, self.height)
            if self.with_catcher:
                scene.add_catcher(context.scene, built)
        except program.ProgramError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            window.progress_end()
        for warning in built.warnings:
            self.report({"WARNING"}, warning)
        self.report({"INFO"}, f"Lit by {photo.name}: {len(light.lamps)} lamps, environment")
        return {"FINISHED"}


class PhotoDrop(bpy.types.FileHandler):
    """Photos dropped on a 3D view."""

    bl_idname = "DEEPLIGHT_FH_photo"
    bl_label = "Light from a photo"
    bl_import_operator = LightFromPhoto.bl_idname
    bl_file_extensions = ";".join(PHOTOS)

    @classmethod
    def poll_drop(cls, context):
        """Only there: elsewhere a photo is an image."""
        return context.area is not None and context.area.type == "VIEW_3D"


CLASSES = (Preferences, LightFromPhoto, PhotoDrop)


def command_of(context):
    """As set in the preferences; empty where this runs without being installed."""
    addon = context.preferences.addons.get(__package__)
    return addon.preferences.command if addon else ""


def menu(self, _context):
    """Under File > Import."""
    self.layout.operator(LightFromPhoto.bl_idname, text="Light from a photo (DeepLight)")


def register():
    """Called by Blender."""
    for made in CLASSES:
        bpy.utils.register_class(made)
    bpy.types.TOPBAR_MT_file_import.append(menu)


def unregister():
    """Called by Blender."""
    bpy.types.TOPBAR_MT_file_import.remove(menu)
    for made in reversed(CLASSES):
        bpy.utils.unregister_class(made)
