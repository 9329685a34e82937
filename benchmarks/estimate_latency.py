"""How much estimating a 12-megapixel JPEG adds to decoding it and running the bare network.

    python benchmarks/estimate_latency.py [--model FILE] [--rounds 15]

The project promises a ratio of at most 1.3 in a warm process. In every round each of the three is
timed in turn, so other work on the machine slows all of them alike; the ratio is the median over
the rounds. "ratio, fastest" takes the fastest round of each: what it would be on a quiet machine.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnxruntime as ort
import OpenImageIO as oiio
from PIL import Image

from deeplight.estimators.onnx import OnnxEstimator
from deeplight.io.photos import read_photo

PHOTO = Path(__file__).resolve().parents[1] / "examples/photos/pagoda.jpg"
SIZES = {"upright": (3024, 4032), "on its side (EXIF 6)": (4032, 3024)}
PROMISED = 1.3


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
    """Decode and nothing else, with the decoder that the product uses."""
    file = oiio.ImageInput.open(str(path))
    pixels: np.ndarray = file.read_image(oiio.UINT8)
    file.close()
    return pixels


def seconds(work: Callable[[], object]) -> float:
    """Time one call."""
    time.sleep(0.05)  # let the spinning threads of the previous network call come to rest
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def measure(estimator: OnnxEstimator, path: Path, rounds: int) -> dict[str, float]:
    """Give the median seconds of each part and the median ratio."""
    options = ort.SessionOptions()
    session = ort.InferenceSession(estimator.path, options, providers=["CPUExecutionProvider"])
    contract = estimator.contract
    inputs = np.zeros((1, 3, contract.height, contract.width), np.float32)
    works: dict[str, Callable[[], object]] = {
        "decode": lambda: decode(path),
        "bare network": lambda: session.run(None, {contract.input_name: inputs}),
        "estimate": lambda: estimator.estimate(path),
        "of which read": lambda: read_photo(path),
    }
    for work in works.values():
        work()  # warm
    times: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            times[name].append(seconds(work))
    bare = zip(times["estimate"], times["decode"], times["bare network"], strict=True)
    ratios = [whole / (decoding + network) for whole, decoding, network in bare]
    medians = {name: statistics.median(values) for name, values in times.items()}
    least = {name: min(values) for name, values in times.items()}
    quietest = least["estimate"] / (least["decode"] + least["bare network"])
    return medians | {"ratio": statistics.median(ratios), "ratio, fastest": quietest}


def main() -> None:
    """Print the table; exit 1 if the promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", type=Path, default=None, help="default: the shipped model")
    parser.add_argument("--rounds", type=int, default=15)
    args = parser.parse_args()
    estimator = OnnxEstimator(args.model)
    worst = 0.0
    for name, size in SIZES.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "photo.jpg"
            write_twelve_megapixels(path, size, orientation=6 if "EXIF" in name else 1)
            result = measure(estimator, path, args.rounds)
        worst = max(worst, result["ratio"])
        print(f"12 megapixels {name}:")
        for part, value in result.items():
            unit = f"{value:8.2f}" if part.startswith("ratio") else f"{value * 1e3:8.1f} ms"
            print(f"  {part:<16}{unit}")
    print(f"worst ratio {worst:.2f}, promised at most {PROMISED}")
    if worst > PROMISED:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
