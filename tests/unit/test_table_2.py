"""Table 2: two opposite views, the tables, and whether a rival finds lights at all."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from deeplight.dataset import Example, ExampleMeta, open_dataset
from deeplight.errors import DataSetError
from deeplight.estimators.open import open_model
from deeplight.evaluate.bootstrap import PlaceBootstrap
from deeplight.evaluate.scores import TRUE_LIGHTING
from deeplight.frames import world_from_camera
from deeplight.fuse.fuse import FRONT_FROM_BACK
from deeplight.io.environment_file import read_environment
from deeplight.io.radiance import write_exr
from deeplight.lighting import Lighting
from deeplight.sphere import PAPER_RIG
from lab.evidence.opposite_views import photographed, write_opposite_views
from lab.evidence.table_2 import EARLIER, MEASURES, history, less_than_others, lights_found, table
from toy_data import write_toy_data

pytestmark = pytest.mark.needs("scipy", "onnxruntime")

WEST, EAST = 0.1, 0.6


def room() -> np.ndarray:
    """Dark in front (-Z), light behind."""
    light = np.full((64, 128, 3), WEST, np.float32)
    light[:, :32] = light[:, 96:] = EAST
    return light


def test_the_front_camera_sees_what_is_behind() -> None:
    random, pose, gain = np.random.default_rng(0), np.eye(3), np.ones(3, np.float32)
    rear = photographed(room(), pose, random, gain)
    front = photographed(room(), pose @ FRONT_FROM_BACK, random, gain)
    levels = [float(np.median(picture)) / 255 for picture in (rear, front)]
    assert levels == pytest.approx([WEST ** (1 / 2.2), EAST ** (1 / 2.2)], abs=0.12)
    metered = photographed(room(), pose @ FRONT_FROM_BACK, np.random.default_rng(0))
    assert 0.3 < np.median(metered) / 255 < 0.6


def test_examples_are_answered_from_both_sides(tmp_path: Path) -> None:
    """A window behind, to the left, is there in the answer; a set without poses is refused."""
    behind_left = np.full((64, 128, 3), WEST, np.float32)
    behind_left[:, :20] = EAST
    write_exr(tmp_path / "room.exr", behind_left)
    details = {
        "world_from_camera": world_from_camera(0.0, 0.0).tolist(),
        "log_gain": [0.0, 0.0, 0.0],
    }

    def data(folder: str, details: dict[str, list[float]]):
        meta = ExampleMeta(
            "a", "t", 0, "indoor", "val_indoor", "paper", "phone", "CC0", "room.exr", details
        )
        spheres = {name: np.zeros((32, 32, 3), np.uint8) for name in PAPER_RIG.views}
        example = Example("one", np.zeros((192, 135, 3), np.uint8), spheres, meta)
        made = write_toy_data(tmp_path / folder, {"val_indoor": 1}, lambda _: iter([example]))
        return open_dataset(made).index("val_indoor")

    write_opposite_views(data("d", details), [0], tmp_path, open_model(), tmp_path / "out")
    found = read_environment(tmp_path / "out" / "one.exr").radiance
    ahead, left, right = (
        found[30:34, part].mean() for part in (slice(60, 68), slice(2, 8), slice(-8, -2))
    )
    assert ahead == pytest.approx(WEST, rel=0.3)
    assert left > 2 * right
    with pytest.raises(DataSetError, match="pose and exposure"):
        write_opposite_views(data("e", {}), [0], tmp_path, open_model(), tmp_path / "none")


def lamp(azimuth_deg: float, elevation_deg: float = 30.0) -> np.ndarray:
    """ln radiance of one lamp; 0 degrees is straight ahead."""
    up, around = np.radians([elevation_deg, azimuth_deg])
    rays = np.array([np.cos(up) * np.sin(around), np.sin(up), -np.cos(up) * np.cos(around)])
    from deeplight.mappings import latlong

    light = 0.05 + 40.0 * (latlong.directions(64, 128) @ rays > 0.98)
    ball = Lighting.from_latlong(light[..., None] * np.ones(3, np.float32)).radiance
    return np.asarray(np.log(np.maximum(ball, 1e-6)), np.float32)


def result_of(found: list[float], true: list[float], turn_deg: float = 0.0) -> SimpleNamespace:
    count = len(found)
    report = SimpleNamespace(
        log_radiance={
            "rival": np.stack([lamp(a) for a in found]),
            TRUE_LIGHTING: np.stack([lamp(a) for a in true]),
        },
        places=np.array([f"p{n % 3}" for n in range(count)]),
        world_from_camera=np.stack([world_from_camera(np.radians(turn_deg))] * count),
    )
    return SimpleNamespace(report=report)


def test_lights_are_found_and_those_of_other_photos_are_not() -> None:
    true = [0.0, 90.0, 180.0, 270.0]
    cells = lights_found("rival", result_of([10.0, 100.0, 190.0, 280.0], true, 77.0)).split("|")
    assert cells[1].strip() == "rival"
    assert cells[3].strip().startswith("10")
    assert cells[4].strip() == "100%"
    assert cells[6].strip().startswith("170")  # two photos on: the opposite side
    assert cells[7].strip() == "0%"


def test_the_tables_hold_every_method_and_say_who_is_better() -> None:
    draws = PlaceBootstrap(np.array(["a", "b", "c"]))
    ours, theirs = np.array([0.1, 0.2, 0.15]), np.array([0.3, 0.35, 0.4])

    def summary(values: np.ndarray) -> SimpleNamespace:
        differ = {} if values is theirs else {"rival": draws.difference(ours, theirs)}
        return SimpleNamespace(mean=draws.mean(values), sd=values.std(), difference=differ)

    found = SimpleNamespace(
        methods=("landscape", "rival"),
        report=SimpleNamespace(scores={"landscape": 0, "rival": 0}),
        find=lambda name, scene, metric: summary(ours if name == "landscape" else theirs),
    )
    lines = table("indoor", found)  # type: ignore[arg-type]
    text = "\n".join(lines)
    assert "| landscape | 0.150 ± 0.041 |" in text
    assert "| rival | 0.350 ± 0.041 |" in text
    assert "| rival | −0.200 (−0.250 to −0.150)".replace(" to ", "\xa0to\xa0")[:20] in text


def test_a_rival_is_held_against_what_its_paper_was() -> None:
    def scores(value: float) -> SimpleNamespace:
        columns = {name: value + np.array([0.1, 0.2, 0.3]) for name in MEASURES}
        return SimpleNamespace(metrics=lambda: columns)

    by_name = {"rival": scores(0.0), EARLIER[0]: scores(0.2), EARLIER[1]: scores(-0.1)}
    report = SimpleNamespace(places=np.array(["a", "b", "c"]), scores=by_name)
    lines = less_than_others("indoor", SimpleNamespace(report=report), "rival")  # type: ignore[arg-type]
    assert "rival less" in lines[0]
    assert lines[2].startswith(f"| {EARLIER[0]} | −0.200 (−0.200")
    assert lines[3].startswith(f"| {EARLIER[1]} | 0.100 (0.100")


def test_the_kept_step_is_the_best_on_held_out_views() -> None:
    config = SimpleNamespace(name="rival", batch_size=32, encoder="ours")
    rival = SimpleNamespace(config=config, history=[[10, 2.0, 3.0], [20, 1.0, 2.5], [30, 0.5, 2.8]])
    assert history([rival])[-1] == "| rival | 30 | 960 | 20 | 1.00, 2.50 |"
    worse = replace_history(rival)
    assert "| 10 |" in history([worse])[-1]


def replace_history(rival: SimpleNamespace) -> SimpleNamespace:
    return SimpleNamespace(config=rival.config, history=[[10, 2.0, 1.0], *rival.history[1:]])
