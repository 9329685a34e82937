"""How well the spheres of clips with known rigs are found.

python -m lab.evidence.capture_accuracy FOLDER [--overlays FOLDER] [--tag | --saved]

Locates the rig of every FOLDER/**/*.mp4 that has a .truth.json next to it and prints a Markdown
table and a summary, in pixels of a 1080-wide frame. `--tag`: by the tag on the bar and
CLIP.rig.json. `--saved`: the first clip's rig is located, and looked for in the others.
"""

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from deeplight.camera import PinholeCamera
from deeplight.capture.conic import pixel_scale
from deeplight.capture.locate import Located, LocateSettings, NotLocated, locate
from deeplight.capture.located import cones_of
from deeplight.capture.rig_file import read_rig_file
from deeplight.io.photos import write_png
from deeplight.io.video import video_frames
from deeplight.sphere import SPHERES


@dataclass(frozen=True)
class Score:
    """What came of one clip."""

    name: str
    trouble: str
    centre_px: tuple[float, ...]  # in SPHERES order; empty when not located
    radius_percent: tuple[float, ...]
    confidence: float
    seconds: float
    reason: str

    @property
    def outcome(self) -> str:
        if not self.centre_px:
            return "not found"
        wrong = max(self.centre_px) > 20 or max(map(abs, self.radius_percent)) > 12
        return "WRONG" if wrong else "found"

    def row(self) -> str:
        centre = " ".join(f"{v:.2f}" for v in self.centre_px)
        radius = " ".join(f"{v:+.2f}" for v in self.radius_percent)
        return (
            f"| {self.name} | {self.trouble} | {self.outcome} | {centre} | {radius} "
            f"| {self.confidence:.2f} | {self.seconds:.1f} | {self.reason} |"
        )


def score(clip: Path, how: LocateSettings, overlays: Path | None) -> tuple[Score, Located | None]:
    """Locate one clip's spheres and compare them with the truth."""
    truth = json.loads(clip.with_suffix(".truth.json").read_text())
    size = truth["camera"]
    camera = PinholeCamera(size["width"], size["height"], np.radians(size["vertical_fov_deg"]))
    start, found, reason = time.perf_counter(), None, ""
    picture: np.ndarray | None
    try:
        found = locate(video_frames(clip), camera, how)
        picture = found.overlay
    except NotLocated as error:
        reason, picture = error.got, error.overlay
    seconds = time.perf_counter() - start
    if overlays and picture is not None:
        write_png(overlays / f"{clip.stem}.png", picture)
    centre, radius = errors(found, truth["rig"]["spheres"], camera) if found else ((), ())
    sure = float(min(found.confidence.values())) if found else 0.0
    trouble = ", ".join(truth.get("trouble", []))
    return Score(clip.stem, trouble, centre, radius, sure, seconds, reason), found


def errors(
    found: Located, truth: dict[str, dict[str, Any]], camera: PinholeCamera
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Errors of centres, in pixels of a 1080-wide frame, and of radii, in percent."""
    cones = cones_of(found.rig)
    scale = pixel_scale(camera) * 1080 / min(camera.width, camera.height)
    centre, radius = [], []
    for name in SPHERES:
        true = np.array(truth[name]["direction"])
        across = np.linalg.norm(np.cross(cones[name].direction, true / np.linalg.norm(true)))
        centre.append(float(np.arcsin(min(float(across), 1.0)) * scale))
        ratio = cones[name].angular_radius_rad / truth[name]["angular_radius_rad"]
        radius.append(100 * (ratio - 1))
    return tuple(centre), tuple(radius)


def summary(scores: list[Score]) -> None:
    """Print what the table comes to."""
    found = [s for s in scores if s.outcome == "found"]
    wrong = [s.name for s in scores if s.outcome == "WRONG"]
    print(f"\n{len(found)} of {len(scores)} clips found and named right; silently wrong: {wrong}")
    if found:
        centre = np.array([s.centre_px for s in found])
        radius = np.abs([s.radius_percent for s in found])
        for label, values in (("centre px", centre), ("radius %", radius)):
            middles = np.median(values, axis=0)
            each = ", ".join(f"{n} {m:.2f}" for n, m in zip(SPHERES, middles, strict=True))
            middle, most, worst = np.percentile(values, [50, 90, 100])
            print(f"{label}: median {middle:.2f}, 90 % {most:.2f}, worst {worst:.2f} ({each})")


def main(
    folder: tyro.conf.Positional[Path],
    overlays: Path | None = None,
    tag: bool = False,
    saved: bool = False,
) -> None:
    """How well the spheres of clips with known rigs are found."""
    clips = sorted(p for p in folder.rglob("*.mp4") if p.with_suffix(".truth.json").exists())
    print("| clip | trouble | | centre px (m, s, d) | radius % (m, s, d) | sure | s | why not |")
    print("|---|---|---|---|---|---|---|---|")
    scores, how = [], LocateSettings()
    for clip in clips:
        if tag:
            how = LocateSettings(rig=read_rig_file(clip.with_suffix(".rig.json")))
        result, found = score(clip, how, overlays)
        if saved and how.rig is None and found is not None:
            how = LocateSettings(rig=found.rig)
        scores.append(result)
        print(result.row(), flush=True)
    summary(scores)


if __name__ == "__main__":
    tyro.cli(main)
