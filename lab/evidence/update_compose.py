"""Put the numbers and pictures of compose_evidence.py into docs/compose.md.

python -m lab.evidence.update_compose [FOLDER]     what it wrote; runs/compose_test by default

Only what stands between `<!-- results: compose -->` and `<!-- results end -->` is replaced, and the
two pictures next to it. Numbers of other weights than the shipped ones are refused.
"""

import sys
import textwrap
import tomllib
from collections.abc import Callable, Iterable, Sequence
from hashlib import sha256
from pathlib import Path

import numpy as np
from PIL import Image

from deeplight.evaluate.bootstrap import Interval, PlaceBootstrap
from deeplight.io.atomic import replacing
from deeplight.io.photos import encode_jpeg
from lab.evidence.compose_evidence_tables import (
    AGAIN,
    KINDS,
    MATERIALS,
    NEAR_TRUTH_DEG,
    UNSHADOWED,
    WRONG_DEG,
    Row,
    read_rows,
)
from lab.evidence.update_results import RefusedError, replaced, table

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path("runs/compose_test")
WEIGHTS = Path("src/deeplight/weights/deeplight.onnx")
DOCUMENT = Path("docs/compose.md")
QUALITY = 85  # of the pictures
PICTURES = {  # file, width: a row of every case is for looking over, and costs a megabyte in full
    "figure.png": ("compose_evidence.jpg", 1800),
    "cases.png": ("compose_evidence_cases.jpg", 1080),
}
COLUMNS = (  # heading, error, material
    ("object, diffuse", "object", "diffuse"),
    ("object, silver", "object", "silver"),
    ("shadow", "shadow", "diffuse"),
    ("shadow, blurred", "blurred", "diffuse"),
)
BY_KIND = ("indoor / shade / sun",) * 2


class Evidence:
    """Rows of errors.csv, looked up by method."""

    def __init__(self, rows: Sequence[Row]) -> None:
        self.rows = rows
        every = dict.fromkeys(row.method for row in rows)
        self.names = [name for name in every if name not in (AGAIN, UNSHADOWED)]

    @property
    def model(self) -> str:
        return self.names[0]

    @property
    def baselines(self) -> list[str]:
        return self.names[1:]

    def of(self, method: str, material: str, kinds: Iterable[str] = KINDS) -> list[Row]:
        return [
            row
            for row in self.rows
            if (row.method, row.material) == (method, material) and row.kind in kinds
        ]

    def values(
        self, method: str, error: str, material: str, kinds: Iterable[str] = KINDS
    ) -> np.ndarray:
        return np.array([getattr(row, error) for row in self.of(method, material, kinds)], float)

    def mean(self, method: str, error: str, material: str, kind: str) -> float:
        values = self.values(method, error, material, (kind,))
        return float(values.mean()) if len(values) else float("nan")

    def interval(self, method: str, error: str, material: str) -> Interval:
        places = PlaceBootstrap(np.array([row.place for row in self.of(method, material)]))
        return places.mean(self.values(method, error, material))

    def less(self, other: str, error: str, material: str) -> Interval:
        """The model's error less the other's, case by case."""
        places = PlaceBootstrap(np.array([row.place for row in self.of(other, material)]))
        ours, theirs = (self.values(name, error, material) for name in (self.model, other))
        return places.difference(ours, theirs)


def main(folder: Path, root: Path = ROOT) -> list[Path]:
    """Rewrite the document and its pictures; raises RefusedError."""
    facts = tomllib.loads((folder / "run.toml").read_text(encoding="utf-8"))["run_facts"]
    shipped = sha256((root / WEIGHTS).read_bytes()).hexdigest()
    if facts["model"] != shipped:
        raise RefusedError(f"{folder} is of other weights than the shipped ones: run it again")
    document = root / DOCUMENT
    text = document.read_text(encoding="utf-8")
    block = {"compose": sentences(Evidence(read_rows(folder)))}
    text = replaced(text, block, DOCUMENT.name)
    with replacing(document) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return [document, *_pictures(folder, root)]


def sentences(found: Evidence) -> str:
    """Tables and what they say."""
    parts = [_counts(found), _errors(found), "Case by case, the model's error less the other's:\n"]
    parts += [_differences(found), _sentences(found), _sides(found), _side_sentences(found)]
    return "\n".join(parts)


def _counts(found: Evidence) -> str:
    rows = found.of(found.model, MATERIALS[0])
    kinds = [sum(row.kind == kind for row in rows) for kind in KINDS]
    places = len({row.place for row in rows})
    words = "{} indoors, {} in shade, {} in the sun".format(*kinds)
    return f"{len(rows)} photos in {places} places: {words}.\n"


def _errors(found: Evidence) -> str:
    head = ["light", COLUMNS[0][0], BY_KIND[0], COLUMNS[1][0], BY_KIND[1]]
    rows = []
    for name in (*found.names, AGAIN):
        cells = []
        for _, error, material in COLUMNS:
            cells.append(_interval(found.interval(name, error, material)))
            if error == "object":
                means = [found.mean(name, error, material, kind) for kind in KINDS]
                cells.append(" / ".join(f"{mean:.3f}" for mean in means))
        rows.append([f"({name})" if name == AGAIN else _words(name), *cells])
    return table([*head, COLUMNS[2][0], COLUMNS[3][0]], rows)


def _differences(found: Evidence) -> str:
    rows = []
    for name in found.baselines:
        cells = [_interval(found.less(name, error, m), "{:+.3f}") for _, error, m in COLUMNS]
        rows.append([_words(name), *cells])
    return table(["less", *(heading for heading, *_ in COLUMNS)], rows)


def _sentences(found: Evidence) -> str:
    lines = [_proof(found, *column) for column in COLUMNS]
    lines += [
        line for column in COLUMNS[:3] for kind in KINDS if (line := _beaten(found, *column, kind))
    ]
    lines.append(_darkness(found))
    return "\n".join(_item(line) for line in lines if line) + "\n"


def _proof(found: Evidence, heading: str, error: str, material: str) -> str:
    """Against which baselines the difference is certain, likely, or the other way."""
    groups: dict[str, list[str]] = {"certain": [], "likely": [], "worse": []}
    for name in found.baselines:
        less = found.less(name, error, material)
        group = "certain" if less.high < 0 else "likely" if less.value < 0 else "worse"
        groups[group].append(_words(name))
    parts = [
        (groups["certain"], "nearer to the truth than under {}, the whole interval below 0"),
        (groups["likely"], "nearer on average than under {}, but the interval reaches 0"),
        (groups["worse"], "not nearer than under {}"),
    ]
    return f"{heading}: " + "; ".join(text.format(_list(names)) for names, text in parts if names)


def _beaten(found: Evidence, heading: str, error: str, material: str, kind: str) -> str:
    """Which baselines are better in one kind of scene."""
    ours = found.mean(found.model, error, material, kind)
    means = {name: found.mean(name, error, material, kind) for name in found.baselines}
    better = [f"{_words(name)} ({mean:.3f})" for name, mean in means.items() if mean < ours]
    count = len(found.of(found.model, material, (kind,)))
    if not better or not count:
        return ""
    return (
        f"{heading}, {kind} ({count} photos): better than the model ({ours:.3f}): {_list(better)}"
    )


def _darkness(found: Evidence) -> str:
    """How dark the sun's shadows are."""
    material, sun = MATERIALS[0], ("sun",)
    if not found.of(found.model, material, sun):
        return ""

    def among(error: str, middle: Callable[[np.ndarray], np.floating]) -> str:
        ours, *others = (middle(found.values(name, error, material, sun)) for name in found.names)
        return f"{ours:.2f}, the others' {min(others):.2f} to {max(others):.2f}"

    nothing = found.mean(UNSHADOWED, "shadow", material, "sun")
    return (
        "in the sun the model's shadow has, as the median, this part of the true one's darkness: "
        f"{among('darkness', np.median)}; mean error of the factor {among('shadow', np.mean)}, "
        f"of no shadow at all {nothing:.2f}"
    )


def _sides(found: Evidence) -> str:
    near = f"dominant light within {NEAR_TRUTH_DEG} degrees"
    head = [near, "in the sun: pictures", "with a side", "median off", "farthest off"]
    head += ["wrong side", "everywhere: with a side", "wrong side"]
    lines = []
    for name in found.names:
        cells = [_words(name)]
        for kinds in (("sun",), KINDS):
            rows = _near(found, name, kinds)
            off = np.array([row.side_deg for row in rows if np.isfinite(row.side_deg)])
            wrong = str(int((off > WRONG_DEG).sum()))
            if kinds == KINDS:
                cells += [str(len(off)), wrong]
                continue
            middle, most = (f"{f(off):.0f}" if len(off) else "-" for f in (np.median, np.max))
            cells += [str(len(rows)), str(len(off)), middle, most, wrong]
        lines.append(cells)
    return table(head, lines)


def _side_sentences(found: Evidence) -> str:
    """The model's shadows that fall to the wrong side, and why."""
    wrong: dict[str, list[Row]] = {}
    for row in _near(found, found.model, KINDS):
        if row.side_deg > WRONG_DEG:
            wrong.setdefault(row.key, []).append(row)
    if not wrong:
        return "The model's shadows fall to the right side in every one.\n"
    lines = ["The model's on the wrong side:\n"]
    for key, rows in wrong.items():
        own = rows[0]
        true = next(row for row in found.rows if (row.key, row.method) == (key, AGAIN))
        lines.append(
            _item(
                f"{key} ({own.kind}; {_list([row.material for row in rows])}): the true light "
                f"stands {true.high_deg:.0f} degrees high and holds {true.power:.0%} of the power, "
                f"the model's {own.high_deg:.0f} degrees and {own.power:.0%}"
            )
        )
    return "\n".join(lines) + "\n"


def _near(found: Evidence, method: str, kinds: Iterable[str]) -> list[Row]:
    rows = [row for material in MATERIALS for row in found.of(method, material, kinds)]
    return [row for row in rows if row.light_deg < NEAR_TRUTH_DEG]


def _pictures(folder: Path, root: Path) -> list[Path]:
    made = []
    for name, (target, width) in PICTURES.items():
        picture = Image.open(folder / name).convert("RGB")
        if picture.width > width:
            size = (width, round(picture.height * width / picture.width))
            picture = picture.resize(size, Image.Resampling.LANCZOS)
        path = root / "docs" / "pictures" / target
        with replacing(path) as temporary:
            temporary.write_bytes(encode_jpeg(np.asarray(picture), QUALITY))
        made.append(path)
    return made


def _words(name: str) -> str:
    return name.replace("_", " ")


def _list(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _item(text: str) -> str:
    return textwrap.fill(f"- {text}.", 118, subsequent_indent="  ", break_on_hyphens=False)


def _interval(value: Interval, form: str = "{:.3f}") -> str:
    return f"{form} ({form} to {form})".format(value.value, value.low, value.high)


if __name__ == "__main__":
    try:
        done = main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
    except (RefusedError, OSError, KeyError, ValueError) as error:
        sys.exit(f"update_compose: {error}")
    print("\n".join(f"wrote {path.relative_to(ROOT)}" for path in done))
