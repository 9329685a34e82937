"""The scene as Mitsuba takes it: the plane, the objects on it, the light, the camera."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from deeplight import frames
from deeplight.camera_response import LUMINANCE
from deeplight.compose.ground import Viewpoint
from deeplight.compose.materials import bsdf
from deeplight.compose.mesh import Mesh
from deeplight.mappings import latlong

MOST_BOUNCES = 8
PLANE_SIZES = 60.0  # radius of the plane, in sizes of the group of objects
SHADOW_SIZES = 2.5  # how far around the objects light that comes from everywhere is blocked
LONGEST_SHADOW = 8.0  # of a low sun, in heights of the object

Colour = Float[np.ndarray, "3"]
Crop = tuple[int, int, int, int]  # left, top, right, bottom in pixels of the photo


@dataclass(frozen=True, eq=False)
class Solid:
    """Meshes that stand where they are to stand, in the world frame, and their material."""

    meshes: tuple[Mesh, ...]
    material: str

    @property
    def vertices(self) -> Float[np.ndarray, "n 3"]:
        """Every vertex."""
        return np.concatenate([mesh.vertices for mesh in self.meshes])

    def may_hold(self, point: Sequence[float]) -> bool:
        """Whether a point lies within its bounds along the axes."""
        least, most = self.vertices.min(0), self.vertices.max(0)
        return bool(((least < point) & (point < most)).all())


@dataclass(frozen=True, eq=False)
class Texture:
    """Albedo of a square of the plane; beyond it the plane goes on as its rim is.

    Attributes:
        centre: x and z of the square's middle.
        half_side_m: half of its side, along X and Z.
        albedo: linear; the first row is the nearest to the camera, the first column at -X.
    """

    centre: tuple[float, float]
    half_side_m: float
    albedo: Float[np.ndarray, "rows columns 3"]


@dataclass(frozen=True, eq=False)
class Scene:
    """What is rendered.

    Attributes:
        viewpoint: the photo's camera above the plane.
        light: latlong radiance in the camera frame, relative to the camera's white.
        solids: the objects.
        albedo: of the plane, linear.
        texture: albedo of the plane around the objects, if it is not everywhere alike.
    """

    viewpoint: Viewpoint
    light: Float[np.ndarray, "height width 3"]
    solids: Sequence[Solid]
    albedo: Colour
    texture: Texture | None = None

    def towards_camera(self) -> "Scene":
        """The same with normals that do not turn away from the camera: see `Mesh.towards`."""
        eye = np.array([0, self.viewpoint.height_m, 0])
        return replace(
            self,
            solids=[
                replace(solid, meshes=tuple(mesh.towards(eye) for mesh in solid.meshes))
                for solid in self.solids
            ],
        )

    @property
    def box(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Lowest and highest corner of all objects."""
        points = np.concatenate([solid.vertices for solid in self.solids])
        return points.min(0), points.max(0)


@dataclass(frozen=True)
class ImageWindow:
    """Part of the photo on a grid of its own.

    Attributes:
        step: the grid's pixels, in pixels of the photo.
        left, top, width, height: in pixels of the grid.
    """

    step: float
    left: int
    top: int
    width: int
    height: int

    @classmethod
    def over(cls, crop: Crop, step: float) -> "ImageWindow":
        """The smallest window that covers `crop`."""
        left, top = int(np.floor(crop[0] / step)), int(np.floor(crop[1] / step))
        right, bottom = int(np.ceil(crop[2] / step)), int(np.ceil(crop[3] / step))
        return cls(step, left, top, right - left, bottom - top)

    def finer(self, parts: int) -> "ImageWindow":
        """The same window with each pixel parted into `parts` x `parts`."""
        sizes = (n * parts for n in (self.left, self.top, self.width, self.height))
        return ImageWindow(self.step / parts, *sizes)


def irradiance_on_plane(light: Float[np.ndarray, "height width 3"], viewpoint: Viewpoint) -> Colour:
    """What falls on an open plane, in units of radiance x sr; white light of 1 gives pi."""
    cosine = _world_directions(light, viewpoint)[..., 1]
    weight = np.maximum(cosine, 0) * latlong.solid_angles(*light.shape[:2])
    result: Colour = np.einsum("ij,ijc->c", weight, light)
    return result


def mitsuba_scene(mi: Any, scene: Scene, plane: bool = True, solids: bool = True) -> Any:
    """Load the scene's plane, objects or both, under its light; without a camera."""
    turn = np.eye(4)
    # Mitsuba's environments have +Z in the centre column, ours -Z: half a turn about +Y.
    turn[:3, :3] = scene.viewpoint.world_from_camera @ frames.rotation("y", np.pi)
    bitmap = mi.Bitmap(np.array(scene.light, np.float32, order="C"))  # it refuses read-only ones
    parts: dict[str, Any] = {
        "type": "scene",
        "light": {"type": "envmap", "bitmap": bitmap, "to_world": mi.ScalarTransform4f(turn)},
    }
    if plane:
        parts["plane"] = _plane(mi, scene)
    if solids:
        for i, solid in enumerate(scene.solids):
            for j, mesh in enumerate(solid.meshes):
                parts[name_of(i, j)] = _mitsuba_mesh(mi, mesh, solid.material)
    return mi.load_dict(parts)


def name_of(solid: int, mesh: int) -> str:
    """What the loaded scene calls a mesh of a solid."""
    return f"solid_{solid}_{mesh}"


def _plane(mi: Any, scene: Scene) -> dict[str, Any]:
    """A square, so large that its end does not show."""
    low, high = scene.box if scene.solids else (np.zeros(3), np.ones(3))
    centre = ((low + high) / 2)[[0, 2]] if scene.texture is None else scene.texture.centre
    reach = PLANE_SIZES * float(np.linalg.norm(high - low))
    lift = mi.ScalarTransform4f().translate([float(centre[0]), 0, float(centre[1])])
    reflectance: dict[str, Any] = {"type": "rgb", "value": scene.albedo.tolist()}
    if scene.texture is not None:
        about_middle = mi.ScalarTransform3f().translate([0.5, 0.5])
        about_middle = about_middle.scale(reach / scene.texture.half_side_m)
        reflectance = {
            "type": "bitmap",
            "bitmap": mi.Bitmap(np.ascontiguousarray(scene.texture.albedo, np.float32)),
            "raw": True,
            "wrap_mode": "clamp",
            "to_uv": about_middle.translate([-0.5, -0.5]),
        }
    return {
        "type": "rectangle",
        "to_world": lift.rotate([1, 0, 0], -90).scale(reach),
        "bsdf": {"type": "diffuse", "reflectance": reflectance},
    }


def sensor(mi: Any, viewpoint: Viewpoint, window: ImageWindow) -> Any:
    """The photo's camera, whose film is `window`."""
    camera, step = viewpoint.camera, window.step
    columns = max(int(np.ceil(camera.width / step)), window.left + window.width)
    rows = max(int(np.ceil(camera.height / step)), window.top + window.height)
    # A film of whole pixels may reach past the photo's right and lower edge.
    wider, higher = columns * step / camera.width, rows * step / camera.height
    pose = viewpoint.world_from_camera
    origin = np.array([0, viewpoint.height_m, 0])
    to_world = mi.ScalarTransform4f().look_at(
        origin=origin.tolist(),
        target=(origin + pose @ frames.VIEW).tolist(),
        up=(pose @ frames.UP).tolist(),
    )
    film = {
        "type": "hdrfilm",
        "width": columns,
        "height": rows,
        "crop_offset_x": window.left,
        "crop_offset_y": window.top,
        "crop_width": window.width,
        "crop_height": window.height,
        "pixel_format": "rgb",
        "component_format": "float32",
        "rfilter": {"type": "box"},
    }
    return mi.load_dict(
        {
            "type": "perspective",
            "fov": float(np.degrees(2 * np.arctan(camera.tangents[1] * higher))),
            "fov_axis": "y",
            "principal_point_offset_x": (1 - 1 / wider) / 2,
            "principal_point_offset_y": (1 - 1 / higher) / 2,
            "near_clip": viewpoint.height_m * 1e-3,
            "far_clip": viewpoint.height_m * 1e5,
            "to_world": to_world,
            "film": film,
            "sampler": {"type": "independent", "sample_count": 1},
        }
    )


def affected(scene: Scene) -> Crop:
    """Left, top, right, bottom of the part of the photo that objects and shadows can change.

    The objects' box, the plane around it, and the shadow of the brightest direction.
    """
    low, high = scene.box
    height, centre = float(high[1]), (low + high) / 2
    reach = SHADOW_SIZES * float((high - low).max())
    across = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    ring = np.stack([np.cos(across), np.zeros(48), np.sin(across)], -1)
    half = np.linalg.norm((high - low)[[0, 2]]) / 2
    ground = centre * [1, 0, 1] + ring * (half + reach)
    shadow = centre * [1, 0, 1] + ring * half * 1.5 + _shadow(scene, height)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    points = np.concatenate([low + corners * (high - low), ground, shadow])
    return _bounds(scene.viewpoint, points)


def bounds_of_solids(scene: Scene) -> Crop:
    """Left, top, right, bottom of the objects and a little around them."""
    points = np.concatenate([solid.vertices for solid in scene.solids])
    left, top, right, bottom = _bounds(scene.viewpoint, points)
    camera = scene.viewpoint.camera
    more = max(6, (right - left) // 8)  # for the shadow where they touch the ground
    right, bottom = min(right + more, camera.width), min(bottom + more, camera.height)
    return max(left - more, 0), max(top - more, 0), right, bottom


def _bounds(viewpoint: Viewpoint, points: Float[np.ndarray, "n 3"]) -> Crop:
    camera = viewpoint.camera
    pixels = viewpoint.pixels(points)
    behind = np.isnan(pixels).any(axis=1)
    pixels = pixels[~behind]
    limit = np.array([camera.width, camera.height])
    if not len(pixels):
        return 0, 0, 0, 0
    low = np.clip(np.floor(pixels.min(0)), 0, limit).astype(int)
    high = np.clip(np.ceil(pixels.max(0)), 0, limit).astype(int)
    if behind.any():  # it reaches under the camera: to the photo's lower edge and both sides
        low[0], high[0], high[1] = 0, limit[0], limit[1]
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _shadow(scene: Scene, height: float) -> Float[np.ndarray, "3"]:
    """How far the brightest light from above throws the shadow of a point `height` up."""
    directions = _world_directions(scene.light, scene.viewpoint)
    weight = (scene.light @ LUMINANCE) * np.maximum(directions[..., 1], 0)
    at = np.unravel_index(weight.argmax(), weight.shape)
    x, y, z = directions[at]
    along = np.array([-x, 0, -z]) / max(float(y), 1e-3) * height
    return along * min(1.0, LONGEST_SHADOW * height / max(float(np.linalg.norm(along)), 1e-9))


def _world_directions(light: np.ndarray, viewpoint: Viewpoint) -> np.ndarray:
    return frames.turned(latlong.directions(*light.shape[:2]), viewpoint.world_from_camera)


def _mitsuba_mesh(mi: Any, mesh: Mesh, material: str) -> Any:
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf(mi, material, mesh))
    properties["face_normals"] = mesh.normals is None
    shape = mi.Mesh(
        "solid",
        vertex_count=len(mesh.vertices),
        face_count=len(mesh.faces),
        has_vertex_normals=mesh.normals is not None,
        has_vertex_texcoords=mesh.uv is not None,
        props=properties,
    )
    if mesh.colours is not None:
        shape.add_attribute("vertex_color", 3, mesh.colours.astype(np.float32).ravel())
    values = mi.traverse(shape)
    values["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    values["faces"] = mesh.faces.astype(np.uint32).ravel()
    if mesh.normals is not None:
        values["vertex_normals"] = mesh.normals.astype(np.float32).ravel()
    if mesh.uv is not None:  # Mitsuba's textures begin at the top
        values["vertex_texcoords"] = (mesh.uv * [1, -1] + [0, 1]).astype(np.float32).ravel()
    values.update()
    return shape
