"""Small good files of what the program keeps for itself: data sets, sessions, studies, models."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from deeplight.dataset import Example, ExampleMeta, ShardPlan, plan_split
from deeplight.frames import rotation
from deeplight.io.basis_file import save_bases
from deeplight.reflectance import rig_bases
from deeplight.sphere import PAPER_RIG, SPHERES

DATA_SET = "dataset"
GOLDEN = Path(__file__).parents[2] / "tests" / "golden"
_rng = np.random.default_rng(18)


def data_set(folder: Path) -> Path:
    """Write a data set of one split and two examples, both with true light."""
    if (folder / "manifest.json").exists():
        return folder
    jobs = plan_split("val_indoor", 2)
    plan = ShardPlan.begin(folder, jobs, {"paper": PAPER_RIG.to_dict()}, {})
    for job in jobs:
        plan.write(job, (_example(number) for number in range(2)))
    plan.finish()
    return folder


def _example(number: int) -> Example:
    photo = _rng.integers(0, 256, (192, 135, 3), np.uint8)
    spheres = {name: _rng.integers(0, 256, (32, 32, 3), np.uint8) for name in SPHERES}
    meta = ExampleMeta(
        f"place{number}", "take", number, "indoor", "val_indoor", "paper", "toy", "CC0", "made up"
    )
    light = _rng.random((32, 32, 3)).astype(np.float32)
    return Example(f"key{number}", photo, spheres, meta, true_lighting=light)


def _of_data_set(pattern: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        (found,) = data_set(path.parent / DATA_SET).glob(pattern)
        path.write_bytes(found.read_bytes())

    return write


def written(content: bytes) -> Callable[[Path], None]:
    """Give a writer of files of this content."""

    def write(path: Path) -> None:
        path.write_bytes(content)

    return write


def _json(value: object) -> Callable[[Path], None]:
    return written(json.dumps(value).encode())


def _session(path: Path) -> None:
    from deeplight.fuse.session import Session

    session = Session(1.0, lambda pixels: np.zeros((32, 32, 3), np.float32))
    for number in range(3):
        frame = _rng.integers(0, 256, (64, 36, 3), np.uint8)
        session.add(frame, rotation("y", 0.3 * number))
    session.save(path)


def _bases(path: Path) -> None:
    save_bases(path, rig_bases(PAPER_RIG, 8), {"made": "here"})


def _transfer(path: Path) -> None:
    from deeplight.compose import shapes
    from deeplight.compose.mesh import Finish, Mesh
    from deeplight.transfer.file import write
    from deeplight.transfer.ground import Ground
    from deeplight.transfer.precompute import TransferSettings, precompute

    vertices, faces, normals = shapes.bunny(7)
    mesh = Mesh(vertices, faces, normals, None, 0.5 + 0.4 * normals, Finish())
    settings = TransferSettings(
        samples=16, bounces=0, diffuse=None, ground=Ground(size=4), longest_edge=1.0, clusters=2,
        components=2,
    )  # fmt: skip
    write(path, precompute([mesh], settings)[0])


def _checkpoint(path: Path) -> None:
    import torch

    from deeplight.training import checkpoint
    from deeplight.training.config import TrainConfig, flatten

    header = checkpoint.Header(1, 0.5, flatten(TrainConfig()), "0" * 64)
    checkpoint.save(path, header, model={"weight": torch.zeros(3, 4), "bias": torch.ones(3)})


def _copy(name: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        path.write_bytes((GOLDEN / name).read_bytes())

    return write


POSES = {
    "convention": "arkit",
    "frames": [
        {"time_s": 0.0, "matrix": list(np.eye(4).ravel())},
        {"time_s": 0.1, "quaternion": [0, 0, 0, 1]},
        {"time_s": 0.2, "rotation": np.eye(3).tolist()},
    ],
}
KEY: dict[str, Any] = {
    "format": "deeplight-study-key", "version": 1, "study": "a", "question": "which?",
    "conditions": {"x": "one", "y": "two"}, "scenes": {"s": "scene"},
}  # fmt: skip
ANSWERS = {
    "format": "deeplight-study-answers", "study": "a", "person": "p",
    "answers": [
        {"kind": "pair", "scene": "s", "left": "x", "right": "y", "chosen": "left", "ms": 900},
        {"kind": "catch", "scene": "s", "left": "ruined", "right": "y", "chosen": "right",
         "ms": 700},
    ],
}  # fmt: skip
ENTRY = {
    "data_sha256": "0" * 64, "bases": "analytic", "split": "val", "name": "a",
    "model_sha256": "1" * 64, "examples": 3, "places": 2,
    "numbers": {"l1_mirror": [0.2, 0.1, 0.3]}, "deeplight": "1",
}  # fmt: skip
RIG = {
    "tag": {"family": "36h11", "id": 0, "size_m": 0.04},
    "spheres": {name: {"centre_m": [0.1 * i, 0.06, 0.0], "diameter_m": 0.08}
                for i, name in enumerate(SPHERES)},
}  # fmt: skip
STAGE = {"lights": [{"file": "a.png", "direction": [0, 1, 0], "intensity": [1, 1, 1]}]}

CLIPS = b"clip,place,scene,split,licence\na.mp4,hall,indoor,train,CC0\nb,yard,outdoor,val,CC0\n"
PLACES = b"file,split,place,scene\ngood.exr,train,hall,indoor\ngood.hdr,val,yard,outdoor\n"
STAGE_TABLE = b"file,latitude_deg,longitude_deg\na.png,10,20\nb.png,0,-90\n"


KEPT: dict[str, Callable[[Path], None]] = {
    "shard.tar": _of_data_set("*-*.tar"),
    "index.json": _of_data_set("*-*.json"),
    "manifest.json": _of_data_set("manifest.json"),
    "plan.json": _of_data_set("plan.json"),
    "session.npz": _session,
    "bases.npz": _bases,
    "poses.json": _json(POSES),
    "rig.json": _json(RIG),
    "stage.json": _json(STAGE),
    "key.json": _json(KEY),
    "answers.json": _json(ANSWERS),
    "board.json": _json({"format": "deeplight-leaderboard", "version": 1, "entries": [ENTRY]}),
    "clips.csv": written(CLIPS),
    "places.csv": written(PLACES),
    "stage.csv": written(STAGE_TABLE),
    "transfer": _transfer,
    "safetensors": _checkpoint,
    "tflite": _copy("tiny.tflite"),
}
