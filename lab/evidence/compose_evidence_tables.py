"""The tables of compose_evidence.py: means, paired differences and sides of shadows."""

import csv
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from deeplight.evaluate.bootstrap import PlaceBootstrap
from deeplight.io.atomic import replacing

UNSHADOWED = "no shadow"
AGAIN, MATERIALS = "true light again", ("diffuse", "silver")
KINDS = ("indoor", "shade", "sun")
NEAR_TRUTH_DEG, WRONG_DEG = 45, 90


@dataclass(frozen=True)
class Row:
    """One picture's errors."""

    key: str
    place: str
    kind: str
    material: str
    method: str
    object: float
    shadow: float
    blurred: float
    darkness: float
    side_deg: float
    light_deg: float
    high_deg: float
    power: float


def write_tables(folder: Path, rows: list[Row], names: list[str]) -> None:
    with replacing(folder / "errors.csv") as path, path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(asdict(rows[0])))
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    with replacing(folder / "summary.md") as path:
        path.write_text(summary(rows, names), encoding="utf-8")


def read_rows(folder: Path) -> list[Row]:
    """What `write_tables` wrote; raises ValueError for a file of another version."""
    with (folder / "errors.csv").open(newline="") as file:
        reader = csv.DictReader(file)
        names = [field.name for field in fields(Row)]
        if list(reader.fieldnames or []) != names:
            raise ValueError(f"{folder / 'errors.csv'} has other columns: run it again")
        words, numbers = names[:5], names[5:]
        return [
            Row(**{n: line[n] for n in words}, **{n: float(line[n]) for n in numbers})  # type: ignore[arg-type] # names decide which is which
            for line in reader
        ]


def summary(rows: list[Row], names: list[str]) -> str:
    """Markdown: means (of darkness medians) by material and kind, paired differences, sides."""
    lines: list[str] = []
    for error in ("object", "shadow", "blurred", "darkness"):
        for material in MATERIALS:
            lines += [f"\n{error}, {material}", "", "| light | all | indoor | shade | sun |"]
            lines += ["|---|---|---|---|---|"]
            for name in (*names, AGAIN, UNSHADOWED):
                picked = [r for r in rows if r.material == material and r.method == name]
                cells = [_cell(picked, error)]
                for kind in KINDS:
                    cells.append(_cell([r for r in picked if r.kind == kind], error))
                lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join([*lines, *differences(rows, names), *sides(rows, names), ""])


def _cell(rows: list[Row], error: str) -> str:
    if not rows:
        return "-"
    bootstrap, values = PlaceBootstrap(_places(rows)), _values(rows, error)
    # A quotient may be huge where the true shadow is nearly nothing.
    interval = bootstrap.median(values) if error == "darkness" else bootstrap.mean(values)
    return f"{interval.value:.3f} ({interval.low:.3f} to {interval.high:.3f}, n = {len(rows)})"


def differences(rows: list[Row], names: list[str]) -> list[str]:
    """The first method's error less each other's, case by case."""
    columns = [(error, m) for error in ("object", "shadow", "blurred") for m in MATERIALS]
    lines = ["", f"{names[0]} less the other, pairs of one case; places resampled", ""]
    lines += ["| light | " + " | ".join(f"{e}, {m}" for e, m in columns) + " |"]
    lines += ["|---" * (1 + len(columns)) + "|"]
    for name in names[1:]:
        cells = []
        for error, material in columns:
            ours, theirs = (
                [r for r in rows if r.material == material and r.method == method]
                for method in (names[0], name)
            )
            pairs = PlaceBootstrap(_places(ours))
            found = pairs.difference(_values(ours, error), _values(theirs, error))
            cells.append(f"{found.value:+.3f} ({found.low:+.3f} to {found.high:+.3f})")
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def sides(rows: list[Row], names: list[str]) -> list[str]:
    """Do shadows fall to the right side where the dominant light is about right?"""
    lines = ["", f"shadows under dominant light within {NEAR_TRUTH_DEG} degrees of the truth", ""]
    lines += ["| light | scenes | pictures | without a side | median off | most | wrong side |"]
    lines += ["|---" * 7 + "|"]
    for name in names:
        for kinds in (("sun",), KINDS):
            near = [r for r in rows if r.method == name and r.kind in kinds]
            near = [r for r in near if r.light_deg < NEAR_TRUTH_DEG]
            off = _values(near, "side_deg")
            known = off[np.isfinite(off)]
            cells = [len(near), len(near) - len(known), "-", "-", 0]
            if len(known):
                cells[2:] = [
                    f"{np.median(known):.0f}",
                    f"{known.max():.0f}",
                    (known > WRONG_DEG).sum(),
                ]
            scenes = "sun" if len(kinds) == 1 else "all"
            lines.append(f"| {name} | {scenes} | {' | '.join(map(str, cells))} |")
    return lines


def _places(rows: list[Row]) -> np.ndarray:
    return np.array([row.place for row in rows])


def _values(rows: list[Row], error: str) -> np.ndarray:
    return np.array([getattr(row, error) for row in rows], float)
