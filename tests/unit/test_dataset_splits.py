"""Splits by place, their groups, and how a split is cut into shards."""

import pytest

from deeplight.dataset import plan_split
from deeplight.dataset.splits import check_places, splits_named
from deeplight.errors import DataSetError


def test_groups_of_splits() -> None:
    assert splits_named("test") == ("unseen_indoor", "unseen_outdoor")
    assert splits_named("train") == ("train",)
    with pytest.raises(DataSetError, match="val_indoor"):
        splits_named("validation")


@pytest.mark.parametrize(
    ("first", "second"),
    [("train", "val_indoor"), ("seen_outdoor", "unseen_outdoor"), ("val_indoor", "unseen_indoor")],
)
def test_no_place_is_both_trained_on_and_held_out(first: str, second: str) -> None:
    check_places({first: ["a", "b"], second: ["c"]})
    with pytest.raises(DataSetError, match="'b' in both"):
        check_places({first: ["a", "b"], second: ["b"]})


def test_seen_takes_come_from_training_places() -> None:
    check_places({"train": ["a"], "seen_indoor": ["a"]})


def test_shards_sizes() -> None:
    jobs = plan_split("train", 7, 3)
    assert [(job.file, job.first, job.count) for job in jobs] == [
        ("train-000000.tar", 0, 3),
        ("train-000001.tar", 3, 3),
        ("train-000002.tar", 6, 1),
    ]
    with pytest.raises(DataSetError):
        plan_split("holdout", 7)
