"""Render a scene into layers: the objects, their cover, and what they do to the light on the plane.

Each pass traces one ray through every pixel of a grid, with and without the objects, from the
same random numbers. So each ray sees either object or plane and the two never mix; a ray's light
on the plane is the same number in both renderings unless an object took or gave some of it, and
the shadow has noise only where there is a shadow.

Around the objects the grid is finer than the photo's; for the wide, soft rest of the shadow it
is coarser, which is where the time would go.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from deeplight.compose.denoise import ENOUGH_SAMPLES, denoised, smooth_sums, without_sparks
from deeplight.compose.materials import is_mirror
from deeplight.compose.mitsuba_variant import mitsuba
from deeplight.compose.scene import (
    MOST_BOUNCES,
    Crop,
    ImageWindow,
    Scene,
    affected,
    bounds_of_solids,
    mitsuba_scene,
    name_of,
    sensor,
)
from deeplight.errors import ConfigError

LIGHT_HEIGHT = 512
"""Rows of a panorama to render with: a sun stays as sharp as it is."""
PLANE = "plane"
SHAPE = "shape:shape_index"
AOVS = f"{SHAPE},albedo:albedo,normal:sh_normal"
AT_ONCE = 1_000_000  # rays: the LLVM variant keeps the whole state of each
BORDER = 0.12  # part of a grid over which its shadow gives way to the next
MOST_BOUNCED = 1.5
"""A ray's light on the plane, over the brightest that falls there directly."""
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Quality:
    """How much work to do.

    Attributes:
        samples: rays through each of the photo's pixels around the objects.
        shadow_samples: rays through each pixel of the coarse grid.
        shadow_pixels: of the coarse grid, at most.
        most_rays: around the objects in all; large objects get fewer `samples`. None is no limit.
        fine: grid pixels along a photo's pixel, around the objects. More mean fewer passes, which
            the LLVM variant likes: it pays for each pass, not for each ray.
    """

    samples: int
    shadow_samples: int
    shadow_pixels: int
    most_rays: int | None = None
    fine: int = 2

    def __post_init__(self) -> None:
        if min(self.samples, self.shadow_samples, self.shadow_pixels, self.fine) < 1:
            raise ConfigError("at least one sample", f"{self}", "give more --samples")

    def passes(self, fine: ImageWindow) -> int:
        """How often to trace a ray through every pixel of the fine grid."""
        wanted = -(-self.samples // self.fine**2)
        if self.most_rays is None:
            return wanted
        return max(1, min(wanted, self.most_rays // (fine.width * fine.height)))


PREVIEW = Quality(samples=64, shadow_samples=48, shadow_pixels=4_000, most_rays=900_000)
FINAL = Quality(samples=512, shadow_samples=256, shadow_pixels=60_000, fine=4)


@dataclass(frozen=True, eq=False)
class Layers:
    """What is rendered of the part of a photo that changes.

    Attributes:
        crop: that part: left, top, right, bottom.
        radiance: of the objects, times their cover.
        cover: share of each pixel that objects hide.
        shadow: light on the plane with the objects over that without; 1 is unchanged.
    """

    crop: Crop
    radiance: Float[np.ndarray, "height width 3"]
    cover: Float[np.ndarray, "height width"]
    shadow: Float[np.ndarray, "height width 3"]


def trace(
    scene: Scene,
    quality: Quality = PREVIEW,
    engine: str = "auto",
    light_from_below: bool = False,
    seed: int = 0,
    progress: Progress = lambda done, total: None,
) -> Layers:
    """Render.

    Args:
        scene: what.
        quality: how well.
        engine: see `engine.mitsuba`.
        light_from_below: light the objects with the estimate's lower directions instead of the
            plane; the plane still catches their shadow.
        seed: of the random numbers.
        progress: called with (rays done, rays in all).
    """
    near = bounds_of_solids(scene) if scene.solids else (0, 0, 0, 0)
    if min(near[2] - near[0], near[3] - near[1]) < 1:  # nothing, or outside the photo
        nothing = np.zeros((0, 0, 3), np.float32)
        return Layers((0, 0, 0, 0), nothing, nothing[..., 0], nothing)
    if engine == "auto" and quality.most_rays is not None:
        engine = "scalar"  # trying and compiling LLVM takes longer than a preview
    tracer = _Tracer(mitsuba(engine), scene, light_from_below, seed)
    wide = _around(affected(scene), near)
    area = (wide[2] - wide[0]) * (wide[3] - wide[1])
    coarse = ImageWindow.over(wide, max(1.0, float(np.ceil(np.sqrt(area / quality.shadow_pixels)))))
    fine = ImageWindow.over(near, 1 / quality.fine)
    passes, parts = quality.passes(fine), quality.fine
    work = [fine.width * fine.height * passes]
    work.append(coarse.width * coarse.height * quality.shadow_samples)
    around = tracer.run(fine, passes, lambda done: progress(done, sum(work)), parts)
    # One pass over a finer grid is as many rays as several over the coarse one, and much quicker.
    samples = quality.shadow_samples
    split = max(part for part in (1, 2, 4) if part**2 <= samples)
    soft = tracer.run(
        coarse.finer(split),
        -(-samples // split**2),
        lambda done: progress(min(work[0] + done, sum(work)), sum(work)),
        split,
        objects=False,
    )
    return _joined(scene, wide, near, around, soft, coarse, ENOUGH_SAMPLES // (passes * parts**2))


@dataclass(frozen=True, eq=False)
class _Rays:
    """Means over the rays of each pixel."""

    radiance: Float[np.ndarray, "height width 3"]
    cover: Float[np.ndarray, "height width"]
    shadowed: Float[np.ndarray, "height width 3"]
    open: Float[np.ndarray, "height width 3"]
    features: Float[np.ndarray, "height width 6"]  # albedo and normal, times the cover
    sharp: Float[np.ndarray, "height width"]  # share that mirrors cover


class _Tracer:
    """The loaded scenes: with objects, without, and the objects alone."""

    def __init__(self, mi: Any, scene: Scene, light_from_below: bool, seed: int) -> None:
        scene = scene.towards_camera()
        self._mi, self._scene, self._seed = mi, scene, seed
        self._full = mitsuba_scene(mi, scene)
        self._empty = mitsuba_scene(mi, scene, solids=False)
        self._alone = mitsuba_scene(mi, scene, plane=False) if light_from_below else None
        shapes = [shape.id() for shape in self._full.shapes()]
        self._plane = 1 + shapes.index(PLANE)
        mirrors = [
            name_of(i, j)
            for i, solid in enumerate(scene.solids)
            for j, mesh in enumerate(solid.meshes)
            if is_mirror(solid.material, mesh)
        ]
        self._mirrors = [1 + shapes.index(name) for name in mirrors]

    def run(
        self,
        window: ImageWindow,
        passes: int,
        done: Callable[[int], None],
        parts: int,
        objects: bool = True,
    ) -> _Rays:
        """Trace `passes` rays through every pixel of a window, strip by strip for memory's sake.

        Each `parts` x `parts` pixels become one; without `objects` only the light on the plane is
        wanted.
        """
        rows = max(AT_ONCE // window.width // parts, 1) * parts
        strips = []
        for top in range(0, window.height, rows):
            height = min(rows, window.height - top)
            strip = replace(window, top=window.top + top, height=height)
            before = top * window.width * passes
            sums = self._strip(strip, passes, partial(_after, done, before), objects)
            strips.append([_by_pixel(values / passes, parts) for values in sums])
        return _Rays(*(np.concatenate(values) for values in zip(*strips, strict=True)))

    def _strip(
        self, window: ImageWindow, passes: int, done: Callable[[int], None], objects: bool
    ) -> tuple[np.ndarray, ...]:
        """Sums over the rays, in the order of `_Rays`."""
        camera = sensor(self._mi, self._scene.viewpoint, window)
        size = (window.height, window.width)
        radiance, shadowed, unshadowed = np.zeros((3, *size, 3))
        cover, sharp, features = np.zeros(size), np.zeros(size), np.zeros((*size, 6))
        for number in range(passes):
            seed = self._seed * 100_003 + number + window.top * 1_009
            shape, looks = self._met(camera, seed, objects)
            plane, solid = shape == self._plane, (shape != self._plane) & (shape > 0)
            full = self._radiance(self._full, camera, seed, MOST_BOUNCES)
            bare = self._radiance(self._empty, camera, seed, 1) * plane[..., None]
            # A ray that finds a small lamp by way of a mirror would be a bright dot.
            shadowed += np.minimum(full * plane[..., None], MOST_BOUNCED * bare.max((0, 1)))
            unshadowed += bare
            if objects:
                if self._alone is not None:
                    full = self._radiance(self._alone, camera, seed, MOST_BOUNCES)
                radiance += full * solid[..., None]
                cover += solid
                sharp += np.isin(shape, self._mirrors)
                features += looks * solid[..., None]
            done(window.width * window.height * (number + 1))
        return radiance, cover, shadowed, unshadowed, features, sharp

    def _met(
        self, camera: Any, seed: int, looks: bool
    ) -> tuple[Int[np.ndarray, "height width"], Float[np.ndarray, "height width n"]]:
        """The shape that each ray meets first: 0 none, then from 1 on; its albedo and normal.

        The same seed gives the same rays as in `_radiance`. Mitsuba could give both at once, which
        takes twice as long as one after the other.
        """
        values = self._image(
            self._full, camera, seed, {"type": "aov", "aovs": AOVS if looks else SHAPE}
        )
        return np.round(values[..., 0]).astype(int), values[..., 1:]

    def _radiance(
        self, scene: Any, camera: Any, seed: int, bounces: int
    ) -> Float[np.ndarray, "height width 3"]:
        return self._image(
            scene, camera, seed, {"type": "path", "max_depth": bounces + 1, "rr_depth": 3}
        )

    def _image(
        self, scene: Any, camera: Any, seed: int, how: dict[str, Any]
    ) -> Float[np.ndarray, "height width n"]:
        integrator = self._mi.load_dict(how)
        image = self._mi.render(scene, sensor=camera, integrator=integrator, seed=seed, spp=1)
        return np.array(image).astype(float)


def _after(done: Callable[[int], None], before: int, rays: int) -> None:
    """Report rays traced after others."""
    done(before + rays)


def _joined(
    scene: Scene,
    wide: Crop,
    near: Crop,
    around: _Rays,
    soft: _Rays,
    coarse: ImageWindow,
    rounds: int,
) -> Layers:
    """The fine grid's where it is, the coarse one around it; `rounds` of smoothing."""
    height, width = wide[3] - wide[1], wide[2] - wide[0]
    radiance, cover = np.zeros((height, width, 3)), np.zeros((height, width))
    far = _enlarged(smooth_sums(np.concatenate([soft.shadowed, soft.open], -1), 1), coarse, wide)
    shadow = _quotient(far[..., :3], far[..., 3:])
    shadow = 1 + (shadow - 1) * _fading(wide, scene)[..., None]
    rows = slice(near[1] - wide[1], near[3] - wide[1])
    columns = slice(near[0] - wide[0], near[2] - wide[0])
    objects, hidden = around.radiance, around.cover
    if rounds:
        objects = without_sparks(objects, hidden)
        objects = denoised(objects, hidden, around.features, around.sharp)
        # What is left is blotches, evened by a look farther away, where creases borrow nothing;
        # pictures in mirrors stay.
        even = denoised(objects, hidden, around.features, hidden, step=2)
        objects = np.where((around.sharp > hidden / 2)[..., None], objects, even)
    radiance[rows, columns], cover[rows, columns] = objects, hidden
    sums = np.concatenate([around.shadowed, around.open], -1)
    sums = smooth_sums(sums, min(rounds, 6))
    sharp, weight = _quotient(sums[..., :3], sums[..., 3:]), _fading(near, scene)[..., None]
    shadow[rows, columns] = sharp * weight + shadow[rows, columns] * (1 - weight)
    return Layers(wide, *(layer.astype(np.float32) for layer in (radiance, cover, shadow)))


def _around(a: Crop, b: Crop) -> Crop:
    """The smallest crop that holds both."""
    return min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])


def _quotient(above: np.ndarray, below: np.ndarray) -> np.ndarray:
    """The shadow: exactly 1 where the two are the same; 1 as well where no ray saw the plane."""
    result = np.ones_like(above)
    np.divide(above, below, out=result, where=below > 0)
    return result


def _by_pixel(fine: np.ndarray, parts: int) -> np.ndarray:
    """Mean over the parts of each pixel, this number along each side."""
    height, width = fine.shape[0] // parts, fine.shape[1] // parts
    split = fine.reshape(height, parts, width, parts, *fine.shape[2:])
    result: np.ndarray = split.mean(axis=(1, 3))
    return result


def _enlarged(
    values: Float[np.ndarray, "rows columns n"], window: ImageWindow, crop: Crop
) -> Float[np.ndarray, "height width n"]:
    """A grid's values at the pixels of `crop`, bilinear."""
    for axis, (low, high, first) in enumerate(
        ((crop[1], crop[3], window.top), (crop[0], crop[2], window.left))
    ):
        at = (np.arange(low, high) + 0.5) / window.step - first - 0.5
        at = np.clip(at, 0, values.shape[axis] - 1)
        before = np.minimum(at.astype(int), max(values.shape[axis] - 2, 0))
        part = (at - before).reshape([-1 if a == axis else 1 for a in range(3)])
        after = np.minimum(before + 1, values.shape[axis] - 1)
        values = np.take(values, before, axis) * (1 - part) + np.take(values, after, axis) * part
    return values


def _fading(crop: Crop, scene: Scene) -> Float[np.ndarray, "height width"]:
    """1 inside, falling to 0 where the crop ends inside the photo, so that no seam shows."""
    camera = scene.viewpoint.camera
    left, top, right, bottom = crop
    ramps = []
    for low, high, size in ((top, bottom, camera.height), (left, right, camera.width)):
        at = np.arange(high - low) + 0.5
        width = max(BORDER * (high - low), 1.0)
        begin = at / width if low > 0 else np.ones_like(at)
        end = (high - low - at) / width if high < size else np.ones_like(at)
        ramps.append(np.clip(np.minimum(begin, end), 0, 1))
    return np.outer(*ramps)
