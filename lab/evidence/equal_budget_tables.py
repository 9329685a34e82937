"""Put the rows of table 1 and the learning curve into docs/journal.md.

    python -m lab.evidence.equal_budget_tables out/equal

The folder is what `deeplight evaluate` wrote of the runs of `equal_budget.py`.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from lab.evidence.update_results import (
    LIGHT_FORMS,
    ROOT,
    RefusedError,
    Results,
    cell,
    load,
    replaced,
    table,
)

SPLIT = "val"
ROWS = {
    "adv": "mirror, silver, diffuse and the adversarial term (the paper's numbers)",
    "adv_strong": "the same, D as fast as G, the term's weight 0.02, non-saturating",
    "msd": "mirror, silver, diffuse",
    "m": "mirror only",
    "s": "matte silver only",
    "d": "diffuse only",
}
CURVE = {"places21": "21", "places42": "42", "msd": "85 (all)"}
DATA = {
    "msd": "as it is",
    "colours": "colour channels never shuffled",
    "more": "and varied copies of its places",
    "made": "and made-up rooms and open ground",
}
HEAD = ("diffuse", "silver", "mirror", "angle of colour, °", "mirror detail", "direction, °")
COLUMNS = (
    ("l1_diffuse", "{:.3f}", "mean"),
    ("l1_matte_silver", "{:.3f}", "mean"),
    ("l1_mirror", "{:.3f}", "mean"),
    ("theta_rgb_deg", "{:.1f}", "mean"),
    ("mirror_detail", LIGHT_FORMS["mirror_detail"], "median"),
    ("direction_deg", LIGHT_FORMS["direction_deg"], "median"),
)


def rows(results: Results, names: dict[str, str], first: str) -> str:
    """One table; runs that were not evaluated are left out."""
    shown = [
        [words, *(cell(results, (SPLIT, name, "both", m), form, kind) for m, form, kind in COLUMNS)]
        for name, words in names.items()
        if name in results.estimators(SPLIT)
    ]
    return table([first, *HEAD], shown)


def update(folders: Sequence[Path]) -> None:
    """Rewrite the blocks of docs/journal.md."""
    results, path = load(folders), ROOT / "docs" / "journal.md"
    blocks = {
        "table 1": rows(results, ROWS, "what teaches"),
        "learning curve": rows(results, CURVE, "training places"),
        "training data": rows(results, DATA, "training data"),
    }
    text = replaced(path.read_text(encoding="utf-8"), blocks, path.name)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    try:
        update([Path(argument) for argument in sys.argv[1:]])
    except (RefusedError, OSError, KeyError, ValueError) as error:
        sys.exit(f"equal_budget_tables: {error}")
