"""Data sets: examples in WebDataset shards, split by place.

Make one with `ShardPlan` (any source of `Example`), read one with `open_dataset`.
"""

from deeplight.dataset.chosen import Chosen
from deeplight.dataset.example import Example, ExampleMeta
from deeplight.dataset.manifest import Manifest, ShardRecord, Skipped
from deeplight.dataset.plan import ShardJob, ShardPlan, plan_split
from deeplight.dataset.reading import DataSet, SplitIndex, add_bases, open_dataset
from deeplight.dataset.splits import GROUPS, SPLITS, TRAINING_SPLITS, splits_named

__all__ = [
    "GROUPS",
    "SPLITS",
    "TRAINING_SPLITS",
    "Chosen",
    "DataSet",
    "Example",
    "ExampleMeta",
    "Manifest",
    "ShardJob",
    "ShardPlan",
    "ShardRecord",
    "Skipped",
    "SplitIndex",
    "add_bases",
    "open_dataset",
    "plan_split",
    "splits_named",
]
