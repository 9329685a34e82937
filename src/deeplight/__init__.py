"""DeepLight: the light of a whole scene from one ordinary photo.

    import deeplight

    environment = deeplight.estimate("photo.jpg")    # Environment: HDR, all around, camera frame
    panorama = environment.radiance                  # (256, 512, 3) linear radiance
    deeplight.convert(environment, "light.exr")      # or .glb, .hdr, .json, .py for Blender ...

The names below are loaded when first used, so importing the package costs next to nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from deeplight.camera_response import CameraResponse
    from deeplight.compose.photo import compose_photo
    from deeplight.edit import Edit
    from deeplight.environment import Environment
    from deeplight.errors import DeepLightError, InputError
    from deeplight.estimators.estimate import estimate, estimate_many, load_estimator
    from deeplight.evaluate.command import evaluate_models
    from deeplight.formats.convert import convert
    from deeplight.fuse.fuse import fuse_views
    from deeplight.harmonics import dominant_light, spherical_harmonics
    from deeplight.io.environment_file import read_environment
    from deeplight.lighting import Lighting
    from deeplight.reflectance import analytic_basis
    from deeplight.relight import relight_rig
    from deeplight.solve import light_from_spheres
    from deeplight.sphere import PAPER_RIG

_HOME = {
    "CameraResponse": "camera_response",
    "DeepLightError": "errors",
    "Edit": "edit",
    "Environment": "environment",
    "InputError": "errors",
    "Lighting": "lighting",
    "PAPER_RIG": "sphere",
    "analytic_basis": "reflectance",
    "compose_photo": "compose.photo",
    "convert": "formats.convert",
    "dominant_light": "harmonics",
    "estimate": "estimators.estimate",
    "estimate_many": "estimators.estimate",
    "evaluate_models": "evaluate.command",
    "fuse_views": "fuse.fuse",
    "light_from_spheres": "solve",
    "load_estimator": "estimators.estimate",
    "read_environment": "io.environment_file",
    "relight_rig": "relight",
    "spherical_harmonics": "harmonics",
}

__all__ = [
    "CameraResponse",
    "DeepLightError",
    "Edit",
    "Environment",
    "InputError",
    "Lighting",
    "PAPER_RIG",
    "analytic_basis",
    "compose_photo",
    "convert",
    "dominant_light",
    "estimate",
    "estimate_many",
    "evaluate_models",
    "fuse_views",
    "light_from_spheres",
    "load_estimator",
    "read_environment",
    "relight_rig",
    "spherical_harmonics",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'deeplight' has no attribute {name!r}")
    value = getattr(import_module(f"deeplight.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
