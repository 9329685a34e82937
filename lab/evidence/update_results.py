"""Put the numbers of evaluations into README.md, MODEL_CARD.md and docs/results*.md.

python -m lab.evidence.update_results FOLDER...     folders that `deeplight evaluate --out` wrote

docs/results.md has one table for each split; docs/results-full.md has every number: indoor and
outdoor apart, errors against the true light, change from frame to frame.

`make results` does both. Only what stands between markers is replaced:

    <!-- results: NAME -->
    ...
    <!-- results end -->

A folder whose run.toml is missing, or is of other data than its numbers, is refused.
"""

import json
import re
import shutil
import sys
import textwrap
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
FORMS = {
    "l1_diffuse": "{:.3f}",
    "l1_matte_silver": "{:.3f}",
    "l1_mirror": "{:.3f}",
    "theta_rgb_deg": "{:.1f}",
    "radiance_absolute": "{:.2f}",
}
LIGHT_FORMS = {
    "energy_stops_absolute": "{:.2f}",
    "direction_deg": "{:.0f}",
    "intensity_stops_absolute": "{:.2f}",
    "linear_diffuse": "{:.2f}",
    "mirror_detail": "{:.2f}",
}
SCENES = ("indoor", "outdoor", "both")
SPHERES = ("l1_diffuse", "l1_matte_silver", "l1_mirror")
IN_WORDS = {
    "deeplight": "**the shipped model**",
    "training_mean": "mean light of the training places",
    "best_constant": "best fixed light (fitted to the training spheres)",
    "photo_mean": "even light of the photo's mean colour",
    "khan_2006": "Khan et al. 2006",
    "nearest_neighbour": "light of the most similar training photo (after Karsch et al. 2014)",
}
DOCUMENTS = ("README.md", "MODEL_CARD.md", "docs/results.md", "docs/results-full.md")
SPLITS = {"val": "validation", "test": "test"}

Rows = Mapping[tuple[str, str, str, str], Mapping[str, Any]]


class RefusedError(Exception):
    """Numbers that cannot be traced, or a document without a place for them."""


@dataclass(frozen=True)
class Results:
    """Summaries by (split, estimator, scene, metric), and flicker by split."""

    rows: Rows
    flicker: Mapping[str, Sequence[Mapping[str, Any]]]

    @property
    def splits(self) -> list[str]:
        return list(dict.fromkeys(split for split, *_ in self.rows))

    def estimators(self, split: str) -> list[str]:
        return list(dict.fromkeys(name for own, name, *_ in self.rows if own == split))

    def count(self, split: str) -> tuple[int, int]:
        """Examples and places."""
        row = next(row for (own, _, scene, _), row in self.rows.items()
                   if own == split and scene == "both")  # fmt: skip
        return row["examples"] + row["undefined"], row["places"]


def load(folders: Sequence[Path]) -> Results:
    """Read evaluations; raises RefusedError."""
    rows: dict[tuple[str, str, str, str], Mapping[str, Any]] = {}
    flicker: dict[str, Sequence[Mapping[str, Any]]] = {}
    for folder in folders:
        found = json.loads((folder / "results.json").read_text(encoding="utf-8"))
        record = folder / "run.toml"
        if not record.is_file():
            raise RefusedError(f"{folder} has no run.toml: nobody could repeat its numbers")
        facts = tomllib.loads(record.read_text(encoding="utf-8"))["run_facts"]
        if facts["data_manifest_sha256"] != found["data_manifest_sha256"]:
            raise RefusedError(f"{record} is of other data than {folder / 'results.json'}")
        for row in found["summary"]:
            split = row.get("split", found["split"])  # version 1 had one split
            rows[split, row["estimator"], row["scene"], row["metric"]] = row
        flicker |= found.get("flicker", {})
    return Results(rows, flicker)


def summary(results: Results) -> str:
    """The few rows of the README and the model card."""
    splits = [split for split in SPLITS if split in results.splits]
    counts = {split: results.count(split) for split in splits}
    heads = [f"{SPLITS[s]}, {counts[s][1]} places" for s in splits]
    lines = [f"| L1 diffuse / silver / mirror, angle of colour | {' | '.join(heads)} |"]
    lines += ["|---" * (len(splits) + 1) + "|"]
    for name, words in IN_WORDS.items():
        if any(name in results.estimators(split) for split in splits):
            lines.append(f"| {words} | {' | '.join(_short(results, s, name) for s in splits)} |")
    ratios = [_ratios(results, split) for split in splits]
    frames = " and ".join(f"{counts[s][0]} frames of {SPLITS[s]} places" for s in splits)
    sentence = textwrap.fill(f"On {frames}. {' '.join(ratios)}", 118, break_on_hyphens=False)
    return "\n".join([*lines, "", sentence]) + "\n"


def short_tables(results: Results) -> str:
    """One table for each split, and the model's errors over those of constant lighting."""
    forms = {metric: FORMS[metric] for metric in (*SPHERES, "theta_rgb_deg")}
    head = ["", "L1 diffuse", "L1 silver", "L1 mirror", "angle of colour, °", "direction, °"]
    parts: list[str] = []
    over: list[list[str]] = []
    for split in results.splits:
        rows = [
            [
                name,
                *(cell(results, (split, name, "both", m), form) for m, form in forms.items()),
                cell(results, (split, name, "both", "direction_deg"), "{:.0f}", "median"),
            ]
            for name in results.estimators(split)
        ]
        parts += [_heading(results, split), table(head, rows)]
        over += [
            [f"{split}, of {name}", *ratios]
            for name, _, *ratios in _ratio_rows(results, split, ("both",))
        ]
    return "\n".join([*parts, table(["the model's L1", "diffuse", "silver", "mirror"], over)])


def full_tables(results: Results) -> str:
    """Every estimator by split and scene, with 95 % intervals."""
    return "\n".join(part for split in results.splits for part in _split(results, split))


def _split(results: Results, split: str) -> list[str]:
    head = ["", "scene", "L1 diffuse", "L1 silver", "L1 mirror", "angle of colour, °", "radiance"]
    rows = [
        [name, scene, *(cell(results, (split, name, scene, m), f) for m, f in FORMS.items())]
        for name in results.estimators(split)
        for scene in SCENES
    ]
    over = [f"{results.estimators(split)[0]} over", "scene", "diffuse", "silver", "mirror"]
    return [
        _heading(results, split),
        table(head, rows),
        table(over, _ratio_rows(results, split, SCENES)),
        *_light(results, split),
    ]


def _heading(results: Results, split: str) -> str:
    examples, places = results.count(split)
    return f"### {split}: {examples} examples in {places} places\n"


def _ratio_rows(results: Results, split: str, scenes: Sequence[str]) -> list[list[str]]:
    """What the model's errors are of those of each constant lighting."""
    first = results.estimators(split)[0]
    ratios = {
        (scene, metric): results.rows[split, first, scene, metric]["ratio"]
        for scene in scenes
        for metric in SPHERES
    }
    return [
        [name, scene, *(with_interval("{:.2f}", ratios[scene, m][name]) for m in SPHERES)]
        for name in ratios["both", SPHERES[0]]
        for scene in scenes
    ]


def _light(results: Results, split: str) -> list[str]:
    """What is known of versions that compare with the true light."""
    names = results.estimators(split)
    if (split, names[0], "both", "direction_deg") not in results.rows:
        return []
    head = ["medians", "energy, stops", "direction, °", "main light, stops", "linear diffuse"]
    rows = [
        [n, *(cell(results, (split, n, "both", m), f, "median") for m, f in LIGHT_FORMS.items())]
        for n in names
    ]
    shown = [table([*head, "mirror detail"], rows)]
    if results.flicker.get(split):
        head = ["from frame to frame", "change, stops", "error of the change, stops"]
        cells = [
            [f["estimator"], *(with_interval("{:.2f}", f[part]) for part in ("change", "error"))]
            for f in results.flicker[split]
        ]
        shown.append(table(head, cells))
    return shown


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)]) + "\n"


def cell(results: Results, key: tuple[str, str, str, str], form: str, kind: str = "mean") -> str:
    row = results.rows.get(key)
    return with_interval(form, row[kind]) if row else "–"


def with_interval(form: str, value: Mapping[str, float | None]) -> str:
    """A number and its 95 % interval; a dash where there is none."""
    if value["value"] is None:
        return "–"
    low, high = form.format(value["low"]), form.format(value["high"])
    return f"{form.format(value['value'])} ({low} to {high})"


def _short(results: Results, split: str, name: str) -> str:
    found = [results.rows.get((split, name, "both", m)) for m in (*SPHERES, "theta_rgb_deg")]
    if None in found:
        return "–"
    *spheres, angle = (row["mean"]["value"] for row in found if row)
    return " / ".join(f"{value:.3f}" for value in spheres) + f", {angle:.1f}°"


def _ratios(results: Results, split: str) -> str:
    """What the model's errors are of those of constant lighting."""
    first = results.estimators(split)[0]
    rows = [results.rows[split, first, "both", metric]["ratio"] for metric in SPHERES]
    parts = [
        " / ".join(f"{row[name]['value']:.2f}" for row in rows) + f" of {words}"
        for name, words in (
            ("training_mean", "training-mean lighting's"),
            ("best_constant", "the best fixed light's"),
        )
        if name in rows[0]
    ]
    return f"On {SPLITS[split]} the model's L1 is {', '.join(parts)}." if parts else ""


def replaced(text: str, blocks: Mapping[str, str], name: str) -> str:
    """Put each block between its markers; raises RefusedError if the document has none of them."""
    count = 0
    for block, content in blocks.items():
        pattern = rf"(<!-- results: {re.escape(block)} -->\n).*?(<!-- results end -->)"
        parts = re.split(pattern, text, flags=re.DOTALL)
        found = len(parts) // 3
        text = "".join(part + (content if i % 3 == 1 else "") for i, part in enumerate(parts))
        count += found
    if not count:
        raise RefusedError(f"{name} has no <!-- results: NAME --> markers")
    return text


def update(folders: Sequence[Path], root: Path = ROOT) -> list[Path]:
    """Rewrite the documents under `root`; give those that changed."""
    results = load(folders)
    blocks = {
        "summary": summary(results),
        "tables": short_tables(results),
        "full tables": full_tables(results),
    }
    documents = [root / name for name in DOCUMENTS]
    texts = {path: path.read_text(encoding="utf-8") for path in documents}
    new = {path: replaced(text, blocks, path.name) for path, text in texts.items()}
    changed = [path for path in documents if new[path] != texts[path]]
    for path in changed:
        path.write_text(new[path], encoding="utf-8")
    for folder in folders:
        picture = folder / "pictures" / "percentiles_val.png"
        if picture.is_file():
            shutil.copyfile(picture, root / "docs" / "pictures" / "percentiles.png")
    return changed


if __name__ == "__main__":
    try:
        done = update([Path(argument) for argument in sys.argv[1:]])
    except (RefusedError, OSError, KeyError, ValueError) as error:
        sys.exit(f"update_results: {error}")
    print("\n".join(f"wrote {path.relative_to(ROOT)}" for path in done) or "nothing changed")
