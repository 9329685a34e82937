"""The tables of docs/results.md, from what `deeplight evaluate --out` wrote.

python benchmarks/results_table.py FOLDER...     one folder per split
"""

import json
import sys
from pathlib import Path
from typing import Any

METRICS = {
    "l1_diffuse": "{:.3f}",
    "l1_matte_silver": "{:.3f}",
    "l1_mirror": "{:.3f}",
    "theta_rgb_deg": "{:.1f}",
    "radiance_absolute": "{:.2f}",
}
SCENES = ("indoor", "outdoor", "both")
SPHERES = ("l1_diffuse", "l1_matte_silver", "l1_mirror")


def with_interval(form: str, value: dict[str, float]) -> str:
    """A mean and its 95 % interval."""
    low, high = form.format(value["low"]), form.format(value["high"])
    return f"{form.format(value['value'])} ({low}-{high})"


def tables(folder: Path) -> str:
    """Metrics of every estimator by scene, and the model's L1 over that of constant lighting."""
    results = json.loads((folder / "results.json").read_text())
    cells: dict[tuple[str, str, str], dict[str, Any]] = {
        (row["estimator"], row["scene"], row["metric"]): row for row in results["summary"]
    }
    names = list(dict.fromkeys(name for name, _, _ in cells))
    lines = [f"### {results['split']}: {results['examples']} examples", ""]
    lines += ["| | scene | L1 diffuse | L1 silver | L1 mirror | angle of colour, deg | radiance |"]
    lines += ["|---|---|---|---|---|---|---|"]
    for name in names:
        for scene in SCENES:
            values = [with_interval(f, cells[name, scene, m]["mean"]) for m, f in METRICS.items()]
            lines.append(f"| {name} | {scene} | {' | '.join(values)} |")
    lines += ["", f"| {names[0]} over | scene | diffuse | silver | mirror |"]
    lines += ["|---|---|---|---|---|"]
    for reference in cells[names[0], "both", SPHERES[0]]["ratio"]:
        for scene in SCENES:
            ratios = [cells[names[0], scene, m]["ratio"][reference] for m in SPHERES]
            values = [with_interval("{:.2f}", ratio) for ratio in ratios]
            lines.append(f"| {reference} | {scene} | {' | '.join(values)} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        sys.stdout.write(tables(Path(argument)) + "\n")
