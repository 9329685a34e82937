"""What a run learns from: several data sets, some places, none that is validated in."""

from dataclasses import replace

import numpy as np
import pytest

from deeplight.dataset import Example, ExampleMeta, add_bases
from deeplight.errors import DataSetError
from deeplight.io.basis_file import save_bases
from deeplight.reflectance import analytic_basis
from deeplight.sphere import PAPER_RIG
from deeplight.training.data import DataConfig
from deeplight.training.sources import Sources
from toy_data import write_toy_data

VALIDATION = ("val_indoor",)
CONFIG = DataConfig(validation_splits=VALIDATION)


def write(folder, places, train=6, validation=0, rig=PAPER_RIG, split=VALIDATION[0]):
    """A data set whose example n lies in place n modulo their number and is a photo of n + 1."""

    def examples(job):
        return (example(job.split, places, n) for n in range(job.first, job.first + job.count))

    counts = {"train": train, **({split: validation} if validation else {})}
    return write_toy_data(folder, counts, examples, rig)


def example(split, places, n):
    place = places[n % len(places)] if split == "train" else f"held out {n}"
    photo = np.full((192, 135, 3), n + 1, np.uint8)
    spheres = {name: np.full((32, 32, 3), n + 1, np.uint8) for name in PAPER_RIG.views}
    meta = ExampleMeta(place, "take", n, "indoor", split, "paper", "toy", "CC0", "made up")
    return Example(f"{split}-{n}", photo, spheres, replace(meta, details={"number": n}))


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    return write(tmp_path_factory.mktemp("first"), ("a", "b", "c"), validation=2)


@pytest.fixture(scope="module")
def second(tmp_path_factory):
    return write(tmp_path_factory.mktemp("second"), ("c", "d"), train=4)


def shown(chosen):
    return [int(chosen.pixels(n)[0][0, 0, 0]) for n in range(len(chosen))]


def test_examples_of_all_data_sets_are_learnt_from_in_order(first, second):
    chosen = Sources(first, [second]).training(CONFIG, seed=0)
    assert shown(chosen) == [1, 2, 3, 4, 5, 6, 1, 2, 3, 4]
    assert chosen.places.tolist() == [*"abcabc", *"cdcd"]
    assert shown(Sources(first).training(CONFIG, seed=0)) == [1, 2, 3, 4, 5, 6]
    assert [chosen.details(n)["number"] for n in range(10)] == [*range(6), *range(4)]
    takes = chosen.takes.tolist()  # all are named alike
    assert [takes.index(name) for name in takes] == [0, 1, 2, 0, 1, 2, 6, 7, 6, 7]


def test_fewer_places_are_among_more_and_keep_all_their_examples(first, second):
    sources, before = Sources(first, [second]), set()
    for count in (1, 2, 3, 4):
        chosen = sources.training(DataConfig(places=count), seed=5)
        places = set(chosen.places.tolist())
        assert len(places) == count
        assert before <= places
        whole = sources.training(CONFIG, seed=5)
        assert len(chosen) == np.isin(whole.places, sorted(places)).sum()
        before = places
    drawn = {str(sources.training(DataConfig(places=1), seed).places[0]) for seed in range(20)}
    assert len(drawn) > 1
    with pytest.raises(DataSetError, match="expected 9 training places; got 4"):
        sources.training(DataConfig(places=9), seed=0)


def test_only_the_first_data_set_validates(first, second):
    assert {n: len(i) for n, i in Sources(first, [second]).validation(CONFIG).items()} == {
        "val_indoor": 2
    }


@pytest.mark.parametrize("split", [VALIDATION[0], "unseen_indoor"])
def test_a_place_that_is_held_out_is_not_learnt_from(tmp_path, second, split):
    first = write(tmp_path / "first", ("a", "b"), validation=2, split=split)
    sources = Sources(first, [second])
    sources.refuse_held_out(sources.training(CONFIG, seed=0))
    leak = Sources(first, [write(tmp_path / "leak", ("e", "held out 1"), train=2)])
    with pytest.raises(DataSetError, match="got held out 1"):
        leak.refuse_held_out(leak.training(CONFIG, seed=0))


def test_the_fingerprint_follows_what_is_learnt_from(first, second):
    alone, both = Sources(first).fingerprint, Sources(first, [second]).fingerprint
    assert alone == Sources(first).sets[0].manifest_sha256
    assert len({alone, both, Sources(second, [first]).fingerprint}) == 3


def dark(path, share):
    """Measured bases whose diffuse sphere reflects a share of the analytic one's light."""
    basis = analytic_basis("diffuse", PAPER_RIG.views["diffuse"])
    save_bases(path, {"diffuse": replace(basis, weights=basis.weights * np.float32(share))}, {})
    return path


def test_measured_bases_of_a_data_set_are_learnt_with_and_another_file_overrides_them(tmp_path):
    """They name the run, too: it would be another one with other spheres."""
    folder = write(tmp_path / "own", ("a", "b"))
    analytic = Sources(folder).bases("paper", 32)["diffuse"].weights.sum()
    add_bases(folder, dark(tmp_path / "half.npz", 0.5))
    own, other = Sources(folder), Sources(folder, bases=dark(tmp_path / "tenth.npz", 0.1))
    shares = [s.bases("paper", 32)["diffuse"].weights.sum() / analytic for s in (own, other)]
    assert shares == pytest.approx([0.5, 0.1], rel=0.02)
    assert own.bases("paper", 16)["diffuse"].light_size == 16
    assert len({own.fingerprint, other.fingerprint, own.sets[0].manifest_sha256}) == 3


def test_one_rig_has_one_reflectance(first, tmp_path):
    measured = write(tmp_path / "measured", ("e",), train=1)
    add_bases(measured, dark(tmp_path / "half.npz", 0.5))
    with pytest.raises(DataSetError, match="one reflectance of the spheres of rig 'paper'"):
        Sources(first, [measured]).bases("paper", 32)
    named = Sources(first, [measured], tmp_path / "half.npz")
    assert named.bases("paper", 32)["diffuse"].light_size == 32


def test_one_name_means_one_rig(first, tmp_path):
    view = PAPER_RIG.views["mirror"]
    wider = replace(view, angular_radius_rad=view.angular_radius_rad * 1.1)
    other = replace(PAPER_RIG, views={**PAPER_RIG.views, "mirror": wider})
    with pytest.raises(DataSetError, match="one rig named 'paper'"):
        Sources(first, [write(tmp_path / "other", ("f",), train=1, rig=other)])
