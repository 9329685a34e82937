"""How long a 12-megapixel JPEG takes to its light and environment, against decoding it whole.

    OPENBLAS_NUM_THREADS=1 python benchmarks/estimate_latency.py [--model FILE] [--rounds 15]

"light" is what the network gives, "environment" the panorama of 256 x 512 with the photo in it, one
thread each (OpenBLAS's others wait in a busy loop, which would count). In every round each is timed
in turn, so other work on the machine slows all alike; times are the process's own, and ratios are
medians over the rounds. "with its files" is what the command does of a photo: the environment, the
network asked again for its confidence if the model does not say that, and every file written. The
light is compared with that of the whole photo: mean difference of ln radiance over the ball.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from PIL import Image

from deeplight.estimators.environment import scene_light
from deeplight.estimators.network import NETWORK_SIDE
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.estimators.results import write_results
from deeplight.io.photos import read_photo

PHOTO = Path(__file__).resolve().parents[1] / "examples/photos/pagoda.jpg"
SIZES = {"upright": (3024, 4032), "on its side (EXIF 6)": (4032, 3024)}
PROMISED = {"light": 0.75, "environment": 0.95}
"""Ratios above which something has become slow; the goals are 0.45 and 0.8."""


def write_twelve_megapixels(path: Path, size: tuple[int, int], orientation: int) -> None:
    """Enlarge a real photo and add a sensor's noise, or the JPEG would decode too fast."""
    with Image.open(PHOTO) as small:
        pixels = np.asarray(small.resize(size, Image.Resampling.BICUBIC), np.float32)
    noise = np.random.default_rng(0).normal(0, 4, pixels.shape).astype(np.float32)
    exif = Image.Exif()
    exif[0x0112] = orientation
    noisy = np.clip(pixels + noise, 0, 255).astype(np.uint8)
    Image.fromarray(noisy).save(path, quality=92, exif=exif)


def decode(path: Path) -> np.ndarray:
    """Decode whole and nothing else, with the decoder that the product uses."""
    file = oiio.ImageInput.open(str(path))
    pixels: np.ndarray = file.read_image(oiio.UINT8)
    file.close()
    return pixels


def seconds(work: Callable[[], object]) -> float:
    """Processor time of one call."""
    started = time.process_time()
    work()
    return time.process_time() - started


def measure(estimator: OnnxEstimator, path: Path, rounds: int) -> dict[str, list[float]]:
    """Give the seconds of each part in each round."""
    inputs = np.zeros((1, 3, estimator.contract.height, estimator.contract.width), np.float32)

    def write_files() -> None:
        estimate = estimator.explain(path)
        write_results(estimate, estimator, path.parent, "light", scene_light(estimate))

    works: dict[str, Callable[[], object]] = {
        "decode whole": lambda: decode(path),
        "light": lambda: estimator.estimate(path),
        "environment": lambda: scene_light(estimator.explain(path)).environment,
        "with its files": write_files,
        "of which read": lambda: read_photo(path, NETWORK_SIDE),
        "read at an eighth": lambda: read_photo(path, NETWORK_SIDE // 2),
        "of which network": lambda: estimator.run(inputs),
    }
    for work in works.values():
        work()  # warm
    times: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            times[name].append(seconds(work))
    return times


def light_off(estimator: OnnxEstimator, path: Path, reduced_side: int = NETWORK_SIDE) -> float:
    """Mean difference of ln radiance between the light of the reduced and of the whole photo."""
    reduced, whole = (
        np.log(np.maximum(estimator.explain(path, max_side=side).lighting.radiance, 1e-6))
        for side in (reduced_side, None)
    )
    return float(np.abs(reduced - whole).mean())


def main() -> None:
    """Print the table; exit 1 if a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", type=Path, default=None, help="default: the shipped model")
    parser.add_argument("--rounds", type=int, default=15)
    args = parser.parse_args()
    estimator, broken = OnnxEstimator(args.model, threads=1), False
    for name, size in SIZES.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "photo.jpg"
            write_twelve_megapixels(path, size, orientation=6 if "EXIF" in name else 1)
            times, off = measure(estimator, path, args.rounds), light_off(estimator, path)
            at_an_eighth = light_off(estimator, path, NETWORK_SIDE // 2)
            megabytes = path.stat().st_size / 1e6
        print(f"12 megapixels {name}, {megabytes:.1f} MB")
        print(f"light within {off:.3f} ln, read at an eighth within {at_an_eighth:.3f}:")
        for part, values in times.items():
            pairs = zip(values, times["decode whole"], strict=True)
            ratio = statistics.median(value / whole for value, whole in pairs)
            broken |= ratio > PROMISED.get(part, np.inf)
            print(f"  {part:<18}{statistics.median(values) * 1e3:8.1f} ms{ratio:8.2f} x decoding")
    if broken:
        raise SystemExit(f"slower than promised: {PROMISED}")


if __name__ == "__main__":
    main()
