"""An evaluation from the words of the command line to its results."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from deeplight.dataset import DataSet, open_dataset
from deeplight.evaluate.baselines.baseline import Baseline
from deeplight.evaluate.baselines.suite import baselines_for
from deeplight.evaluate.benchmark import benchmark_data
from deeplight.evaluate.models import NamedModel, named_models
from deeplight.evaluate.panorama_estimates import PanoramaEstimates, panorama_estimates
from deeplight.evaluate.result import SplitResult, measured
from deeplight.evaluate.with_photo import WithPhoto


@dataclass(frozen=True, eq=False)
class Wanted:
    """What is to be measured.

    Attributes:
        data: the data set, from `opened`.
        splits: of it, or groups of its splits.
        models, panoramas: as `named_models` and `panorama_estimates` take them.
        at_most: only this number of examples of each split.
        protocols: other papers' metrics too.
        truth: folder of the examples' measured light, as a method's panoramas.
        with_photo: also the first model's environment, with the photo and lamps in it.
    """

    data: DataSet
    splits: Sequence[str]
    models: Sequence[str] = ()
    panoramas: Sequence[str] = ()
    at_most: int | None = None
    protocols: bool = False
    with_photo: bool = True
    truth: str = ""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Results, one for each split, and the models they are of."""

    results: list[SplitResult]
    models: list[NamedModel]


def opened(
    place: Path | str,
    benchmark: str | None = None,
    hdri: Path | None = None,
    bases: Path | None = None,
) -> DataSet:
    """Open a data set in a folder or at an address, or the one of a benchmark in a folder.

    Args:
        bases: measured reflectance bases of its spheres; left out, those that travel with it.

    Raises:
        InputError: there is none, or what `benchmark_data` and `DataSet.with_bases` raise.
    """
    data = benchmark_data(benchmark, hdri, Path(place)) if benchmark else open_dataset(place)
    return data.with_bases(bases) if bases else data


def evaluate_models(
    data: DataSet | Path | str,
    models: Sequence[str | Path] = (),
    split: str | Sequence[str] = "val",
    *,
    panoramas: Sequence[str] = (),
    at_most: int | None = None,
    progress: Callable[[int], None] = lambda examples: None,
) -> Evaluation:
    """Measure models and other methods on a data set, next to trivial baselines.

    Args:
        data: folder, address or `DataSet`.
        models: .onnx or .tflite files, NAME=FILE, package.module:Class, or folders of training
            runs; none: the shipped model.
        split: of the data set, or a group of its splits (val, test, seen), or several.
        panoramas: other methods by their answers: NAME=FOLDER of HDR panoramas named by key.
        at_most: only this number of examples of each split, evenly spread.
        progress: called with the number of examples finished since the last call.

    Returns:
        `.results`: for each split the scores, summaries with intervals over places, and tables;
        `deeplight.evaluate.files.write_files` writes the report.

    Raises:
        InputError: the data set, a model or a split cannot be used.
    """
    chosen = data if isinstance(data, DataSet) else opened(data)
    splits = (split,) if isinstance(split, str) else tuple(split)
    names = [str(model) for model in models]
    return evaluation(Wanted(chosen, splits, names, panoramas, at_most), progress=progress)


def evaluation(
    wanted: Wanted,
    stage: Callable[[str, int | None], None] = lambda text, total: None,
    progress: Callable[[int], None] = lambda examples: None,
) -> Evaluation:
    """Measure everything that is wanted.

    Args:
        stage: called with what is done next, and how many examples it takes if that is known.
        progress: called with the number of examples finished since the last call.

    Raises:
        InputError: as `measured`, `named_models` and `panorama_estimates` do, before any work.
    """
    sizes = {split: len(wanted.data.index(split)) for split in wanted.splits}
    models = named_models(wanted.models)
    with_photo = [WithPhoto(models[0])] if wanted.with_photo and models else []
    (truth,) = panorama_estimates([f"truth={wanted.truth}"]) if wanted.truth else (None,)
    others: list[PanoramaEstimates] = panorama_estimates(wanted.panoramas)
    results = []
    for split, size in sizes.items():
        stage("baselines from the training split", None)
        baselines: list[Baseline] = baselines_for(wanted.data, split)
        stage(f"measuring {split}", min(wanted.at_most or size, size))
        results.append(
            measured(
                [*models, *with_photo, *others],
                baselines,
                wanted.data,
                split,
                wanted.at_most,
                wanted.protocols,
                progress,
                truth,
            )
        )
    return Evaluation(results, models)
