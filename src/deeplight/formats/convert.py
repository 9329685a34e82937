"""Light in any form, changed if wanted, into the file that somebody asked for."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from deeplight.edit import Edit
from deeplight.environment import Environment
from deeplight.errors import InputError
from deeplight.formats.files import FileSpec, write_environment
from deeplight.io.environment_file import read_environment
from deeplight.lighting import Lighting


def convert(
    light: Any,
    out: Path | str,
    *,
    format: str | None = None,  # noqa: A002 # what the command calls it
    mapping: str = "latlong",
    made_for: str | None = None,
    size: int | None = None,
    edit: Edit | None = None,
) -> list[Path]:
    """Write light as a file for a tool: .exr .hdr .jpg .json .ktx2 .glb .py (Blender) .js ...

    Args:
        light: an `Environment`, a `Lighting`, or what `read_environment` reads: a file, or six.
        out: file to write; its suffix decides the format.
        format: the format where the suffix does not decide it.
        mapping: of a picture; `cube` gives six files.
        made_for: tool to turn a latlong or a cube for: blender, three, mitsuba, unity, unreal.
        size: rows of a latlong, side of a disc or a face; left out, as fine as the light.
        edit: change the light first.

    Returns:
        The files, `out` first.

    Raises:
        InputError: the light or the output cannot be had.
        OSError: a file cannot be read or written.

    Examples:
        >>> white = deeplight.Environment(np.ones((64, 128, 3), np.float32))
        >>> deeplight.convert(white, "white.exr")
        [PosixPath('white.exr')]
        >>> deeplight.read_environment("white.exr")
        Environment(64 x 128, camera frame, unit camera_white)
    """
    spec = FileSpec(Path(out), format, mapping, made_for, size)
    return write_environment(_environment(light, spec).edited(edit or Edit()), spec)


def _environment(light: Any, spec: FileSpec) -> Environment:
    if isinstance(light, Environment):
        return light
    if isinstance(light, Lighting):
        return Environment.from_lighting(light)
    if isinstance(light, str | Path):
        spec.must_not_replace([Path(light)])
        return read_environment(light)
    if isinstance(light, Sequence) and all(isinstance(path, str | Path) for path in light):
        return read_environment([Path(path) for path in light])
    got = f"a {type(light).__name__}"
    raise InputError("an Environment, a Lighting or a file of light", got, "give one of these")
