"""Splits by place: what may be trained on, and which places nothing may have seen before."""

from collections.abc import Collection, Mapping

from deeplight.errors import DataSetError

SPLITS = (
    "train",
    "seen_indoor",
    "seen_outdoor",
    "val_indoor",
    "val_outdoor",
    "unseen_indoor",
    "unseen_outdoor",
)
TRAINING_SPLITS = ("train",)

GROUPS: dict[str, tuple[str, ...]] = {
    "seen": ("seen_indoor", "seen_outdoor"),  # new takes in training places
    "val": ("val_indoor", "val_outdoor"),  # new places, to tune on
    "test": ("unseen_indoor", "unseen_outdoor"),  # new places, to report
}

# Splits of one set may share places; splits of two sets never do.
_PLACE_SETS: dict[str, tuple[str, ...]] = {
    "training": (*TRAINING_SPLITS, *GROUPS["seen"]),
    "val": GROUPS["val"],
    "test": GROUPS["test"],
}


def splits_named(name: str) -> tuple[str, ...]:
    """Give the splits that `name` stands for: itself, or the members of a group ("val", "test").

    Raises:
        DataSetError: there is no such split or group.
    """
    if name in GROUPS:
        return GROUPS[name]
    if name in SPLITS:
        return (name,)
    choices = ", ".join((*GROUPS, *SPLITS))
    raise DataSetError("a split or a group of splits", repr(name), f"choose one of {choices}")


def check_places(places: Mapping[str, Collection[str]]) -> None:
    """Refuse a data set in which one place is both trained on and held out.

    Neighbouring frames and takes of one place are near duplicates, so a split by frame would
    measure memory (section 3.1, Datasets: "unseen" videos were recorded in new locations).

    Args:
        places: the places of each split.

    Raises:
        DataSetError: a place lies in two of: training and seen, val, test.
    """
    home: dict[str, str] = {}
    for name, splits in _PLACE_SETS.items():
        for place in sorted({place for split in splits for place in places.get(split, ())}):
            other = home.setdefault(place, name)
            if other != name:
                raise DataSetError(
                    "splits by place",
                    f"{place!r} in both the {other} and the {name} splits",
                    "give every place one split, then make the data set again in a new folder",
                )
