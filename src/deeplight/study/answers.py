"""Read people's answers, and leave out those of people who did not look."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deeplight.errors import DataSetError
from deeplight.io.boundary import reads_as
from deeplight.io.json_text import parse_json
from deeplight.study.design import KEY, VERSION

LEAST_CAUGHT = 0.8
"""Share of the catch trials that must be right; of six, five. Who presses at random gets five or
six of six right in 11 % of cases."""
LEAST_MEDIAN_MS = 500
"""Nobody compares two pictures faster than that."""
MOST_ONE_SIDED = 0.95
"""Share of pairs answered with one side from which on it is a habit; needs 20 answers."""
MAX_BYTES = 10_000_000


@dataclass(frozen=True)
class Answer:
    """One pair and what was chosen, in codes of the key; `ruined` is the other side of a catch."""

    kind: str
    scene: str
    left: str
    right: str
    chosen: str
    ms: float

    @property
    def winner(self) -> str:
        return self.left if self.chosen == "left" else self.right

    @property
    def loser(self) -> str:
        return self.right if self.chosen == "left" else self.left


@dataclass(frozen=True)
class Person:
    """One person's answers.

    Attributes:
        name: the random number that the page made.
        excluded: why the answers are not counted; empty if they are.
    """

    name: str
    answers: tuple[Answer, ...]
    excluded: str = ""


@dataclass(frozen=True)
class Key:
    """What the codes of a study stand for."""

    study: str
    question: str
    conditions: Mapping[str, str]
    scenes: Mapping[str, str]

    @classmethod
    def load(cls, folder: Path) -> "Key":
        """Read the key of the study in `folder`, or a key file itself.

        Raises:
            DataSetError: there is none, or it is damaged.
        """
        path = folder / KEY if folder.is_dir() else folder
        values = _json(path)
        try:
            if values["format"] != "deeplight-study-key" or values["version"] != VERSION:
                raise KeyError("format")
            tables = dict(values["conditions"]), dict(values["scenes"])
            return cls(str(values["study"]), str(values["question"]), *tables)
        except (KeyError, TypeError, ValueError) as error:
            do = "give the folder that `deeplight study make` wrote"
            raise DataSetError(f"the key of a study in {path}", f"{error!r}", do) from None


def read_people(paths: Iterable[Path], key: Key) -> list[Person]:
    """Read answer files, or folders of them; one file per person counts once.

    Raises:
        DataSetError: no answers, an unreadable file, or one of another study.
    """
    people: dict[str, Person] = {}
    for path in _files(paths):
        person = _person(path, key)
        known = people.get(person.name)
        if known is None or len(known.answers) < len(person.answers):
            people[person.name] = person  # a file saved twice, or again after going on
    if not people:
        do = "give the folder with the people's answer files"
        raise DataSetError("answers (.json)", "none", do)
    return [people[name] for name in sorted(people)]


def checked(person: Person) -> Person:
    """The person with the reason for which the answers are left out, if there is one.

    The rules do not look at what was preferred: `LEAST_CAUGHT`, `LEAST_MEDIAN_MS` and
    `MOST_ONE_SIDED`.
    """
    catches = [a.loser == "ruined" for a in person.answers if a.kind == "catch"]
    sides = [a.chosen == "left" for a in person.answers]
    reason = ""
    if catches and np.mean(catches) < LEAST_CAUGHT:
        reason = f"{sum(catches)} of {len(catches)} catch trials right"
    elif np.median([a.ms for a in person.answers] or [0]) < LEAST_MEDIAN_MS:
        reason = f"half of the answers within {LEAST_MEDIAN_MS} ms"
    elif len(sides) >= 20 and not 1 - MOST_ONE_SIDED < np.mean(sides) < MOST_ONE_SIDED:
        reason = f"{max(sides.count(True), sides.count(False))} of {len(sides)} on one side"
    return Person(person.name, person.answers, reason)


def exclusions(people: Sequence[Person]) -> list[tuple[str, str]]:
    """Everybody whose answers are left out, and why."""
    return [(person.name, person.excluded) for person in people if person.excluded]


def _files(paths: Iterable[Path]) -> list[Path]:
    found: list[Path] = []
    for path in paths:
        found += sorted(path.glob("*.json")) if path.is_dir() else [path]
    return found


@reads_as(DataSetError)
def _person(path: Path, key: Key) -> Person:
    values = _json(path)
    if not isinstance(values, dict) or values.get("format") != "deeplight-study-answers":
        raise _broken(path, "another kind of file")
    if values.get("study") != key.study:
        got = f"{path} of study {values.get('study')!r}"
        raise DataSetError(f"answers to study {key.study}", got, "keep studies in folders apart")
    try:
        answers = tuple(_answer(item, key) for item in values["answers"])
        return Person(str(values["person"])[:32], answers)
    except (KeyError, TypeError, ValueError) as error:
        raise _broken(path, f"{error!r}") from None


def _answer(item: Mapping[str, Any], key: Key) -> Answer:
    kind, scene, left, right, chosen = (
        str(item[name]) for name in ("kind", "scene", "left", "right", "chosen")
    )
    answer = Answer(kind, scene, left, right, chosen, float(item["ms"]))
    known = set(key.conditions) | {"ruined"}
    if answer.kind not in ("pair", "catch", "identical") or answer.chosen not in ("left", "right"):
        raise ValueError(f"{answer.kind} {answer.chosen}")
    known_sides = {answer.left, answer.right}
    if answer.scene not in key.scenes or not known_sides <= known:
        raise ValueError(f"{answer.scene} {answer.left} {answer.right}")
    if answer.kind == "pair" and (answer.left == answer.right or "ruined" in known_sides):
        raise ValueError("a pair of one method")
    return answer


def _json(path: Path) -> Any:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise _broken(path, "far too much in it")
        return parse_json(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise _broken(path, f"{error}") from None


def _broken(path: Path, got: str) -> DataSetError:
    do = "give the files that the page of `deeplight study make` saved"
    return DataSetError(f"a person's answers in {path}", " ".join(got.split())[:160], do)
