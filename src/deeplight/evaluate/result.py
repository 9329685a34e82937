"""Everything an evaluation says of one split."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from deeplight.dataset import DataSet
from deeplight.evaluate.protocols.stylelight_2022 import FORMS, three_spheres
from deeplight.evaluate.run import AnyEstimator, KeyedEstimator, evaluate
from deeplight.evaluate.scores import Column, Report
from deeplight.evaluate.summary import CalibrationBin, Summary, calibration, summarise
from deeplight.evaluate.temporal import Changes, Flicker, changes, flicker


@dataclass(frozen=True, eq=False)
class SplitResult:
    """One split: the report and what follows from it.

    Attributes:
        methods: the estimators that are measured, as against the baselines next to them; the first
            ranks the examples of figures.
        protocols: by form, estimator and metric; empty unless asked for.
    """

    report: Report
    methods: tuple[str, ...]
    summaries: list[Summary]
    changes: Changes
    flicker: list[Flicker]
    calibration: list[CalibrationBin]
    protocols: dict[str, dict[str, dict[str, Column]]] = field(default_factory=dict)

    def find(self, estimator: str, scene: str, metric: str) -> Summary | None:
        """The summary of that name, if there is one."""
        wanted = (estimator, scene, metric)
        return next((s for s in self.summaries if (s.estimator, s.scene, s.metric) == wanted), None)

    @property
    def knows_light(self) -> bool:
        """Whether the true light is known, so that it can be compared with."""
        return any(s.metric == "energy_stops" for s in self.summaries)


def measured(
    methods: Sequence[AnyEstimator],
    baselines: Sequence[AnyEstimator],
    data: DataSet,
    split: str,
    at_most: int | None = None,
    protocols: bool = False,
    progress: Callable[[int], None] = lambda examples: None,
    truth: KeyedEstimator | None = None,
) -> SplitResult:
    """Measure methods and the baselines next to them on a split; raises what `evaluate` does.

    Args:
        protocols: compute other papers' metrics too, which takes as long again.
        truth: as `evaluate` takes it.
    """
    report = evaluate([*methods, *baselines], data, split, at_most, progress, truth)
    names = tuple(method.name for method in methods)
    changed = changes(report)
    return SplitResult(
        report,
        names,
        summarise(report, names),
        changed,
        flicker(changed, report.places),
        calibration(report),
        {form.name: three_spheres(report, form) for form in FORMS} if protocols else {},
    )
