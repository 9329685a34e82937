"""What every test shares."""

import gc
import os
from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import annotations

annotations.install()

# Before numpy or torch is loaded: the workers of pytest-xdist share the cores, and each library
# starting a thread per core in each worker makes the suite several times slower.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

ROOT = Path(__file__).resolve().parents[1]

# Packages whose tests are skipped, by name, where they are not installed: those of the extras.
# The base install is tested without them (tests/packaging).
OPTIONAL = set(
    "aiohttp ai_edge_litert astral av cv2 embreex fsspec jinja2 lightning lightning_fabric"
    " flask litert_torch mapbox_earcut"
    " matplotlib mitsuba moto onnx onnxscript pillow_heif pxr pygeomag ray rawpy"
    " s3fs safetensors scipy tensorboard torch trimesh DracoPy".split()
)


# The files whose tests take longest, longest first. Two processes that share the files end together
# only if what is begun last is short; pytest-xdist itself goes by the number of tests.
LONGEST = (
    "test_export test_train_resume test_estimate test_evaluate test_fuse_command test_bracket"
    " test_training_lamps test_light_stage test_train_fresh test_locate_routes"
    " test_benchmark test_compose test_resample test_training_heads test_simulate test_rivals"
    " test_mitsuba test_trial test_convert test_onnx test_capture_trouble"
    " test_light_stage_mirror test_locate_parts test_litert test_relight test_capture"
).split()


# Files that export networks, and those that render: of processes that share the files, one takes
# all of a row, since it takes seconds to load what does that, and more to make what they share.
TOGETHER = (
    "test_export test_calibrate test_onnx test_training_heads test_training_lamps"
    " test_training_variants",
    "test_compose test_mitsuba test_transfer_mitsuba test_render_follow test_render_objects",
)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Keep each row of `TOGETHER` in one process where each file stays in one."""
    if config.getoption("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            path: str = super()._split_scope(nodeid)
            return next((row for row in TOGETHER if Path(path).stem in row.split()), path)

    return Scheduling(config, log)


def pytest_collection_finish() -> None:
    """Spare what was collected the search for garbage, which took a seventh of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 50, 50)


class OptionalModule(pytest.Module):
    """A file of tests; one that imports an optional package which is not there is skipped."""

    def collect(self) -> Iterable[pytest.Item | pytest.Collector]:
        try:
            return super().collect()
        except self.CollectError as error:
            missing = getattr(error.__cause__, "name", None) or ""
            if isinstance(error.__cause__, ModuleNotFoundError):
                skip_without(missing.split(".")[0])
            raise


def skip_without(package: str) -> None:
    """Skip the test or file that needs an optional package, if it is not installed."""
    if package in OPTIONAL and find_spec(package) is None:
        pytest.skip(f"needs {package}", allow_module_level=True)


def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> pytest.Module:
    return OptionalModule.from_parent(parent, path=module_path)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first; `pytest.mark.needs("av")` is for imports while a test runs."""
    place = {name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))
    for item in items:
        for mark in item.iter_markers("needs"):
            for package in mark.args:
                if find_spec(package) is None:
                    item.add_marker(pytest.mark.skip(reason=f"needs {package}"))


@pytest.fixture(scope="session")
def root() -> Path:
    """The top of the repository."""
    return ROOT


@pytest.fixture(scope="session")
def toy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The toy data set of all tests that do not mind what is in it; it is only read."""
    from toy_data import write_toy_data

    counts = {"train": 12, "val_indoor": 3, "val_outdoor": 3}
    return write_toy_data(tmp_path_factory.mktemp("toy"), counts)


@pytest.fixture(scope="session")
def flipped_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model file that answers the mirrored photo too: it uses each of its layers twice."""
    pytest.importorskip("onnxscript")
    from networks import shallow, write_mean

    with shallow():
        return write_mean(tmp_path_factory.mktemp("flipped"), "--flips")


@pytest.fixture(scope="session")
def everything_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model file of all that a network can have, of few blocks, in full precision."""
    pytest.importorskip("onnxscript")
    from deeplight.deploy.onnx import write_model
    from networks import EVERYTHING, EVERYTHING_CONTRACT, random_network, shallow, traced_once

    path = tmp_path_factory.mktemp("everything") / "everything.onnx"
    with shallow():
        model = traced_once(random_network(EVERYTHING), EVERYTHING_CONTRACT)
    write_model(model, EVERYTHING_CONTRACT, path, float16=False)
    return path


@pytest.fixture
def shallow_networks() -> Iterator[None]:
    """Networks of few blocks, for what holds for any depth."""
    from networks import shallow

    with shallow():
        yield


@pytest.fixture
def without_curves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short trainings without curves.png, which takes longer to draw than they take.

    `test_what_a_run_leaves` and `test_capture_film` look for it.
    """
    monkeypatch.setattr("deeplight.training.record.draw_curves", lambda _: None)


@pytest.fixture(scope="session")
def shared() -> Path:
    """Panoramas and weights next to the repository; without it tests are skipped."""
    folder = ROOT.parent / "shared"
    if not (folder / "hdri").exists():
        pytest.skip("needs ../shared/hdri")
    return folder


@pytest.fixture(scope="session")
def cases() -> Path:
    """Files of other programs that were once read wrongly; tests of them are skipped without."""
    folder = ROOT.parent / "shared/cases"
    if not folder.exists():
        pytest.skip("needs ../shared/cases")
    return folder
