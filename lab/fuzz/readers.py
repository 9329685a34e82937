"""The readers that get the damaged files: those that the commands use."""

from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any

Reader = Callable[[Path], Any]


def _photo(path: Path) -> None:
    from deeplight.io.photos import read_photo

    read_photo(path)


def _photograph(path: Path) -> None:
    from deeplight.io.photograph import read_photograph

    read_photograph(path, 2.2)


def _tilt(path: Path) -> None:
    from deeplight.io.tilt import tilt_of

    tilt_of(path)


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
    from deeplight.estimators.open import open_model

    open_model(path, 1)


_PICTURE: tuple[Reader, ...] = (_photo, _photograph, _tilt)
_OF: dict[str, tuple[Reader, ...]] = {
    "exr": (_environment, _photo),
    "hdr": (_environment, _photo),
    "tif": (*_PICTURE, _environment),
    "mp4": (_video, _facts),
    "json": (_environment, _rig, _lights),
    "npz": (_weights, _bases),
    "glb": (_mesh,),
    "obj": (_mesh,),
    "ply": (_mesh,),
    "onnx": (_model,),
}


def readers_of(kind: str) -> tuple[Reader, ...]:
    """The readers that a file of a format comes to."""
    return _OF.get(kind.rpartition(".")[2], _PICTURE)
