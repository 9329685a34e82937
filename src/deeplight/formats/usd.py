"""Light as a USD stage: a UsdLux dome and distant lights, in metres, +Y up.

The dome's texture holds everything but the lights. UsdLux divides a normalised distant light by
its projected solid angle, so that its intensity is the irradiance on a surface that faces it:
radiance relative to the camera's white stands where UsdLux has nits.
"""

from collections.abc import Sequence
from math import degrees
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from deeplight.errors import ConfigError
from deeplight.formats.gltf import shining_from
from deeplight.io.atomic import replacing
from deeplight.lamp import Lamp


def write_usd(path: Path, lamps: Sequence[Lamp], texture: str) -> None:
    """Write a stage of a dome light and distant lights, whole or not at all.

    Args:
        path: ending in .usda (text) or .usdc (binary).
        lamps: not in the texture.
        texture: name of the EXR next to `path`, turned for USD.

    Raises:
        ConfigError: another suffix.
        OSError: the file cannot be written.
    """
    if path.suffix.lower() not in (".usda", ".usdc"):
        raise ConfigError("a name ending in .usda or .usdc", f"{path}", "rename it")
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, "/deeplight")
    stage.SetDefaultPrim(root.GetPrim())
    dome = UsdLux.DomeLight.Define(stage, "/deeplight/environment")
    dome.CreateTextureFileAttr(Sdf.AssetPath(f"./{texture}"))
    dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    dome.CreateIntensityAttr(1.0)
    for number, lamp in enumerate(lamps):
        name = "main_light" if number == 0 else f"light_{number + 1}"
        _distant(stage, f"/deeplight/{name}", lamp)
    with replacing(path) as temporary:
        if not stage.GetRootLayer().Export(str(temporary)):
            raise OSError(f"cannot write {path}")


def _distant(stage: Usd.Stage, path: str, lamp: Lamp) -> None:
    """A light that shines along its -Z, as wide as it is."""
    distant = UsdLux.DistantLight.Define(stage, path)
    x, y, z, w = shining_from(lamp.direction)
    distant.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, x, y, z))
    distant.CreateAngleAttr(degrees(2 * lamp.angular_radius_rad))
    distant.CreateNormalizeAttr(True)
    distant.CreateIntensityAttr(float(lamp.irradiance.max()))
    distant.CreateColorAttr(Gf.Vec3f(*(float(value) for value in lamp.colour)))
