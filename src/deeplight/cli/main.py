"""The `deeplight` command: find the verb, run it, turn errors into exit codes.

Exit code 0: done. 2: bad input, one line on stderr. 1: a bug, with its traceback. 130: interrupted.
"""

import contextlib
import importlib
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version
from io import StringIO
from types import ModuleType

from deeplight.cli.stopping import Stopped, stopping
from deeplight.errors import InputError, MissingExtraError

VERBS = {
    "estimate": "photos or a video in, HDR light out: .exr, .json and a preview",
    "fuse": "a panning clip or several photos in, one light out, sharp where one looked",
    "compose": "put objects into a photo, lit by its own light",
    "simulate": "film the three spheres in HDR panoramas: a data set",
    "reflectance": "light-stage photographs of the spheres in, their reflectance bases out",
    "fetch": "fetch CC0 panoramas from Poly Haven to film in",
    "capture": "clips of the filmed spheres in: a data set, and a report for each clip",
    "train": "train the network on a data set",
    "calibrate": "your own clips of the spheres in: the model, brought to your phone",
    "transfer": "radiance transfer of an object, for shading it in real time",
    "convert": "light in any format and mapping, for any tool, edited on the way",
    "demo": "the live page: camera or photo in, its light out, in the browser",
    "export": "a trained network as ONNX or TFLite, in fewer bits if wanted",
    "benchmark": "how fast models run here, by runtime and threads",
    "evaluate": "measure an estimator on a data set, next to trivial baselines",
    "probe": "exposures of a mirror ball or panorama in, the true HDR light out",
    "study": "ask people which pictures look right, and rank methods by their answers",
}
"""Verb -> help line. Only the module of the verb asked for, `deeplight.cli.<verb>`, is loaded."""

RENAMED = {"panoramas": "fetch", "render": "transfer"}
"""Verbs of earlier versions -> what they are called now."""

EXTRA_OF = {
    "DracoPy": "render",
    "ai_edge_litert": "litert",
    "ai_edge_quantizer": "tflite",
    "av": "capture",
    "cv2": "capture",
    "embreex": "render",
    "fsspec": "train",
    "jinja2": "capture",
    "lightning_fabric": "train",
    "litert_torch": "tflite",
    "matplotlib": "train",
    "mitsuba": "render",
    "onnx": "export",
    "onnxscript": "train",
    "pillow_heif": "heic",
    "astral": "sun",
    "pxr": "usd",
    "pygeomag": "sun",
    "rawpy": "raw",
    "ray": "cluster",
    "safetensors": "train",
    "scipy": "render",
    "tensorboard": "train",
    "torch": "train",
    "trimesh": "render",
}
"""Optional package -> the extra that installs it."""

BAD_INPUT = 2
INTERRUPTED = 128 + 2  # what a shell reports for SIGINT
BROKEN_PIPE = 128 + 13  # and for SIGPIPE


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and give its exit code; a bug leaves as the exception it is."""
    words = list(sys.argv[1:] if argv is None else argv)
    if not words:
        return _complain("deeplight", f"expected a verb: {', '.join(VERBS)}; see deeplight --help")
    verb = words[0]
    if verb in ("-h", "--help"):
        sys.stdout.write(_help())
        return 0
    if verb in ("-V", "--version"):
        sys.stdout.write(f"deeplight {version('deeplight')}\n")
        return 0
    if verb not in VERBS:
        return _complain("deeplight", f"'{verb}' is no verb; {_suggestion(verb)}")
    return run_command(f"deeplight {verb}", f"deeplight.cli.{verb}", words[1:])


def run_command(program: str, module: str | ModuleType, words: list[str]) -> int:
    """Run a module with `Args` and `run(args)` as a command, and give its exit code.

    Args:
        program: what the user typed, for messages.
        module: the module, or its name, which is imported where errors become exit codes.
        words: the arguments.
    """
    try:
        if isinstance(module, str):
            module = importlib.import_module(module)
        with stopping():
            module.run(_parse(module, program, words))
        sys.stdout.flush()  # a reader that has gone away shows here at the latest
    except BrokenPipeError:
        # Python flushes once more at exit and would complain then.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except KeyboardInterrupt:
        _complain(program, "interrupted")
        return INTERRUPTED
    except Stopped as stopped:
        _complain(program, f"ended by {stopped}")
        return 128 + stopped.number
    except InputError as error:
        return _complain(program, str(error))
    except OSError as error:
        return _complain(program, describe_os_error(error))
    except ModuleNotFoundError as error:
        extra = EXTRA_OF.get((error.name or "").partition(".")[0])
        if extra is None:
            raise
        return _complain(program, str(MissingExtraError(extra, f"`{program}`")))
    return 0


def _parse(module: ModuleType, program: str, words: list[str]) -> object:
    """Turn the words into the verb's `Args`; a wrong flag or --help leaves by SystemExit."""
    import tyro  # here, since `deeplight --help` does not need it

    said = StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(module.Args, args=words, prog=program, description=module.__doc__)
    except SystemExit as leaving:
        if leaving.code:
            _complain(program, f"{_gist(said.getvalue())}; see {program} --help")
        raise


def _gist(box: str) -> str:
    """What the box that tyro draws around a complaint says, without the help texts in it."""
    inside = [line.strip("│")[1:].rstrip() for line in box.splitlines() if line.startswith("│")]
    kept = [line for line in inside if not line.startswith((" " * 8, "─"))]
    end = next((n for n, line in enumerate(kept) if "helptext" in line), len(kept))
    return " ".join(" ".join(kept[:end]).split()).rstrip(".") or box


def describe_os_error(error: OSError) -> str:
    """Say an operating system's error without its number."""
    if error.strerror is None:
        return str(error)
    names = " -> ".join(str(name) for name in (error.filename, error.filename2) if name is not None)
    return f"{names}: {error.strerror}" if names else error.strerror


def complaint(program: str, error: InputError | OSError) -> str:
    """One line of what cannot be used, for a verb that goes on with the rest."""
    message = describe_os_error(error) if isinstance(error, OSError) else str(error)
    return f"{program}: {' '.join(message.split())}"


def _complain(program: str, message: str) -> int:
    sys.stderr.write(f"{program}: {' '.join(message.split())}\n")
    return BAD_INPUT


def _suggestion(word: str) -> str:
    import difflib

    if word in RENAMED:
        return f"it is '{RENAMED[word]}' now"
    near = difflib.get_close_matches(word.lower(), VERBS, n=1)
    return f"did you mean '{near[0]}'?" if near else f"one of: {', '.join(VERBS)}"


def _help() -> str:
    verbs = "\n".join(f"  {verb:<10} {text}" for verb, text in VERBS.items())
    return f"""usage: deeplight VERB ...

HDR lighting from one photo.

verbs:
{verbs}

options:
  -h, --help     show this
  -V, --version  show the version

`deeplight VERB --help` shows a verb's options, with an example:
  deeplight estimate photo.jpg --out out
"""
