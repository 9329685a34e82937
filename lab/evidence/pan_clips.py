"""Benchmark v2's panning clips: made again bit for bit, checked, and fused against known light.

    python -m lab.evidence.pan_clips HDRI [--leaderboard FILE.json] [--model A.onnx]

In every validation and test place a simulated phone turns once around itself, 12 frames with hand
shake, automatic exposure and white balance. The SHA-256 of every clip's pixels, poses and true
light is published in `benchmark_v2_pans.json` next to this file; clips that differ are refused.
Measured are the light of the first frame alone and that of all frames fused, in the first frame's
camera. `--publish` writes the checksums instead, once, when the recipe is new.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
import tyro

from deeplight.camera_response import encode
from deeplight.errors import DataSetError
from deeplight.estimators.network import NetworkEstimator
from deeplight.estimators.open import open_model
from deeplight.evaluate.benchmark import pinned
from deeplight.evaluate.bootstrap import PlaceBootstrap
from deeplight.evaluate.leaderboard import METRICS, Entry, numbers_of, update_entries
from deeplight.evaluate.light_metrics import light_errors
from deeplight.evaluate.scores import Column, rendered_radiance, score
from deeplight.fuse.frame import SourceFrame
from deeplight.fuse.fuse import FuseSettings, fuse_frames
from deeplight.io.atomic import replacing
from deeplight.jobs import processes
from deeplight.lighting import Lighting
from deeplight.reflectance import rig_bases
from deeplight.simulate.panorama import Place, load, places_in
from deeplight.sphere import PAPER_RIG
from lab.pans import Pan, Sweep, Troubles, film_pan

CHECKSUMS = Path(__file__).with_name("benchmark_v2_pans.json")
SWEEP, TROUBLES, SIZE = Sweep(12), Troubles(), (480, 270)
SPLITS = ("val", "test")
DIGITS = (3, 3, 3, 1, 2, 0)


@dataclass(frozen=True)
class Args:
    """Options of the benchmark's clips."""

    hdri: tyro.conf.Positional[Path]
    """Folder of the benchmark's panoramas."""
    model: str = ""
    """Network that looks at each frame; left out, the shipped one."""
    leaderboard: Path | None = None
    """File to append the results to; those in it already are verified."""
    publish: bool = False
    """Write the checksums of the clips instead of comparing with them."""


def clip_of(place: Place) -> Pan:
    """The clip of a place: its name decides everything that is random."""
    seed = int.from_bytes(hashlib.sha256(place.name.encode()).digest()[:4], "big")
    return film_pan(load(place), SWEEP, TROUBLES, np.random.default_rng([2, seed]), SIZE)


def clip_sha256(pan: Pan) -> str:
    """A name of a clip by its pixels, poses and true light, however they are stored."""
    digest = hashlib.sha256()
    for frame in pan.frames:
        digest.update(frame.pixels.tobytes())
        digest.update(np.round(frame.rotation, 7).astype("<f4").tobytes())
    digest.update(pan.true_lighting().radiance.astype("<f4").tobytes())
    return digest.hexdigest()


def clips(hdri: Path) -> Iterator[tuple[Place, Pan]]:
    """Film every validation and test place, in a process held to the benchmark's instructions."""
    places = [place for place in places_in(hdri) if place.split in SPLITS]
    with pinned(), processes(1) as pool:
        yield from zip(places, pool.map(clip_of, places), strict=True)


def refuse_other_bytes(found: Mapping[str, str], published: Mapping[str, str]) -> None:
    """Compare the clips' checksums with the published ones.

    Raises:
        DataSetError: a clip is missing, is one too many, or has other bytes.
    """
    names = sorted(found.keys() | published.keys())
    differ = [name for name in names if found.get(name) != published.get(name)]
    if differ:
        got = f"{len(differ)} of {len(names)} with other bytes, the first {differ[0]}"
        do = "docs/evaluate.md says what can change them"
        raise DataSetError("the clips as published", got, do)


def lights(pan: Pan, network: NetworkEstimator) -> dict[str, Lighting]:
    """What the network says of the first frame, and what all frames fused say of it."""
    fov = pan.camera.vertical_fov_rad
    frames = [
        SourceFrame(f"frame {k}", frame.pixels, k, 0.0, fov, world_from_camera=frame.rotation)
        for k, frame in enumerate(pan.frames)
    ]
    fused = fuse_frames(frames, network, FuseSettings(height=128)).environment
    alone = network.estimate(pan.frames[0].pixels, float(np.degrees(fov)))
    return {"first frame": alone, "fused": fused.lighting}


def scored(found: Sequence[Lighting], true: Sequence[Lighting]) -> dict[str, Column]:
    """Every metric of `deeplight evaluate` for some lights against the true ones."""
    bases = rig_bases(PAPER_RIG)
    own, wanted = (np.stack([light.radiance for light in lights]) for lights in (found, true))
    logs = [np.log(np.maximum(light, 1e-6)).astype(np.float32) for light in (own, wanted)]
    rendered, filmed = (rendered_radiance(bases, log) for log in logs)
    shown = {name: encode(np.minimum(values, 1)) for name, values in filmed.items()}
    return score(rendered, shown, bases, light_errors(own, wanted)).metrics()


def entry(
    name: str,
    split: str,
    columns: Mapping[str, Column],
    places: Sequence[str],
    made: tuple[str, str],
) -> Entry:
    """One row of a leaderboard; `made` is the hash of the clips and that of the model."""
    draws = PlaceBootstrap(np.array(places))
    numbers = {metric: numbers_of(draws.mean(columns[metric])) for metric in METRICS}
    data, model = made
    called = (data, "analytic", f"pans_{split}, {name}", f"deeplight, {name}", model)
    return Entry(*called, len(places), len(set(places)), numbers, version("deeplight"))


def main(args: Args) -> int:
    filmed = list(clips(args.hdri))
    found = {place.path.stem: clip_sha256(pan) for place, pan in filmed}
    text = json.dumps(found, indent=1, sort_keys=True) + "\n"
    if args.publish:
        with replacing(CHECKSUMS) as temporary:
            temporary.write_text(text, encoding="utf-8")
        print(f"{len(found)} clips: {CHECKSUMS}")
        return 0
    refuse_other_bytes(found, json.loads(CHECKSUMS.read_text(encoding="utf-8")))
    network = open_model(args.model or None)
    made = hashlib.sha256(text.encode()).hexdigest(), network.sha256
    entries = []
    for split in SPLITS:
        some = [(place, pan) for place, pan in filmed if place.split == split]
        answers = [lights(pan, network) for _, pan in some]
        true, places = [pan.true_lighting() for _, pan in some], [place.name for place, _ in some]
        for name in answers[0]:
            columns = scored([answer[name] for answer in answers], true)
            entries.append(entry(name, split, columns, places, made))
    print("| clips | places | L1(d) | L1(s) | L1(m) | θ, ° | energy, stops | main light off, ° |")
    print("|---|---|---|---|---|---|---|---|")
    for row in entries:
        cells = [
            "–" if row.numbers[metric][0] is None else f"{row.numbers[metric][0]:.{digits}f}"
            for metric, digits in zip(METRICS, DIGITS, strict=True)
        ]
        print(f"| {row.split} | {row.places} | {' | '.join(cells)} |")
    if args.leaderboard is not None:
        both = update_entries(args.leaderboard, entries)
        print("{}: {} verified, {} added".format(args.leaderboard, *map(len, both)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(tyro.cli(Args)))
