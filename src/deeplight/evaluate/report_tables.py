"""The tables of the HTML report, and the sentences that say what stands in them."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from deeplight.evaluate import paper_numbers
from deeplight.evaluate.protocols.stylelight_2022 import summed_up
from deeplight.evaluate.result import SplitResult
from deeplight.evaluate.scores import TRUE_LIGHTING
from deeplight.evaluate.summary import SCENES, Interval, Summary
from deeplight.report.chart import Chart, Curve
from deeplight.report.page import Block, Paragraph, Table
from deeplight.sphere import SPHERES

MEASURES = {
    "l1_diffuse": "L1(d)",
    "l1_matte_silver": "L1(s)",
    "l1_mirror": "L1(m)",
    "theta_rgb_deg": "θ°",
}
LIGHT = {
    "energy_stops": "energy, stops (mean)",
    "energy_stops_absolute": "|energy|, stops",
    "true_radiance_absolute": "|radiance|, diffuse",
    "direction_deg": "direction, °",
    "intensity_stops": "light, stops (mean)",
    "intensity_stops_absolute": "|light|, stops",
    "linear_diffuse": "linear d",
    "linear_matte_silver": "linear s",
    "linear_mirror": "linear m",
    "mirror_detail": "detail m",
}
_FIRST_LIGHT = 6  # columns of the first of the two tables
HOW_TO_READ = (
    "Lower is better. L1 is the mean absolute difference of pixel values, 0 to 1, between a "
    "filmed sphere and one rendered in the estimated light, over the pixels that show nothing but"
    " sphere; θ is the angle between linear colours of the diffuse sphere. Brackets hold 95 % "
    "intervals from resampling places, not frames. 'undef.' counts examples where a number does "
    "not exist: they are in no mean. true_lighting is the very light that was filmed: what is "
    "left there is the camera's."
)
RADIANCE = (
    "Sum over the linear diffuse sphere against the filmed one; boxes hold the middle half, "
    "whiskers end within 1.5 box lengths, and those that reach +3 go on. Where the filmed sphere "
    "is clipped the truth is brighter than its pixels, so even the true light lies above 0: where "
    "the true light is known, the second plot compares with the sphere rendered in it."
)
FLICKER = (
    "Change between neighbouring frames of a take after turning the light by the camera's known "
    "rotation: mean over directions of |log2 L' - log2 L|, in stops. The error column compares "
    "the change with that of the true light, which follows the camera's exposure: 0 follows it "
    "exactly."
)
LIGHT_MEANING = (
    "Energy is the power from all directions, light the irradiance of the one dominant light, both "
    "as log2(estimated / true); direction is the angle between the dominant lights. Medians but "
    "where the head says mean. |radiance| is the relative error of the diffuse sphere's sum "
    "against that in true light, mean over channels. Linear errors are of the spheres before the "
    "camera clips them, sum |difference| over sum: the mirror's is nearly the sun's one pixel, so "
    "it is not to be read alone. Detail is how sharp the rendered mirror sphere is, 1 as sharp as "
    "the filmed one: higher is sharper, right or wrong."
)
PROTOCOL = (
    "As published, panoramas are tone-mapped (x^(1/2.4), median to 0.5) before rendering and "
    "squares are summed over channels; corrected, light stays linear and all are means. Neither "
    "is comparable with the numbers above."
)


def sphere_tables(result: SplitResult) -> Iterator[Block]:
    """Table 1 and 2 of the paper, ratios and paired differences."""
    yield _table_1(result)
    yield Paragraph(paper_numbers.CAVEAT)
    yield from (_table_2(result, scene) for scene in SCENES if _has(result, scene))
    yield from (_ratios(result, name) for name in result.methods if _references(result, name))
    yield from (_differences(result, name) for name in result.methods)


def light_tables(result: SplitResult) -> Iterator[Block]:
    """Errors against the true light, and calibration by brightness."""
    yield Paragraph(LIGHT_MEANING)
    for metrics in (list(LIGHT)[:_FIRST_LIGHT], list(LIGHT)[_FIRST_LIGHT:]):
        rows = [
            [name, *(_light_cell(result.find(name, "both", metric), metric) for metric in metrics)]
            for name in result.report.scores
        ]
        yield Table(["", *(LIGHT[metric] for metric in metrics)], rows)
    shown = [
        *result.methods,
        *(n for n in ("training_mean", "nearest_neighbour") if _named(result, n)),
    ]
    yield _calibration_chart(result, shown[:5])


def flicker_table(result: SplitResult) -> Table | None:
    if not result.flicker:
        return None
    rows = [
        [f.estimator, interval(f.change, 2), interval(f.error, 2), str(f.pairs)]
        for f in result.flicker
    ]
    true = result.flicker[0].true_change
    caption = f"The true light changes by {interval(true, 2)} stops, measured in the same way."
    return Table(["", "change, stops", "error of the change, stops", "pairs"], rows, caption)


def protocol_tables(result: SplitResult) -> Iterator[Block]:
    yield Paragraph(PROTOCOL)
    for form, found in result.protocols.items():
        cells = {
            (name, metric): _number(mean, 3) + _undefined(none)
            for name, metric, mean, none in summed_up(found)
        }
        for kind in ("angular_deg", "si_rmse", "normalised_rmse", "rmse"):
            rows = [
                [name, *(cells[name, f"{kind}_{sphere}"] for sphere in SPHERES)] for name in found
            ]
            head = [kind.replace("_", " "), *(sphere.replace("_", " ") for sphere in SPHERES)]
            yield Table(head, rows, form.replace("_", " "))


def made_of(facts: Mapping[str, Any]) -> Iterator[Block]:
    """The models and the data, by their hashes."""
    rows = [
        [name, about["file"], about["trained_on"] or "not stated", about["sha256"][:16]]
        for name, about in facts["models"].items()
    ]
    if rows:
        yield Table(["model", "file", "trained on", "sha256"], rows)
    yield Paragraph(
        f"Data set manifest {facts['data_manifest_sha256'][:16]}; "
        f"reflectance bases {facts['reflectance_bases'][:16]}; "
        f"{facts['bootstrap_resamples']} resamples of places, seed {facts['bootstrap_seed']}. "
        "run.toml next to this file has versions and settings."
    )


def _table_1(result: SplitResult) -> Table:
    scenes = [scene for scene in SCENES if _has(result, scene)]
    short = {"indoor": "in", "outdoor": "out", "both": "both"}
    head = ["", *(f"{text} {short[scene]}" for text in MEASURES.values() for scene in scenes)]
    rows: list[Sequence[str]] = [
        [name, *(_value(result.find(name, scene, m), m) for m in MEASURES for scene in scenes)]
        for name in result.report.scores
    ]
    for row in paper_numbers.TABLE_1:
        values = {"indoor": 0, "outdoor": 1}
        cells = [
            f"{getattr(row, m)[values[scene]]:.{1 if m.startswith('theta') else 2}f}"
            if scene in values
            else ""
            for m in MEASURES
            for scene in scenes
        ]
        rows.append([f"paper: {row.name}", *cells])
    return Table(head, rows, f"Table 1 of the paper, on {result.report.split}: means.")


def _table_2(result: SplitResult, scene: str) -> Table:
    metrics = [*MEASURES, "radiance_absolute"]
    head = ["", *MEASURES.values(), "radiance error"]
    if result.knows_light:
        metrics.append("true_radiance_absolute")
        head.append("against true light")
    rows = [
        [name, *(_spread(result.find(name, scene, m), m) for m in metrics)]
        for name in result.report.scores
    ]
    return Table(head, rows, f"{scene}: mean ± standard deviation over examples (95 % interval).")


def _ratios(result: SplitResult, name: str) -> Table:
    rows = []
    for reference in _references(result, name):
        for scene in SCENES:
            found = [result.find(name, scene, metric) for metric in MEASURES]
            cells = [interval(s.ratio[reference], 2) if s else "" for s in found]
            if any(cells):
                rows.append([reference, scene, *cells])
    caption = f"Means of {name} over those of constant lighting: under 1 is better than it."
    return Table([f"{name} over", "", *MEASURES.values()], rows, caption)


def _differences(result: SplitResult, name: str) -> Table:
    found = {m: result.find(name, "both", m) for m in MEASURES}
    first = next(s for s in found.values() if s)
    rows = [
        [other, *(interval(s.difference[other], _digits(m)) if s else "" for m, s in found.items())]
        for other in first.difference
    ]
    caption = (
        f"{name} less each other estimator on the same examples, resampled by place: an interval "
        "below 0 is a gain that other places would show too."
    )
    return Table([f"{name} -", *MEASURES.values()], rows, caption)


def _calibration_chart(result: SplitResult, names: Sequence[str]) -> Chart:
    curves = []
    for tone, name in enumerate(names):
        bins = [c for c in result.calibration if c.estimator == name]
        x = [(math.log2(max(c.low, 1e-9)) + math.log2(max(c.high, 1e-9))) / 2 for c in bins]
        curves.append(Curve(name, x, [c.energy_stops.value for c in bins], tone))
    return Chart(
        "Calibration: mean energy error by true brightness, in bins of equally many examples",
        curves,
        x_name="true mean radiance, log2 of camera white",
        y_name="error, stops",
        level=0.0,
    )


def interval(found: Interval, digits: int) -> str:
    """A number and its interval; a dash where there is none."""
    if not math.isfinite(found.value):
        return "–"
    return f"{_number(found.value, digits)} {_span(found, digits)}"


def _span(found: Interval, digits: int) -> str:
    """The interval, which a line break must not tear apart."""
    if found.of_one_place:
        return "(one\N{NO-BREAK SPACE}place)"
    low, high = _number(found.low, digits), _number(found.high, digits)
    return f"({low} to {high})".replace(" ", "\N{NO-BREAK SPACE}")


def _value(summary: Summary | None, metric: str) -> str:
    if summary is None:
        return ""
    return _number(summary.mean.value, _digits(metric)) + _undefined(summary.undefined)


def _spread(summary: Summary | None, metric: str) -> str:
    if summary is None or not summary.examples:
        return "–"
    digits = _digits(metric)
    text = f"{_number(summary.mean.value, digits)} ± {summary.sd:.{digits}f}"
    text = text.replace(" ", "\N{NO-BREAK SPACE}")
    return f"{text} {_span(summary.mean, digits)}{_undefined(summary.undefined)}"


def _light_cell(summary: Summary | None, metric: str) -> str:
    if summary is None:
        return ""
    found = summary.mean if metric.endswith("_stops") else summary.median
    return interval(found, 0 if metric == "direction_deg" else 2) + _undefined(summary.undefined)


def _undefined(count: int) -> str:
    return f", {count} undef." if count else ""


def _number(value: float, digits: int) -> str:
    if not math.isfinite(value):
        return "–"
    rounded = round(value, digits) + 0.0  # and no -0.00
    return f"{rounded:.{digits}f}".replace("-", "\N{MINUS SIGN}")


def _digits(metric: str) -> int:
    return {"theta_rgb_deg": 1, "radiance_absolute": 2, "true_radiance_absolute": 2}.get(metric, 3)


def _has(result: SplitResult, scene: str) -> bool:
    return any(s.scene == scene for s in result.summaries)


def _references(result: SplitResult, name: str) -> list[str]:
    summary = result.find(name, "both", "l1_diffuse")
    return list(summary.ratio) if summary else []


def _named(result: SplitResult, name: str) -> bool:
    return name in result.report.scores and name != TRUE_LIGHTING
