"""From people's answers to a ranking of the methods: numbers, a figure and a report."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from deeplight.errors import DataSetError
from deeplight.io.atomic import replacing
from deeplight.io.photos import write_png
from deeplight.report.page import Figure, Heading, Page, Paragraph, Table
from deeplight.study.answers import Key, Person, checked, exclusions
from deeplight.study.bradley_terry import RESAMPLES, SEED, Comparisons, chances, fit
from deeplight.study.figure import strengths_figure

HOW_TO_READ = (
    "A strength is in log odds, with mean 0 over the methods: a method is chosen over one that "
    "lies d below it in 1 / (1 + exp(-d)) of pairs (Bradley and Terry 1952). Brackets hold 95 % "
    "intervals over people and scenes drawn anew, 2,000 times: a difference whose interval leaves "
    "out 50 % is one that other people and other scenes would show too."
)


@dataclass(frozen=True)
class RankInterval:
    """A number and its 95 % interval; NaN where there is nothing to resample."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Ranked:
    """One method.

    Attributes:
        strength: log odds, mean 0 over the methods.
        chosen: share of its pairs in which it was chosen.
        pairs: how many these are.
    """

    method: str
    strength: RankInterval
    chosen: float
    pairs: int


@dataclass(frozen=True)
class Contest:
    """Two methods: how often the first was chosen, as counted and as the model says."""

    first: str
    second: str
    pairs: int
    counted: float
    modelled: RankInterval


@dataclass(frozen=True)
class Findings:
    """Everything that the answers say.

    Attributes:
        ranking: the methods, strongest first.
        contests: every two methods, in the order of the ranking.
        people, scenes: that count.
        excluded: people who are left out, and why.
        left: share of pairs in which the first picture was chosen; 0.5 without a habit.
        identical: the same over pairs of twice the same picture.
        median_ms: of a pair.
    """

    question: str
    ranking: list[Ranked]
    contests: list[Contest]
    people: int
    scenes: int
    answers: int
    excluded: list[tuple[str, str]]
    left: RankInterval
    identical: RankInterval
    median_ms: float


def analyse(people: Sequence[Person], key: Key, resamples: int = RESAMPLES) -> Findings:
    """Rank the methods by everybody who looked.

    Raises:
        DataSetError: nobody is left, or a method was never compared.
    """
    everybody = [checked(person) for person in people]
    kept = [person for person in everybody if not person.excluded]
    pairs = [(i, a) for i, person in enumerate(kept) for a in person.answers if a.kind == "pair"]
    if not pairs:
        got = f"none of {len(everybody)} people; {everybody[0].excluded or 'they have none'}"
        raise DataSetError("answers of people who looked", got, "collect more answers")
    codes, scenes = sorted(key.conditions), sorted(key.scenes)
    compared = Comparisons(
        np.array([codes.index(a.winner) for _, a in pairs]),
        np.array([codes.index(a.loser) for _, a in pairs]),
        np.array([person for person, _ in pairs]),
        np.array([scenes.index(a.scene) for _, a in pairs]),
        len(codes),
    )
    names = [key.conditions[code] for code in codes]
    ranking, contests = _ranked(compared, names, resamples)
    return Findings(
        key.question,
        ranking,
        contests,
        len(kept),
        len(set(compared.scenes.tolist())),
        len(pairs),
        exclusions(everybody),
        _share([[a.chosen == "left" for a in p.answers if a.kind == "pair"] for p in kept]),
        _share([[a.chosen == "left" for a in p.answers if a.kind == "identical"] for p in kept]),
        float(np.median([a.ms for _, a in pairs])),
    )


def _ranked(
    compared: Comparisons, names: Sequence[str], resamples: int
) -> tuple[list[Ranked], list[Contest]]:
    wins = compared.wins()
    games = wins + wins.T
    never = [name for name, total in zip(names, games.sum(1), strict=True) if not total]
    if never:
        do = "collect more answers"
        raise DataSetError("every method compared at least once", f"{never[0]} never", do)
    strength, drawn = fit(wins), fit(compared.drawn_wins(resamples))
    order = np.argsort(-strength, kind="stable")
    ranking = [
        Ranked(
            names[i],
            _estimate(strength[i], drawn[:, i]),
            float(wins[i].sum() / games[i].sum()),
            int(games[i].sum()),
        )
        for i in order
    ]
    modelled, spread = chances(strength), chances(drawn)
    contests = [
        Contest(
            names[i],
            names[j],
            int(games[i, j]),
            float(wins[i, j] / games[i, j]) if games[i, j] else float("nan"),
            _estimate(modelled[i, j], spread[:, i, j]),
        )
        for at, i in enumerate(order)
        for j in order[at + 1 :]
    ]
    return ranking, contests


def _estimate(value: float, drawn: Float64[np.ndarray, " draws"]) -> RankInterval:
    if np.ptp(drawn) == 0:  # one person and one scene
        return RankInterval(float(value), float("nan"), float("nan"))
    low, high = np.percentile(drawn, (2.5, 97.5))
    return RankInterval(float(value), float(low), float(high))


def _share(by_person: Sequence[Sequence[bool]]) -> RankInterval:
    """The share of True, with an interval over people."""
    counts = np.array([(sum(values), len(values)) for values in by_person], float)
    if not counts[:, 1].sum():
        return RankInterval(float("nan"), float("nan"), float("nan"))
    people = len(counts)
    times = np.random.default_rng(SEED).multinomial(people, np.full(people, 1 / people), RESAMPLES)
    drawn = times @ counts
    drawn = drawn[drawn[:, 1] > 0]
    value = counts[:, 0].sum() / counts[:, 1].sum()
    return _estimate(float(value), drawn[:, 0] / drawn[:, 1])


def write_findings(findings: Findings, out: Path) -> None:
    """Write report.html, results.json and strengths.png to `out`.

    Raises:
        MissingExtraError: the report's template engine is not installed.
        OSError: the folder cannot be written.
    """
    figure = strengths_figure(
        [(r.method, r.strength.value, r.strength.low, r.strength.high) for r in findings.ranking]
    )
    page = _page(findings, figure)
    page.html()  # a missing template engine is reported before anything is written
    with replacing(out / "results.json") as temporary:
        values = _without_nan(asdict(findings))
        temporary.write_text(json.dumps(values, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    write_png(out / "strengths.png", figure)
    page.write(out / "report.html")


def summary_lines(findings: Findings) -> list[str]:
    """The ranking in plain lines."""
    lines = [_asked(findings)]
    width = max(len(r.method) for r in findings.ranking)
    for r in findings.ranking:
        share = f"chosen in {_percent(r.chosen)} of {r.pairs}"
        lines.append(f"  {r.method:<{width}}  {_log_odds(r.strength)}  {share}")
    lines += [f"  left out: {person}, {why}" for person, why in findings.excluded]
    return lines


def _asked(findings: Findings) -> str:
    asked = "Which looks more real" if findings.question == "real" else "Closer to the reference"
    return (
        f"{asked}: {findings.answers} pairs by {findings.people} people in {findings.scenes} "
        f"scenes; {len(findings.excluded)} people left out."
    )


def _page(findings: Findings, figure: np.ndarray) -> Page:
    page = Page("A perceptual study", _asked(findings))
    page.add(Heading("Ranking"), Paragraph(HOW_TO_READ, "note"))
    alt = "Strength of each method with its interval"
    page.add(Figure(figure, width_px=figure.shape[1] // 2, alt=alt, exact=True))
    rows = [
        (r.method, _log_odds(r.strength), _percent(r.chosen), r.pairs) for r in findings.ranking
    ]
    page.add(Table(["", "strength", "chosen", "pairs"], rows))
    page.add(Heading("Every two methods"))
    contests = [
        (f"{c.first} over {c.second}", _percent(c.counted), _shares(c.modelled), c.pairs)
        for c in findings.contests
    ]
    page.add(Table(["", "counted", "by the model", "pairs"], contests))
    page.add(Heading("How people answered"))
    automatics = [
        ("first picture chosen", _shares(findings.left)),
        ("the same, of twice the same picture", _shares(findings.identical)),
        ("median time of a pair", f"{findings.median_ms / 1000:.1f} s"),
    ]
    page.add(Table(["", ""], automatics))
    if findings.excluded:
        page.add(Table(["left out", "why"], findings.excluded))
    return page


def _log_odds(found: RankInterval) -> str:
    if np.isnan(found.low):
        return f"{found.value:+.2f} (one person, one scene)"
    return f"{found.value:+.2f} ({found.low:+.2f} to {found.high:+.2f})"


def _percent(share: float) -> str:
    return "–" if np.isnan(share) else f"{100 * share:.0f} %"


def _shares(found: RankInterval) -> str:
    if np.isnan(found.low):
        return _percent(found.value)
    return f"{_percent(found.value)} ({100 * found.low:.0f} to {100 * found.high:.0f} %)"


def _without_nan(value: object) -> object:
    if isinstance(value, dict):
        return {name: _without_nan(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and np.isnan(value) else value
