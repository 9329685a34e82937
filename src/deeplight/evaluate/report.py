"""An evaluation as one HTML page: tables, figures, and what each number means."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from deeplight.dataset import DataSet
from deeplight.dataset.contact_sheet import Picture
from deeplight.evaluate import report_tables as tables
from deeplight.evaluate.figures.box_plots import radiance_figure
from deeplight.evaluate.figures.comparison import comparison_figure
from deeplight.evaluate.figures.percentiles import percentile_figure, worst_figures
from deeplight.evaluate.figures.temporal import temporal_figure
from deeplight.evaluate.result import SplitResult
from deeplight.evaluate.scores import TRUE_LIGHTING
from deeplight.report.page import Block, Figure, Heading, Page, PageRow, Paragraph, Table

MOST_COLUMNS = 10  # of spheres that fit next to each other
SCENES = ("indoor", "outdoor")


@dataclass(frozen=True, eq=False)
class Pictures:
    """The figures of one split.

    Attributes:
        radiance: box plots by kind of scene, and by `<scene>_true` against the true light.
        worst: what each shows, and the picture.
    """

    percentiles: Picture
    comparison: Picture
    temporal: Picture | None
    radiance: Mapping[str, Picture]
    worst: Sequence[tuple[str, Picture]]

    def by_name(self) -> dict[str, Picture]:
        """Those that are worth a file of their own."""
        found = {"percentiles": self.percentiles, "comparison": self.comparison}
        if self.temporal is not None:
            found["temporal"] = self.temporal
        return found | {f"radiance_{scene}": picture for scene, picture in self.radiance.items()}


def drawn(result: SplitResult, data: DataSet) -> Pictures:
    """Draw all figures of a split."""
    report, first = result.report, result.methods[0]
    everyone = [name for name in report.scores if name != TRUE_LIGHTING]
    few = [*result.methods[:3], *(n for n in ("training_mean",) if n in report.scores)]
    worst = [
        (_caption(result, position), picture)
        for position, picture in worst_figures(report, data, few, first)
    ]
    return Pictures(
        percentile_figure(report, data, few, first),
        comparison_figure(report, data, everyone[:MOST_COLUMNS], first),
        temporal_figure(report, data, result.changes, few, first),
        _radiance_figures(result),
        worst,
    )


def _radiance_figures(result: SplitResult) -> dict[str, Picture]:
    report = result.report
    names, found = list(report.scores)[:MOST_COLUMNS], {}
    for scene in SCENES:
        if report.inside(scene).any():
            found[scene] = radiance_figure(report, names, scene)
            if result.knows_light:
                found[f"{scene}_true"] = radiance_figure(report, names, scene, "true")
    return found


def report_page(
    results: Sequence[SplitResult], pictures: Sequence[Pictures], facts: Mapping[str, Any]
) -> Page:
    """Compose the page.

    Args:
        facts: what is reported of models and data.
    """
    page = Page("DeepLight: evaluation", _summary(results))
    page.add(Paragraph(tables.HOW_TO_READ, "note"))
    for result, shown in zip(results, pictures, strict=True):
        page.add(*_split(result, shown))
    page.add(Heading("How it was made"), *tables.made_of(facts))
    return page


def _summary(results: Sequence[SplitResult]) -> str:
    places = [len(set(result.report.places)) for result in results]
    parts = [
        f"{r.report.split}: {len(r.report.keys)} examples in {count} place{'s' * (count != 1)}"
        for r, count in zip(results, places, strict=True)
    ]
    return f"{', '.join(results[0].methods)} next to trivial baselines. " + "; ".join(parts) + "."


def _split(result: SplitResult, shown: Pictures) -> Iterator[Block]:
    split = result.report.split
    yield Heading(f"{split}: rendered spheres", split)
    yield from tables.sphere_tables(result)
    yield Heading(f"{split}: how bright")
    for scene, picture in shown.radiance.items():
        named = scene.replace("_true", ", against the true light")
        alt = f"Box plots of the relative radiance error by estimator and channel, {named}"
        yield Figure(picture, width_px=picture.shape[1] // 2, alt=alt, exact=True)
    yield Paragraph(tables.RADIANCE)
    if result.knows_light:
        yield Heading(f"{split}: against the true light")
        yield from tables.light_tables(result)
    yield Heading(f"{split}: from frame to frame")
    yield from _temporal(result, shown)
    yield Heading(f"{split}: typical, better and worse photos")
    yield Figure(
        shown.percentiles, "25th, 50th and 75th percentile of L_rec, indoor above outdoor."
    )
    yield Heading(f"{split}: the same photos under every estimator")
    yield Figure(shown.comparison, "Diffuse, matte silver and mirror from top to bottom.")
    yield Heading(f"{split}: the worst places")
    yield PageRow(
        [Figure(picture, caption) for caption, picture in shown.worst],
        "The worst photo of each of the worst places, with its L1 of diffuse / silver / mirror.",
    )
    if result.protocols:
        yield Heading(f"{split}: three-sphere protocol of StyleLight and DiffusionLight")
        yield from tables.protocol_tables(result)


def _temporal(result: SplitResult, shown: Pictures) -> Iterator[Block]:
    table: Table | None = tables.flicker_table(result)
    if table is None:
        yield Paragraph("No two neighbouring frames of a take with known camera poses.")
        return
    yield Paragraph(tables.FLICKER)
    yield table
    if shown.temporal is not None:
        yield Figure(shown.temporal, "Neighbouring frames of one take and their spheres, in order.")


def _caption(result: SplitResult, position: int) -> str:
    report = result.report
    scores = report.scores[result.methods[0]]
    l1 = " / ".join(f"{scores.l1[s][position]:.2f}" for s in ("diffuse", "matte_silver", "mirror"))
    return f"{report.places[position]}, {report.scenes[position]}: {l1}"
