"""What the photo and the lamps in an environment are worth, and how well it shows the photo.

    python benchmarks/photo_environment.py data/sim --split test

L1 of the three spheres over that of the training places' mean lighting (made from the data set's
"seen" splits), for the network alone and with the photo in it; brightest over mean radiance of the
ball; and of 40 x 40 degree views of the environment the median error of radiance where the photo is
not clipped, and the structural similarity with the photo (Wang et al. 2004, 7 x 7 windows).
"""

import argparse

import numpy as np

from deeplight.camera import PinholeCamera
from deeplight.camera_response import LUMINANCE, CameraResponse
from deeplight.contract import ModelContract
from deeplight.dataset import open_dataset
from deeplight.estimators.environment import assemble
from deeplight.estimators.projection import CLIPPED, ImagePlane
from deeplight.evaluate.baselines.training_mean import NAME, training_mean
from deeplight.evaluate.models import named_models
from deeplight.evaluate.run import evaluate
from deeplight.evaluate.with_photo import WithPhoto
from deeplight.lighting import Lighting
from deeplight.mappings import mirror_ball
from deeplight.mappings.resample import sample_latlong
from deeplight.preprocess import normalise

VIEW = PinholeCamera(80, 80, float(np.radians(40)))
WINDOW = 7


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data")
    parser.add_argument("--split", default="test")
    parser.add_argument("--model", default="")
    parser.add_argument("--examples", type=int, default=256)
    parser.add_argument("--views", type=int, default=40)
    given = parser.parse_args()
    data = open_dataset(given.data)
    (network,) = named_models([given.model] if given.model else [])
    mean = training_mean(data)
    with_photo = [WithPhoto(network, fill) for fill in (None, "photo", "any", "auto")]
    methods = [network, *with_photo, *([mean] if mean else [])]
    report = evaluate(methods, data, given.split, given.examples)
    reference = report.scores.get(NAME)
    print(f"{given.split}: {len(report.keys)} examples; diffuse / silver / mirror")
    for method in methods:
        l1 = report.scores[method.name].l1
        means = [float(np.nanmean(l1[name])) for name in ("diffuse", "matte_silver", "mirror")]
        line = " / ".join(f"{value:.3f}" for value in means)
        if reference is not None:
            names = ("diffuse", "matte_silver", "mirror")
            ratios = [m / np.nanmean(reference.l1[n]) for m, n in zip(means, names, strict=True)]
            line += "   of training mean: " + " / ".join(f"{value:.3f}" for value in ratios)
        log_radiance = report.log_radiance[method.name]
        detail = np.nanmedian(report.scores[method.name].more["mirror_detail"])
        line += f"   mirror's detail {detail:.2f}"
        print(f"{method.name}: {line}   brightest over mean: {peak(log_radiance):.1f}")
    index = data.index(given.split)
    numbers = np.unique(np.linspace(0, len(index) - 1, given.views).astype(int))
    errors, similar = np.array([shown(network, index[int(n)].background) for n in numbers]).T
    print(
        f"{len(numbers)} views: median error of radiance {np.median(errors):.3f} "
        f"(worst {errors.max():.3f}), SSIM {np.median(similar):.3f} (worst {similar.min():.3f})"
    )


def peak(log_radiance: np.ndarray) -> float:
    """Median over the examples of the brightest luminance over the mean one."""
    weights = mirror_ball.solid_angles(log_radiance.shape[1]) / (4 * np.pi)
    luminance = np.exp(log_radiance) @ LUMINANCE
    lit = np.where(weights > 0, luminance, 0)
    return float(np.median(lit.max((1, 2)) / (luminance * weights).sum((1, 2))))


def shown(network: object, background: np.ndarray) -> tuple[float, float]:
    """Error and similarity of a view of the environment, against the photo looked up."""
    whole = ModelContract()
    plane = ImagePlane(-whole.right, whole.right, whole.bottom, whole.top)
    log_radiance = network.estimate_inputs(normalise(background[None]))[0]
    scene = assemble(Lighting.from_log_radiance(log_radiance), background, plane, 512)
    rays = VIEW.rays()
    x, y = rays[..., 0] / -rays[..., 2], rays[..., 1] / -rays[..., 2]
    height, width, _ = background.shape
    column = (x - plane.left) / (plane.right - plane.left) * width - 0.5
    row = (plane.top - y) / (plane.top - plane.bottom) * height - 0.5
    inside = (column > 1) & (column < width - 2) & (row > 1) & (row < height - 2)
    true = bilinear(background / 255, row.clip(0, height - 1), column.clip(0, width - 1))
    seen = sample_latlong(scene.environment.radiance, rays)
    clipped = (true >= CLIPPED).any(-1)
    radiance = CameraResponse().radiance_from_pixel(true.astype(np.float32))
    use = inside & ~clipped
    error = np.abs(seen[use] - radiance[use]) / np.maximum(radiance[use], 1e-3)
    pixel = CameraResponse().pixel_from_radiance(seen)
    return float(np.median(error)), similarity(pixel @ LUMINANCE, true @ LUMINANCE)


def bilinear(values: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    top, left = row.astype(int), column.astype(int)
    bottom = np.minimum(top + 1, values.shape[0] - 1)
    right = np.minimum(left + 1, values.shape[1] - 1)
    down, across = (row - top)[..., None], (column - left)[..., None]
    upper = values[top, left] * (1 - across) + values[top, right] * across
    lower = values[bottom, left] * (1 - across) + values[bottom, right] * across
    return upper * (1 - down) + lower * down


def similarity(one: np.ndarray, other: np.ndarray) -> float:
    """Mean SSIM of two pictures of range 1."""
    windows = [np.lib.stride_tricks.sliding_window_view(p, (WINDOW, WINDOW)) for p in (one, other)]
    a, b = (w.mean((-1, -2)) for w in windows)
    va, vb = (w.var((-1, -2)) for w in windows)
    covariance = (windows[0] * windows[1]).mean((-1, -2)) - a * b
    c1, c2 = 0.01**2, 0.03**2
    ssim = (2 * a * b + c1) * (2 * covariance + c2) / ((a**2 + b**2 + c1) * (va + vb + c2))
    return float(ssim.mean())


if __name__ == "__main__":
    main()
