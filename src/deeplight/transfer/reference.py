"""What transfer stands for, the slow way: the same object on the same ground, path traced."""

import numpy as np
from jaxtyping import Float

from deeplight import harmonics
from deeplight.camera import PinholeCamera
from deeplight.compose.ground import Viewpoint
from deeplight.compose.mesh import Mesh
from deeplight.compose.mitsuba_variant import mitsuba
from deeplight.compose.scene import MOST_BOUNCES, Scene, Solid, mitsuba_scene
from deeplight.mappings import latlong
from deeplight.transfer.precompute import Transfer
from deeplight.transfer.view import Eye

_ROWS = 64  # of the panorama that holds the light
_WORLD = Viewpoint(PinholeCamera(8, 8, 1.0), pitch_rad=0.0)  # whose frame is the object's


def path_traced(
    transfer: Transfer,
    light: Float[np.ndarray, "given 3"],
    finish: str,
    eye: Eye,
    samples: int,
    objects: bool = True,
) -> Float[np.ndarray, "height width 3"]:
    """Radiance of the object, its ground and the light behind it, by Mitsuba.

    Args:
        transfer: gives mesh and ground; the transfer itself is not looked at.
        light: harmonics; where they go below 0, their negative is rendered, too, and taken away.
        finish: "diffuse", with the reflectivity 0.345, or "glossy", which is compose's silver.
        eye: as for `view`.
        samples: rays through each pixel.
        objects: False leaves the object out.
    """
    order = int(np.sqrt(len(light))) - 1
    directions = latlong.directions(_ROWS, 2 * _ROWS).astype(float)
    radiance = harmonics.basis(directions, order) @ light
    result = _rendered(transfer, np.maximum(radiance, 0), finish, eye, samples, objects)
    if radiance.min() < 0:
        below = np.maximum(-radiance, 0)
        result = result - _rendered(transfer, below, finish, eye, samples, objects)
    return result


def _rendered(
    transfer: Transfer,
    radiance: np.ndarray,
    finish: str,
    eye: Eye,
    samples: int,
    objects: bool,
) -> Float[np.ndarray, "height width 3"]:
    mi = mitsuba("scalar")
    vertices, normals = transfer.vertices.astype(float), transfer.normals.astype(float)
    material = {"diffuse": "diffuse", "glossy": "silver"}[finish]
    solid = Solid((Mesh(vertices, transfer.triangles, normals),), material)
    plane = transfer.shadowed.ground.reflectivity if transfer.shadowed else 0.0
    scene = Scene(_WORLD, radiance.astype(np.float32), [solid], np.full(3, plane))
    loaded = mitsuba_scene(mi, scene, transfer.shadowed is not None, objects)
    film = {"type": "hdrfilm", "width": eye.width, "height": eye.height, "pixel_format": "rgb"}
    look = mi.ScalarTransform4f().look_at(origin=eye.place, target=eye.target, up=(0, 1, 0))
    camera = {
        "type": "perspective",
        "fov": float(np.degrees(eye.fov_rad)),
        "fov_axis": "y",
        "to_world": look,
        "film": {**film, "component_format": "float32", "rfilter": {"type": "box"}},
    }
    path = mi.load_dict({"type": "path", "max_depth": MOST_BOUNCES + 1})
    image = mi.render(loaded, sensor=mi.load_dict(camera), integrator=path, spp=samples, seed=1)
    return np.array(image).astype(float)
