"""The readers that get the damaged files: those that the commands use."""

import os
import shutil
import sys
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from lab.fuzz.seeds_kept import DATA_SET, KEY

Reader = Callable[[Path], Any]


def _photo(path: Path) -> None:
    from deeplight.io.photos import read_photo

    read_photo(path)


def _photograph(path: Path) -> None:
    from deeplight.io.photograph import read_photograph

    read_photograph(path, 2.2)


def _tilt(path: Path) -> None:
    from deeplight.io.exif import exif_directories
    from deeplight.io.tilt import tilt_of

    tilt_of(exif_directories(path))


def _environment(path: Path) -> None:
    from deeplight.io.environment_file import read_environment

    read_environment(path)


def _video(path: Path) -> None:
    from deeplight.io.video import frames

    list(islice(frames(path), 6))


def _facts(path: Path) -> None:
    from deeplight.io.video import facts

    facts(path)


def _mesh(path: Path) -> None:
    from deeplight.compose.mesh import load

    load(str(path))


def _weights(path: Path) -> None:
    from deeplight.training.network.imagenet import read_folded

    read_folded(path)


def _bases(path: Path) -> None:
    from deeplight.io.basis_file import load_bases

    load_bases(path)


def _rig(path: Path) -> None:
    from deeplight.capture.rig_file import read_rig_file

    read_rig_file(path)


def _lights(path: Path) -> None:
    from deeplight.io.light_stage_file import read_lights

    read_lights(path)


def _model(path: Path) -> None:
    """As `estimators.trial` does it, but in a fork, which has the libraries and starts at once."""
    from deeplight.errors import ModelError
    from deeplight.estimators import onnx, trial, trial_process  # noqa: F401  # onnx is for the fork

    if path.suffix == ".tflite":
        from deeplight.estimators import litert  # noqa: F401

    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.dup2(write, 1)
        try:
            code = trial_process.main(path, trial.CPU_S)
            sys.stdout.flush()
        except BaseException:  # a traceback of the real child, which is a refusal too
            code = 1
        os._exit(code)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        said = pipe.read()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    refusal = trial.verdict(path, code, said)
    if refusal is not None:
        raise ModelError(*refusal)
    trial_process.open_trusted(path)


def _places(path: Path) -> None:
    from deeplight.simulate.panorama import MANIFEST, places_in

    with TemporaryDirectory() as folder:
        shutil.copyfile(path, Path(folder) / MANIFEST)
        places_in(Path(folder))


def _clips(path: Path) -> None:
    from deeplight.capture.catalogue import find_clips

    find_clips([path.with_name("a.mp4")], path)


def _of_data_set(place: str, path: Path) -> None:
    """Put a file into a data set in place of its own, and read all of it."""
    from deeplight.dataset import open_dataset
    from deeplight.dataset.plan import ShardPlan

    path.stat()
    with TemporaryDirectory() as scratch:
        folder = Path(scratch) / DATA_SET
        shutil.copytree(path.with_name(DATA_SET), folder)
        (found,) = folder.glob(place)
        shutil.copyfile(path, found)
        ShardPlan.open(folder).missing()
        data = open_dataset(folder)
        for split in data.splits:
            list(data.examples(split))
        data.verify()


def _shard(path: Path) -> None:
    _of_data_set("*-*.tar", path)


def _index(path: Path) -> None:
    _of_data_set("*-*.json", path)


def _manifest(path: Path) -> None:
    _of_data_set("manifest.json", path)


def _plan(path: Path) -> None:
    _of_data_set("plan.json", path)


def _session(path: Path) -> None:
    from deeplight.fuse.session import Session

    Session.load(path, lambda pixels: np.zeros((32, 32, 3), np.float32))


def _poses(path: Path) -> None:
    from deeplight.fuse.poses import read_poses

    poses = read_poses(path, upright=True)
    for number in range(3):
        poses.at(number, number / 10)


def _panorama_photo(path: Path) -> None:
    from deeplight.fuse.panorama_photo import is_panorama, panorama_frames
    from deeplight.io.photos import read_photo

    if is_panorama(path):
        list(panorama_frames(path, read_photo(path).pixels))


def _frames(path: Path) -> None:
    from deeplight.fuse.sources import read_frames

    read_frames([path], None)


def _bracket(path: Path) -> None:
    from deeplight.bracket.exposures import read_frames

    read_frames([path, path], (0.1, 0.4))


def _key(path: Path) -> None:
    from deeplight.study.answers import Key

    Key.load(path)


def _answers(path: Path) -> None:
    from deeplight.study.analyse import analyse
    from deeplight.study.answers import Key, checked, read_people

    key = Key(*(KEY[name] for name in ("study", "question", "conditions", "scenes")))
    analyse([checked(person) for person in read_people([path], key)], key)


def _board(path: Path) -> None:
    from deeplight.evaluate.leaderboard import read_leaderboard

    read_leaderboard(path)


def _transfer(path: Path) -> None:
    from deeplight.transfer.file import read

    read(path)


def _checkpoint(path: Path) -> None:
    from deeplight.training.checkpoint import load

    load(path)


def _network(path: Path) -> None:
    from deeplight.training.model_file import load_network

    load_network(path)


_PICTURE: tuple[Reader, ...] = (_photo, _photograph, _tilt, _panorama_photo)
_OF: dict[str, tuple[Reader, ...]] = {
    "exr": (_environment, _photo),
    "hdr": (_environment, _photo),
    "tif": (*_PICTURE, _environment),
    "jpg": (*_PICTURE, _bracket),
    "mp4": (_video, _facts, _frames),
    "light.json": (_environment,),
    "rig.json": (_rig,),
    "stage.json": (_lights,),
    "stage.csv": (_lights,),
    "poses.json": (_poses,),
    "key.json": (_key,),
    "answers.json": (_answers,),
    "board.json": (_board,),
    "index.json": (_index,),
    "manifest.json": (_manifest,),
    "plan.json": (_plan,),
    "shard.tar": (_shard,),
    "clips.csv": (_clips,),
    "places.csv": (_places,),
    "npz": (_weights, _bases, _session),
    "session.npz": (_session,),
    "bases.npz": (_bases,),
    "glb": (_mesh,),
    "gltf": (_mesh,),
    "obj": (_mesh,),
    "ply": (_mesh,),
    "transfer": (_transfer,),
    "safetensors": (_checkpoint, _network),
    "onnx": (_model, _network),
    "tflite": (_model,),
}
for _container in ("mov", "mkv", "webm", "avi"):
    _OF[_container] = _OF["mp4"]


def readers_of(kind: str) -> tuple[Reader, ...]:
    """Give the readers that a file of a format comes to."""
    return _OF.get(kind) or _OF.get(kind.rpartition(".")[2], _PICTURE)
