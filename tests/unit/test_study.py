"""A perceptual study: what people are shown, and what their answers say."""

import json
from pathlib import Path

import numpy as np
import pytest

from deeplight.cli.main import main
from deeplight.errors import ConfigError, DataSetError
from deeplight.io.photos import read_photo, write_png
from deeplight.study.analyse import analyse
from deeplight.study.answers import Answer, Key, Person, checked, read_people
from deeplight.study.bradley_terry import Comparisons, chances, fit
from deeplight.study.design import (
    Sitting,
    Study,
    make_study,
    named_folders,
    ruined,
    scenes_of,
)

METHODS = ("bad", "good", "middle")
KEY = Key(
    "id",
    "real",
    {f"c{n + 1}": name for n, name in enumerate(METHODS)},
    {f"s{n}": f"{n}" for n in range(30)},
)
STRENGTH = {"bad": -0.9, "good": 0.7, "middle": 0.2}


def person(
    random: np.random.Generator,
    name: str,
    strength: dict[str, float] = STRENGTH,
    attention: float = 0.98,
    bias: float = 0.0,
) -> Person:
    """Somebody who chooses by `strength`, and sees the catch trials as often as `attention`."""
    answers = []
    codes = list(KEY.conditions)
    for _ in range(40):
        left, right = random.permutation(codes)[:2]
        odds = strength[KEY.conditions[left]] - strength[KEY.conditions[right]] + bias
        chosen = "left" if random.random() < 1 / (1 + np.exp(-odds)) else "right"
        scene = str(random.choice(list(KEY.scenes)))
        answers.append(Answer("pair", scene, left, right, chosen, random.uniform(1000, 6000)))
    for number in range(6):
        sides = ("c1", "ruined") if number % 2 else ("ruined", "c1")
        right_one = "left" if number % 2 else "right"
        wrong_one = "right" if number % 2 else "left"
        chosen = right_one if random.random() < attention else wrong_one
        answers.append(Answer("catch", "s1", *sides, chosen, 1500.0))
    for _ in range(4):
        chosen = "left" if random.random() < 1 / (1 + np.exp(-bias)) else "right"
        answers.append(Answer("identical", "s1", "c1", "c1", chosen, 1500.0))
    return Person(name, tuple(answers))


def crowd(seed: int, people: int = 60, **how: float) -> list[Person]:
    random = np.random.default_rng(seed)
    return [person(random, f"p{n}", **how) for n in range(people)]


# -- what answers say ------------------------------------------------------------------------------


def test_known_preferences_are_recovered() -> None:
    found = analyse(crowd(1), KEY, resamples=300)
    assert [r.method for r in found.ranking] == ["good", "middle", "bad"]
    for ranked in found.ranking:
        assert ranked.strength.value == pytest.approx(STRENGTH[ranked.method], abs=0.15)
        assert ranked.strength.low < STRENGTH[ranked.method] < ranked.strength.high
        assert ranked.strength.high - ranked.strength.low < 0.5
    best = found.contests[1]
    assert (best.first, best.second) == ("good", "bad")
    assert best.modelled.value == pytest.approx(1 / (1 + np.exp(-1.6)), abs=0.04)
    assert best.counted == pytest.approx(best.modelled.value, abs=0.05)


def test_intervals_hold_the_truth_about_as_often_as_they_promise() -> None:
    inside = []
    for seed in range(40):
        found = analyse(crowd(100 + seed, people=12), KEY, resamples=200)
        inside += [r.strength.low < STRENGTH[r.method] < r.strength.high for r in found.ranking]
    assert 0.9 <= np.mean(inside) <= 1


def test_methods_that_nobody_can_distinguish_come_out_even() -> None:
    found = analyse(crowd(2, strength=dict.fromkeys(METHODS, 0.0)), KEY, resamples=300)
    assert all(c.modelled.low < 0.5 < c.modelled.high for c in found.contests)
    assert all(abs(c.modelled.value - 0.5) < 0.06 for c in found.contests)
    assert found.identical.low < 0.5 < found.identical.high


def test_a_habit_for_one_side_is_seen_and_does_not_move_the_ranking() -> None:
    found = analyse(crowd(3, bias=0.8), KEY, resamples=300)
    assert found.identical.low > 0.5
    assert found.left.low > 0.5
    assert [r.method for r in found.ranking] == ["good", "middle", "bad"]


def test_who_presses_at_random_is_caught_and_who_looks_is_not() -> None:
    nonsense = dict.fromkeys(METHODS, 0.0)
    random = np.random.default_rng(4)
    spammers = [person(random, f"x{n}", nonsense, attention=0.5) for n in range(200)]
    caught = [bool(checked(spammer).excluded) for spammer in spammers]
    assert np.mean(caught) > 0.84  # 1 - 7 / 64, less chance
    assert (
        "catch trials"
        in checked(next(s for s, c in zip(spammers, caught, strict=True) if c)).excluded
    )
    assert np.mean([bool(checked(honest).excluded) for honest in crowd(5, 200)]) < 0.02
    mixed = analyse([*crowd(6), *spammers[:40]], KEY, resamples=100)
    assert len(mixed.excluded) == sum(caught[:40])
    assert mixed.people == 100 - sum(caught[:40])


def test_who_is_too_quick_or_one_sided_is_left_out() -> None:
    honest = crowd(7, 1)[0]
    quick = [Answer(*list(vars(a).values())[:5], 200.0) for a in honest.answers]
    assert "500 ms" in checked(Person("q", tuple(quick))).excluded
    left = [a for a in honest.answers if a.chosen == "left" and a.kind == "pair"] * 2
    assert "one side" in checked(Person("l", tuple(left))).excluded
    assert not checked(honest).excluded


def test_nobody_left_is_an_error_that_says_why() -> None:
    blind = crowd(8, 3, attention=0.0)
    with pytest.raises(DataSetError, match="none of 3 people; 0 of 6 catch trials"):
        analyse(blind, KEY)


def test_more_people_narrow_the_interval() -> None:
    few, many = (analyse(crowd(9, n), KEY, resamples=300).ranking[0].strength for n in (10, 90))
    assert many.high - many.low < 0.7 * (few.high - few.low)


def test_one_person_and_one_scene_have_no_interval() -> None:
    answers = [Answer("pair", "s1", "c1", c, "left", 2000.0) for c in ("c2", "c3", "c2")]
    found = analyse([Person("p", tuple(answers))], KEY, resamples=50)
    assert found.ranking[0].method == "bad"
    assert np.isfinite(found.ranking[0].strength.value)
    assert np.isnan(found.ranking[0].strength.low)


def test_the_fit_is_the_most_likely_one() -> None:
    random = np.random.default_rng(0)
    wins = random.integers(1, 40, (4, 4)).astype(float)
    np.fill_diagonal(wins, 0)
    strength = fit(wins, prior=0)
    expected = (chances(strength) * (wins + wins.T)).sum(1)
    np.testing.assert_allclose(expected, wins.sum(1), rtol=1e-9)
    assert strength.sum() == pytest.approx(0)
    assert not np.allclose(fit(wins.T, prior=0), strength)  # the twin: losers instead of winners
    np.testing.assert_allclose(fit(wins.T, prior=0), -strength, atol=1e-9)


def test_weights_of_the_draws_are_those_of_people_and_scenes() -> None:
    one = np.zeros(6, np.int64)
    both = Comparisons(one, one + 1, np.arange(6) // 3, np.arange(6) % 3, 2)
    drawn = both.drawn_wins(400)
    assert drawn[:, 0, 1].mean() == pytest.approx(6, rel=0.1)
    assert set(np.unique(drawn)) <= set(range(13))
    assert (drawn[:, 1, 0] == 0).all()


# -- the folder ------------------------------------------------------------------------------------


@pytest.fixture
def folders(tmp_path: Path) -> dict[str, Path]:
    random = np.random.default_rng(0)
    for method in METHODS:
        for scene in ("desk", "yard", "hall"):
            picture = random.integers(0, 256, (40, 60, 3), np.uint8)
            write_png(tmp_path / method / f"{scene}.png", picture)
    return {name: tmp_path / name for name in METHODS}


SHORT = Sitting(pairs=6, catches=2, identical=1)


def test_the_page_is_blind_and_whole(folders: dict[str, Path], tmp_path: Path) -> None:
    consent = "Do you agree?\n\nReally? </script><b>"
    make_study(Study(folders, session=SHORT, consent=consent), tmp_path / "out")
    page = (tmp_path / "out" / "site" / "index.html").read_text()
    for word in (*METHODS, "desk", "yard", "hall", "</script><b>"):
        assert word not in page.replace("middle", "", page.count("vertical-align: middle"))
    assert page.count("</script>") == 1
    for address in ("http:", "https:", "//cdn", "src=", "@import"):
        assert address not in page.replace("picture.src = ", "").replace(".src = ", "")
    pictures = list((tmp_path / "out" / "site" / "pictures").iterdir())
    assert len(pictures) == 9 + 3  # and a ruined one of each scene
    key = Key.load(tmp_path / "out")
    assert sorted(key.conditions.values()) == sorted(METHODS)
    assert sorted(key.scenes.values()) == ["desk", "hall", "yard"]


def test_the_same_pictures_give_the_same_study_and_others_another(
    folders: dict[str, Path], tmp_path: Path
) -> None:
    study = Study(folders, session=SHORT)
    first = make_study(study, tmp_path / "out")
    assert make_study(study, tmp_path / "out") == first
    write_png(folders["bad"] / "desk.png", np.zeros((40, 60, 3), np.uint8))
    with pytest.raises(ConfigError, match="no other study"):
        make_study(study, tmp_path / "out")
    assert make_study(study, tmp_path / "new")["study"] != first["study"]


def test_a_ruined_picture_shares_nothing_with_its_source() -> None:
    rows, columns = np.mgrid[:60, :90]
    picture = np.stack([rows * 4, columns * 2, rows + columns], -1).clip(0, 255).astype(np.uint8)
    broken = ruined(picture)
    assert broken.shape == picture.shape
    difference = np.abs(broken.astype(float) - picture).mean()
    assert difference > 40


def test_folders_that_do_not_fit_are_refused(folders: dict[str, Path], tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"9 of 3 scenes and 3 methods; say --session\.pairs 9"):
        make_study(Study(folders), tmp_path / "out")
    with pytest.raises(ConfigError, match="at least two methods"):
        Study({"bad": folders["bad"]})
    with pytest.raises(ConfigError, match="--reference"):
        Study(folders, question="reference")
    with pytest.raises(ConfigError, match="twice"):
        named_folders(["a=x", "a=y"])
    write_png(folders["bad"] / "desk.png", np.zeros((41, 60, 3), np.uint8))
    with pytest.raises(DataSetError, match="60 x 40, 60 x 41"):
        make_study(Study(folders, session=SHORT), tmp_path / "out")
    (folders["bad"] / "desk.png").unlink()
    with pytest.raises(DataSetError, match=r"1 missing, the first desk"):
        scenes_of(Study(folders))
    assert not (tmp_path / "out" / "key.json").exists()


def test_a_reference_stands_in_every_scene_and_is_no_method(
    folders: dict[str, Path], tmp_path: Path
) -> None:
    reference = folders.pop("good")
    study = Study(folders, "reference", reference, Sitting(3, 1, 0))
    key = make_study(study, tmp_path / "out")
    assert sorted(key["conditions"].values()) == ["bad", "middle"]
    page = (tmp_path / "out" / "site" / "index.html").read_text()
    assert page.count('"reference": "pictures/') == 3
    shown = next((tmp_path / "out" / "site" / "pictures").iterdir())
    assert read_photo(shown).pixels.shape == (40, 60, 3)


# -- answer files ----------------------------------------------------------------------------------


def write_answers(path: Path, someone: Person, study: str = "id") -> None:
    values = {
        "format": "deeplight-study-answers",
        "version": 1,
        "study": study,
        "person": someone.name,
        "answers": [vars(answer) for answer in someone.answers],
    }
    path.write_text(json.dumps(values))


def test_a_file_that_came_twice_counts_once(tmp_path: Path) -> None:
    for someone in crowd(10, 3):
        write_answers(tmp_path / f"{someone.name}.json", someone)
        write_answers(tmp_path / f"{someone.name} (1).json", someone)
    assert [p.name for p in read_people([tmp_path], KEY)] == ["p0", "p1", "p2"]


@pytest.mark.parametrize(
    "change",
    [
        {"kind": "other"},
        {"chosen": "both"},
        {"scene": "s99"},
        {"left": "c9"},
        {"left": "c1", "right": "c1", "kind": "pair"},
        {"left": "ruined", "right": "c1", "kind": "pair"},
        {"ms": "soon"},
    ],
)
def test_answers_that_cannot_be_are_refused(tmp_path: Path, change: dict[str, str]) -> None:
    someone = crowd(11, 1)[0]
    first = {**vars(someone.answers[0]), **change}
    values = {
        "format": "deeplight-study-answers",
        "study": "id",
        "person": "p",
        "answers": [first],
    }
    (tmp_path / "a.json").write_text(json.dumps(values))
    with pytest.raises(DataSetError, match=r"answers in .*a\.json"):
        read_people([tmp_path], KEY)


def test_other_files_and_other_studies_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DataSetError, match="none"):
        read_people([tmp_path], KEY)
    for text in ("", "[]", "{}", '{"format": "deeplight-study-answers"}', "[" * 100_000):
        (tmp_path / "a.json").write_text(text)
        with pytest.raises(DataSetError):
            read_people([tmp_path], KEY)
    write_answers(tmp_path / "a.json", crowd(12, 1)[0], study="another")
    with pytest.raises(DataSetError, match="'another'"):
        read_people([tmp_path], KEY)


def test_the_command_makes_and_analyses(
    folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [word for name, path in folders.items() for word in ("--method", f"{name}={path}")]
    out = ["--out", str(tmp_path / "study")]
    short = ["--session.pairs", "6"]
    assert main(["study", "make", *given, *out, *short]) == 0
    key = Key.load(tmp_path / "study")
    codes = {name: code for code, name in key.conditions.items()}
    random = np.random.default_rng(0)
    (tmp_path / "answers").mkdir()
    for number in range(8):
        answers = []
        for scene in key.scenes:
            for loser in ("bad", "middle"):
                sides = random.permutation([codes["good"], codes[loser]])
                chosen = "left" if sides[0] == codes["good"] else "right"
                answers.append(Answer("pair", scene, *sides, chosen, 2000.0))
        write_answers(
            tmp_path / "answers" / f"{number}.json", Person(f"p{number}", tuple(answers)), key.study
        )
    words = ["study", "analyse", str(tmp_path / "answers"), "--study", str(tmp_path / "study")]
    assert main([*words, "--out", str(tmp_path / "results")]) == 0
    assert "good" in capsys.readouterr().out
    results = json.loads((tmp_path / "results" / "results.json").read_text())
    assert results["ranking"][0]["method"] == "good"
    assert results["identical"]["value"] is None
    page = (tmp_path / "results" / "report.html").read_text()
    assert "good over bad" in page
    assert main([*words[:2], str(tmp_path / "none"), *words[3:]]) == 2
