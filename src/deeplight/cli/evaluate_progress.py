"""What `deeplight evaluate` shows while it measures."""

from rich.progress import Progress

from deeplight.evaluate.command import Evaluation, Wanted, evaluation


def measured(wanted: Wanted) -> Evaluation:
    """Measure, with a progress bar for each method and split."""
    with Progress(transient=True) as bar:
        task = bar.add_task("", total=None)
        return evaluation(
            wanted,
            lambda text, total: bar.reset(task, description=text, total=total),
            lambda examples: bar.advance(task, examples),
        )
