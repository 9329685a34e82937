"""DeepLight: the light of a whole scene from one ordinary photo.

    import deeplight

    lighting = deeplight.estimate("photo.jpg")     # Lighting: HDR, all around, camera frame
    panorama = lighting.latlong(256)               # (256, 512, 3) linear radiance
    deeplight.save_lighting(lighting, "out/photo")

The names below are loaded when first used, so importing the package costs next to nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from deeplight.camera import PinholeCamera
    from deeplight.camera_response import CameraResponse
    from deeplight.contract import ModelContract
    from deeplight.errors import DeepLightError, InputError
    from deeplight.estimators.estimate import estimate
    from deeplight.estimators.onnx import OnnxEstimator
    from deeplight.harmonics import dominant_light, irradiance, project
    from deeplight.io.environment_file import load_lighting
    from deeplight.io.lighting_file import save_lighting
    from deeplight.io.photos import read_photo
    from deeplight.lighting import Lighting
    from deeplight.reflectance import ReflectanceBasis, analytic_basis
    from deeplight.relight import relight_rig
    from deeplight.sphere import Rig, SphereView

_HOME = {
    "CameraResponse": "camera_response",
    "DeepLightError": "errors",
    "InputError": "errors",
    "Lighting": "lighting",
    "ModelContract": "contract",
    "OnnxEstimator": "estimators.onnx",
    "PinholeCamera": "camera",
    "ReflectanceBasis": "reflectance",
    "Rig": "sphere",
    "SphereView": "sphere",
    "analytic_basis": "reflectance",
    "dominant_light": "harmonics",
    "estimate": "estimators.estimate",
    "irradiance": "harmonics",
    "load_lighting": "io.environment_file",
    "project": "harmonics",
    "read_photo": "io.photos",
    "relight_rig": "relight",
    "save_lighting": "io.lighting_file",
}

__all__ = [
    "CameraResponse",
    "DeepLightError",
    "InputError",
    "Lighting",
    "ModelContract",
    "OnnxEstimator",
    "PinholeCamera",
    "ReflectanceBasis",
    "Rig",
    "SphereView",
    "analytic_basis",
    "dominant_light",
    "estimate",
    "irradiance",
    "load_lighting",
    "project",
    "read_photo",
    "relight_rig",
    "save_lighting",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'deeplight' has no attribute {name!r}")
    value = getattr(import_module(f"deeplight.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
