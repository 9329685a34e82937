"""Which files another checkout of DeepLight writes byte for byte as this one does.

git worktree add ../first 85965bf
python -m lab.evidence.same_bytes ../first --hdri FOLDER

Both film a data set in the first panoramas of FOLDER (with manifest.csv), train twenty steps on it
and evaluate the other checkout's network; and both bring that network's estimates of the example
photos, as the other checkout made them, into every format of `deeplight convert`. All of it is kept
in --out, to look at what differs.
"""

import csv
import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, product
from pathlib import Path
from typing import Any

import numpy as np
import tyro

HERE = Path(__file__).resolve().parents[2]
# Many commands in one process, as `deeplight` runs them; both checkouts have this entry.
PROGRAM = """
import json, sys
from deeplight.cli.main import main
for words in json.load(sys.stdin):
    if main(words):
        sys.exit(" ".join(words))
"""
FORMATS = {
    "hdr jpg ktx2": (("hdr",), ("jpg",), ("ktx2",)),
    "exr": (("exr",), ("blender.exr", "--for", "blender"), ("three.exr", "--for", "three")),
    "glb gltf": (("glb",), ("gltf",)),
    "json": (("json",), ("webxr.json",)),
    "py js": (("py",), ("js",)),
}
"""By row of the table: endings, with further words of the command."""
RECIPE = (("train-takes", 2), ("eval-takes", 2), ("seen-takes", 0), ("frames", 4))
TRAINING = ("schedule.steps=20", "schedule.batch_size=8", "run.log_every=5")


@dataclass(frozen=True)
class Args:
    """What is compared."""

    other: tyro.conf.Positional[Path]
    """The other checkout."""
    hdri: Path
    """Panoramas with manifest.csv."""
    out: Path = Path("out/same_bytes")
    """Folder of everything that both write; what lies there already is only compared."""
    places: int = 1
    """Panoramas of each split and scene: six in all, or twelve, ..."""


def run_in(checkout: Path, *commands: Sequence[object]) -> None:
    """Run words of `deeplight` in a checkout; its last line says which one failed."""
    subprocess.run(
        (sys.executable, "-c", PROGRAM),
        input=json.dumps([[str(word) for word in words] for words in commands]),
        env=os.environ | {"PYTHONPATH": str(checkout / "src"), "OMP_NUM_THREADS": "1"},
        stdout=subprocess.DEVNULL,
        text=True,
        check=True,
    )


def few_panoramas(hdri: Path, out: Path, places: int) -> Path:
    """Link the first panoramas of each split and scene into `out`, with their manifest."""
    out.mkdir(parents=True)
    with (hdri / "manifest.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    with (out / "manifest.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        for kind in product(("train", "val", "test"), ("indoor", "outdoor")):
            usable = (r for r in rows if r["synthetic_ground"] != "true")
            for row in islice((r for r in usable if (r["split"], r["scene"]) == kind), places):
                writer.writerow(row)
                (out / row["file"]).symlink_to((hdri / row["file"]).resolve())
    return out


def make_all(checkout: Path, folder: Path, panoramas: Path, weights: Path, lights: Path) -> None:
    """Make everything that is compared, in `folder`."""
    recipe = (word for name, value in RECIPE for word in (f"--recipe.{name}", str(value)))
    film = ("simulate", "--hdri", panoramas, "--out", folder / "data", "--workers", "1", *recipe)
    settings = (word for setting in TRAINING for word in ("--set", setting))
    train = ("train", "--data", folder / "data", "--out", folder / "run", *settings)
    evaluate = ("evaluate", "--data", folder / "data", "--split", "val", "--out", folder / "eval")
    converted = [
        ("convert", light, "--out", folder / "lights" / f"{light.stem}.{ending}", *more)
        for light in sorted(lights.glob("*.json"))
        for endings in FORMATS.values()
        for ending, *more in endings
    ]
    (folder / "lights").mkdir(parents=True)
    run_in(checkout, film, (*train, "--preset", "small-width035"))
    run_in(checkout, (*evaluate, "--model", weights), *converted)


def values(path: Path) -> dict[str, Any]:
    """What a file says, by part, of kinds whose bytes also say when and by whom it was written."""
    from deeplight.io.radiance import read_hdr

    if path.suffix == ".exr":
        return {"": read_hdr(path)}
    if path.suffix == ".safetensors":
        from safetensors.numpy import load_file

        return load_file(path)
    if path.suffix == ".csv":
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        return {c: [row[c] for row in rows] for c in rows[0] if c != "images_per_second"}
    return {"": path.read_bytes()}


def difference(a: Path, b: Path) -> str:
    """Name the parts of two files that do not say the same, and their kind; empty if all do."""
    one, two = values(a), values(b)
    known = one.keys() & two.keys()
    parts = (one.keys() ^ two.keys()) | {p for p in known if not np.array_equal(one[p], two[p])}
    return " ".join([*sorted(parts), "".join(a.suffixes)]).strip() if parts else ""


def row_of_files(name: str, here: list[Path], other: list[Path]) -> str:
    """Count the files of two lists, which go together by name, that are the same."""
    theirs = {path.name: path for path in other}
    both = [(path, theirs[path.name]) for path in here if path.name in theirs]
    same_bytes = sum(a.read_bytes() == b.read_bytes() for a, b in both)
    unlike = Counter(filter(None, (difference(a, b) for a, b in both)))
    alone = {path.name for path in here} ^ set(theirs)
    others = [f"{count} {kind}" for kind, count in sorted(unlike.items())]
    others += [f"only one has {name}" for name in sorted(alone)]
    same = len(both) - unlike.total()
    return f"| {name} | {len(both)} | {same_bytes} | {same} | {', '.join(others)} |"


def row_of_means(here: Path, other: Path) -> str:
    """Count the means of two evaluations that are the same; the others' largest difference."""
    mine, theirs = (
        {
            (row["estimator"], row["scene"], row["metric"]): row["mean"]["value"]
            for row in json.loads((folder / "results.json").read_text())["summary"]
            if row["mean"]["value"] is not None
        }
        for folder in (here, other)
    )
    both = mine.keys() & theirs.keys()
    off: dict[str, float] = {}
    for estimator, *which in sorted(key for key in both if mine[key] != theirs[key]):
        key = (estimator, *which)
        off[estimator] = max(off.get(estimator, 0), abs(mine[key] - theirs[key]))
    same = sum(mine[key] == theirs[key] for key in both)
    said = ", ".join(f"{name} by {most:.2g}" for name, most in off.items())
    return f"| means of {len({k[0] for k in both})} estimators | {len(both)} | | {same} | {said} |"


def table(here: Path, other: Path) -> Iterator[str]:
    """The rows."""

    def files(folder: Path, *patterns: str) -> list[Path]:
        return sorted({p for pattern in patterns for p in folder.glob(pattern) if p.is_file()})

    yield "| what | in both | same bytes | same values | others |"
    yield "|---|---|---|---|---|"
    data = (files(folder / "data", "[!.]*") for folder in (here, other))  # caches are hidden
    yield row_of_files("data set", *data)
    trained = "losses.csv", "validation.csv", "best.safetensors"
    yield row_of_files("training", files(here / "run", *trained), files(other / "run", *trained))
    yield row_of_means(here / "eval", other / "eval")
    for name, endings in FORMATS.items():
        wanted = tuple(f"*.{ending}" for ending, *_ in endings)
        mine, theirs = (files(folder / "lights", *wanted) for folder in (here, other))
        yield row_of_files(name, mine, theirs)


def main(args: Args) -> None:
    """Make everything twice and print the table."""
    other, out = args.other.resolve(), args.out.resolve()
    if not out.exists():
        panoramas = few_panoramas(args.hdri, out / "panoramas", args.places)
        (weights,) = (other / "src" / "deeplight" / "weights").glob("*.onnx")
        lights, photos = out / "estimates", HERE / "examples" / "photos"
        run_in(other, ("estimate", photos, "--model", weights, "--out", lights))
        for checkout, folder in ((HERE, out / "here"), (other, out / "other")):
            make_all(checkout, folder, panoramas, weights, lights)
    print("\n".join(table(out / "here", out / "other")))


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
