"""Measure an estimator on a data set, beside trivial baselines, in one run.

deeplight evaluate --data data/sim --split val --out results

Prints masked L1 of the spheres, colour angle and relative radiance error of the diffuse one. With
--out it also writes results.json, results.csv (every example), percentiles.png and run.toml.
"""

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import rich
from rich.progress import Progress


@dataclass(frozen=True)
class Args:
    """Options of `deeplight evaluate`."""

    data: Path
    """Folder of the data set."""
    split: str = "val"
    """val, test or seen, or one split of the data set."""
    model: Path | None = None
    """An exported model (.onnx); left out, the one that comes with deeplight."""
    out: Path | None = None
    """Folder for the results as files."""
    examples: int | None = None
    """Measure only so many examples, evenly spread over the split."""


def run(args: Args) -> None:
    """Evaluate with a progress bar, print the tables, write the files."""
    from deeplight.dataset import open_dataset
    from deeplight.estimate.onnx_estimator import OnnxEstimator
    from deeplight.evaluate.baselines.suite import baselines_for
    from deeplight.evaluate.files import write_files
    from deeplight.evaluate.run import BatchEstimator, evaluate
    from deeplight.evaluate.summary import summarise
    from deeplight.evaluate.tables import ratio_table, terminal_tables
    from deeplight.io.atomic import results_folder

    data = open_dataset(args.data)
    of_split = len(data.index(args.split))  # a wrong split is told before any work
    model = OnnxEstimator(args.model)
    with results_folder(args.out) if args.out else nullcontext():  # so is a missing permission
        with Progress(transient=True) as bar:
            task = bar.add_task("constant baselines from the training split", total=None)
            estimators: list[BatchEstimator] = [model, *baselines_for(data, args.split)]
            bar.update(task, description="measuring", total=args.examples or of_split)
            report = evaluate(
                estimators, data, args.split, args.examples, lambda n: bar.advance(task, n)
            )
        summaries = summarise(report)
        ratios = ratio_table(summaries, args.split, model.name)
        rich.print(*terminal_tables(summaries, args.split), ratios)
        if args.out is not None:
            told = {"trained_on": model.contract.trained_on, "sha256": model.sha256}
            write_files(args.out, report, summaries, data, estimators, told)
