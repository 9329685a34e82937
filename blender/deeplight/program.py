"""Runs the installed `deeplight`: a photo in, its light as files that Blender reads."""

import json
import math
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

INSTALL = "install it (its README says how), or set its path in the add-on's preferences"
LONGEST_S = 300
UNSURE_DEG = 12
"""A guessed pitch that may be farther off is not taken."""


class ProgramError(Exception):
    """What went wrong, in a sentence for people."""


@dataclass(frozen=True)
class Lamp:
    """A compact light far away."""

    direction: tuple[float, float, float]
    """Unit vector towards it in the camera's frame: +X right, +Y up, -Z the view."""
    irradiance: tuple[float, float, float]
    """RGB on a surface that faces it; radiance 1 is the photo's white."""
    angular_radius_rad: float


@dataclass(frozen=True)
class PhotoLight:
    """The light of a photo."""

    photo: Path
    width: int
    height: int
    vertical_fov_rad: float
    environment: Path
    """Latlong .exr turned for Blender, without the lamps."""
    lamps: tuple[Lamp, ...]
    pitch_rad: float | None = None
    """How far the photo's camera looked up, by its file or as guessed from the picture."""


def estimated(photo, command="", progress=lambda step: None):
    """The light of a photo; its files stay in a new temporary folder.

    Raises:
        ProgramError: the program is missing, or says what is wrong with the photo.
    """
    program = command or shutil.which("deeplight")
    if not program:
        raise ProgramError(f"The program deeplight was not found: {INSTALL}")
    if not Path(photo).is_file():
        raise ProgramError(f"There is no photo {photo}")
    folder = Path(tempfile.mkdtemp(prefix="deeplight-"))
    progress(1)
    run(program, "estimate", photo, "--out", folder)
    found = folder / f"{Path(photo).stem}.json"
    apart = folder / "blender.json"
    progress(2)
    run(program, "convert", found, "--out", apart, "--for", "blender", "--lamps-apart")
    return read(Path(photo), json.loads(found.read_text("utf-8")), apart)


def read(photo, record, apart):
    """From the two files that the program wrote."""
    lamps = json.loads(apart.read_text("utf-8"))["lamps"]
    return PhotoLight(
        photo=photo,
        width=record["photo"]["width"],
        height=record["photo"]["height"],
        vertical_fov_rad=math.radians(record["framing"]["vertical_fov_deg"]),
        environment=apart.with_suffix(".exr"),
        lamps=tuple(
            Lamp(tuple(lamp["direction"]), tuple(lamp["irradiance"]), lamp["angular_radius_rad"])
            for lamp in lamps["lamps"]
        ),
        pitch_rad=pitch_of(record),
    )


def pitch_of(record):
    """None where the file says nothing, or a guess is as good as none."""
    tilt = record.get("camera_tilt")
    if tilt is None or tilt["scale_deg"] > UNSURE_DEG:
        return None
    return math.radians(tilt["pitch_deg"])


def run(program, *arguments):
    """Run it outside Blender's own Python."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONHOME"}
    try:
        subprocess.run(
            [str(program), *map(str, arguments)],
            env=environment,
            check=True,
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
        )
    except OSError as error:
        raise ProgramError(f"The program {program} does not start ({error}): {INSTALL}") from error
    except subprocess.TimeoutExpired as error:
        raise ProgramError(f"deeplight took longer than {LONGEST_S} seconds") from error
    except subprocess.CalledProcessError as error:
        said = (error.stderr or error.stdout).strip()
        raise ProgramError(said or f"deeplight ended with {error.returncode}") from error
