"""Mitsuba 3 and which of its variants works on this machine."""

import subprocess
import sys
from functools import lru_cache
from typing import Any

from deeplight.errors import ConfigError, MissingExtraError

ENGINES = {"llvm": "llvm_ad_rgb", "scalar": "scalar_rgb"}
_PROBE_TIMEOUT_S = 60


def mitsuba(engine: str = "auto") -> Any:
    """Give Mitsuba with its variant chosen.

    Args:
        engine: "llvm" (compiled; worth it for long work), "scalar" (needs nothing), or "auto":
            LLVM where it works.

    Raises:
        ConfigError: another engine, or one that does not work here; Mitsuba is installed and a
            library of the system that it needs is not.
        MissingExtraError: Mitsuba is not installed.
    """
    try:
        import mitsuba as mi
    except ModuleNotFoundError as error:
        raise MissingExtraError("render", "rendering") from error
    except (ImportError, NameError) as error:  # a NameError follows where Dr.Jit could not load
        got = f"Mitsuba that does not load: {error.__context__ or error}"
        do = "install that library (libatomic1, say, in Debian)"
        raise ConfigError("every library that Mitsuba needs", got, do) from error
    if engine not in (*ENGINES, "auto"):
        raise ConfigError(f"an engine of auto, {', '.join(ENGINES)}", engine, "choose one of these")
    if engine == "auto":
        engine = "llvm" if llvm_works() else "scalar"
    elif engine == "llvm" and not llvm_works():
        got = "an LLVM that is missing or older than 16"
        raise ConfigError("a working LLVM library for --engine llvm", got, "use --engine scalar")
    if mi.variant() != ENGINES[engine]:
        mi.set_variant(ENGINES[engine])
    mi.set_log_level(mi.LogLevel.Error)
    return mi


@lru_cache(maxsize=1)
def llvm_works() -> bool:
    """Render a little scene with the LLVM variant in a child process, once per run.

    With LLVM 14 or 15 loading succeeds and compiling a scene aborts the whole process, so only
    a process of its own can find out.
    """
    probe = [sys.executable, "-c", "from deeplight.compose.mitsuba_variant import probe; probe()"]
    try:
        done = subprocess.run(probe, capture_output=True, timeout=_PROBE_TIMEOUT_S, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


def probe() -> None:
    """Render what aborts on an unfit LLVM: an environment on rough and polished surfaces."""
    import mitsuba as mi
    import numpy as np

    mi.set_variant(ENGINES["llvm"])
    light = {"type": "envmap", "bitmap": mi.Bitmap(np.ones((8, 16, 3), np.float32))}
    film = {"type": "hdrfilm", "width": 4, "height": 4}
    balls = {
        name: {"type": "sphere", "center": [x, 0, 5], "bsdf": {"type": name}}
        for x, name in ((-1, "diffuse"), (0, "roughconductor"), (1, "principled"))
    }
    sensor = {"type": "perspective", "film": film}
    scene = {"type": "scene", "integrator": {"type": "path"}, "sensor": sensor, **balls}
    scene["light"] = light
    image = np.array(mi.render(mi.load_dict(scene), spp=1))
    if not np.isfinite(image).all():
        raise SystemExit(1)
