"""A frame of the film, put together and developed, and the true crops of its spheres."""

from collections.abc import Iterator, Mapping

import numpy as np
from jaxtyping import Float, Float32, Int, UInt8

from deeplight.camera import PinholeCamera
from deeplight.camera_response import encode
from deeplight.frames import Rotation, looking_at, turned
from deeplight.mappings import mirror_ball, resample
from deeplight.simulate.phone import CameraAutomatics, vignetting
from deeplight.sphere import CROP_SIZE, SPHERES
from lab.film.overlay import Solid, holder_in_picture, sphere_patch
from lab.film.reflections import CROP, Crop
from lab.film.rig import FilmRig
from lab.film.scenery import doubled
from lab.film.world import MATERIALS, World

Root = Float32[np.ndarray, "3 height width"]

_IDENTITY = np.eye(3)
_BRIGHTEST = 1.5  # times white: how far the tone curve's table goes, so that noise clips last
_TABLE = 4096
_MIDDLE = 0.2  # radiance at which the noise is exact; a tenth off in the dark
_DENOISED = 4  # sensor pixels behind a film's pixel, for a phone's noise reduction
_NOISE_BANK, _STRETCH = 1 << 20, 1 << 16


class FrameMaker:
    """A maker of whole frames; everything that a clip does not change is kept.

    A frame is handed on as the square root of radiance relative to white, planes first: roots
    interpolate as eyes see, and index the tone curve's table finely in the dark.
    """

    def __init__(
        self,
        rig: FilmRig,
        camera: PinholeCamera,
        world: World,
        automatics: CameraAutomatics,
        upright_from_phone: Rotation = _IDENTITY,
    ) -> None:
        self._world, self._habits = world, automatics
        self._holder = holder_in_picture(rig, camera)
        self._patches = {name: sphere_patch(rig, name, camera) for name in SPHERES}
        self._alpha = {name: rig.view(name, CROP).alpha()[..., None] for name in SPHERES}
        self._turned = {
            name: _upright_crop(rig.centres_m[name], upright_from_phone) for name in SPHERES
        }
        self._lens = _lens(camera.height, camera.width, automatics)
        self._half_lens = _lens(-(-camera.height // 2), -(-camera.width // 2), automatics)
        self._shape = camera.height, camera.width
        self.curve = tone_curve(automatics)

    def root(
        self,
        scenery: Float32[np.ndarray, "3 half_height half_width"],
        crops: Mapping[str, Crop],
        pose: Rotation,
        gain: Float[np.ndarray, "3"],
        finger: Solid | None = None,
    ) -> Root:
        """The whole frame without noise, unclipped."""
        half = scenery * gain.astype(np.float32)[:, None, None]
        half *= self._half_lens
        np.sqrt(half, out=half)
        frame = np.ascontiguousarray(doubled(half)[:, : self._shape[0], : self._shape[1]])
        self._lay(frame, self._holder, pose, gain)
        for name, patch in self._patches.items():
            flat = crops[name].reshape(-1, 3)
            pairs = zip(patch.taps, patch.weights, strict=True)
            sphere = np.sum([flat.take(tap, axis=0) * weight for tap, weight in pairs], axis=0)
            sphere *= self._lens[patch.rows, patch.columns, None] * gain.astype(np.float32)
            under = frame[:, patch.rows, patch.columns].transpose(1, 2, 0) ** 2
            mixed = under + patch.alpha * (sphere - under)
            frame[:, patch.rows, patch.columns] = np.sqrt(mixed).transpose(2, 0, 1)
        if finger is not None:
            self._lay(frame, finger, pose, gain)
        return frame

    def true_crops(
        self,
        frame: Root,
        crops: Mapping[str, Crop],
        gain: Float[np.ndarray, "3"],
        finger: Solid | None = None,
    ) -> UInt8[np.ndarray, "3 size size 3"]:
        """The spheres as ideal cameras see them, in the order of `SPHERES`, without noise.

        Each in the frame that `looking_at` gives its direction in the upright picture's camera.
        Clipped at white as the frame is, then averaged in linear light, then encoded. Next to the
        sphere and where a finger covers it the crop shows the frame.
        """
        result = []
        covered = np.zeros(self._shape, np.float32)
        if finger is not None:
            covered[finger.row, finger.column] = finger.alpha[:, 0]
        for name, patch in self._patches.items():
            at = patch.frame_row, patch.frame_column
            lens = self._lens[at][..., None]
            sphere = crops[name] * lens * gain.astype(np.float32)
            share = self._alpha[name] * (1 - covered[at][..., None])
            behind = frame[(slice(None), *at)].transpose(1, 2, 0) ** 2
            whole = np.clip(sphere * share + behind * (1 - share), 0, 1)
            whole = whole.reshape(-1, 3)[self._turned[name]].reshape(whole.shape)
            small = resample.shrink(whole, CROP_SIZE, CROP_SIZE)
            result.append(np.round(_through(self.curve, np.sqrt(small))).astype(np.uint8))
        return np.stack(result)

    def covered(self, finger: Solid | None) -> dict[str, float]:
        """Share of each sphere that a finger hides."""
        if finger is None:
            return dict.fromkeys(SPHERES, 0.0)
        hidden = np.zeros(self._shape, np.float32)
        hidden[finger.row, finger.column] = finger.alpha[:, 0]
        return {
            name: float((hidden[p.rows, p.columns, None] * p.alpha).sum() / p.alpha.sum())
            for name, p in self._patches.items()
        }

    def develop(self, frame: Root, rng: np.random.Generator) -> UInt8[np.ndarray, "height width 3"]:
        """The 8-bit frame: tone curve, sensor noise, clip.

        `phone.develop` for two million pixels: the gamma of a frame makes the noise of light, which
        grows with its root, nearly the same everywhere, so it is added after the curve.
        """
        steepness = _MIDDLE ** (1 / self._habits.gamma - 0.5) / self._habits.gamma
        deviation = np.sqrt(self._habits.noise / _DENOISED) * steepness * 255
        pixel = np.empty(frame.shape, np.uint8)
        flat, source = pixel.reshape(-1), frame.reshape(-1)
        for some, noise in _noise(len(flat), float(deviation), rng):
            values = _through(self.curve, source[some])
            values += noise
            values += np.float32(0.5)
            flat[some] = np.clip(values, 0, 255, out=values)
        return np.ascontiguousarray(pixel.transpose(1, 2, 0))

    def noisy_radiance(
        self, frame: Root, rng: np.random.Generator
    ) -> Float32[np.ndarray, "height width 3"]:
        """The frame with sensor noise, linear and unclipped: for HDR video."""
        noisy = frame.copy()
        # d(root) = d(radiance) / (2 root): the noise of light is even in the root.
        flat = noisy.reshape(-1)
        deviation = float(np.sqrt(self._habits.noise / _DENOISED) / 2)
        for some, noise in _noise(len(flat), deviation, rng):
            flat[some] += noise
        np.maximum(noisy, 0, out=noisy)
        return np.ascontiguousarray((noisy * noisy).transpose(1, 2, 0))

    def _lay(self, frame: Root, solid: Solid, pose: Rotation, gain: np.ndarray) -> None:
        """Lay something matte over the frame."""
        light = self._world.glossy[MATERIALS.index("diffuse")]
        shade = resample.sample_latlong(light, turned(solid.normal, pose)) * solid.colour
        at = solid.row, solid.column
        shade = shade * gain.astype(np.float32) * self._lens[at][:, None]
        under = frame[(slice(None), *at)].T ** 2
        frame[(slice(None), *at)] = np.sqrt(under + solid.alpha * (shade - under)).T


def tone_curve(automatics: CameraAutomatics) -> Float32[np.ndarray, "table"]:
    """The pixel value, 0 to 255 and beyond, at roots of radiance up to that of `_BRIGHTEST`."""
    radiance = np.linspace(0, np.sqrt(_BRIGHTEST), _TABLE) ** 2
    pixel = encode(radiance, automatics.gamma)
    below = np.minimum(pixel, 1)
    pixel = pixel + automatics.contrast * below * (1 - below) * (2 * below - 1)
    return (pixel * 255).astype(np.float32)


def _through(curve: np.ndarray, root: np.ndarray) -> np.ndarray:
    index = root * np.float32((_TABLE - 1) / np.sqrt(_BRIGHTEST))
    index += np.float32(0.5)
    np.minimum(index, _TABLE - 1, out=index)
    return curve.take(index.astype(np.intp))


def _noise(
    count: int, deviation: float, rng: np.random.Generator
) -> Iterator[tuple[slice, np.ndarray]]:
    """Normal noise for each stretch of `count` values: stretches of one bank in random order,
    because drawing every number anew would take longer than all the rest of a frame."""
    bank = rng.standard_normal(_NOISE_BANK, np.float32) * np.float32(deviation)
    for start in range(0, count, _STRETCH):
        length = min(_STRETCH, count - start)
        first = int(rng.integers(_NOISE_BANK - length + 1))
        yield slice(start, start + length), bank[first : first + length]


def _upright_crop(
    centre_m: Float[np.ndarray, "3"], upright_from_phone: Rotation
) -> Int[np.ndarray, "pixels"]:
    """For each pixel of the crop in the upright camera's frame the pixel in the phone's."""
    upright = looking_at(upright_from_phone @ centre_m) @ upright_from_phone
    phone_from_upright = looking_at(centre_m) @ upright.T  # a turn about the view axis
    u, v = mirror_ball.grid(CROP)
    right, up = (phone_from_upright[n, 0] * u + phone_from_upright[n, 1] * v for n in (0, 1))
    column = np.clip((right + 1) * (CROP / 2), 0, CROP - 1).astype(int)
    row = np.clip((1 - up) * (CROP / 2), 0, CROP - 1).astype(int)
    index: np.ndarray = (row * CROP + column).ravel()
    return index


def _lens(
    height: int, width: int, automatics: CameraAutomatics
) -> Float32[np.ndarray, "height width"]:
    """Share of light that the lens passes."""
    row = (np.arange(height) + 0.5) * (2 / height) - 1
    column = (np.arange(width) + 0.5) * (2 / width) - 1
    return vignetting(row[:, None], column[None, :], automatics).astype(np.float32)
