"""How fast the pieces between a photo and its light are: `python benchmarks/nouns.py`.

Prints milliseconds on this machine, each the best of three, so that a busy machine does not count.
"""

import time
from collections.abc import Callable

import numpy as np

from deeplight import harmonics, reflectance
from deeplight.frames import world_from_camera
from deeplight.lighting import Lighting
from deeplight.mappings import resample
from deeplight.relight import relight_rig
from deeplight.sphere import PAPER_RIG, SPHERES

TURN = world_from_camera(0.5, -0.3, 0.1)


def milliseconds(work: Callable[[], object]) -> float:
    """Give the least time of three."""
    times = []
    for _ in range(3):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def build(name: str) -> reflectance.ReflectanceBasis:
    reflectance._basis.cache_clear()  # analytic_basis keeps what it has built
    return reflectance.analytic_basis(name, PAPER_RIG.views[name])


def main() -> None:
    rng = np.random.default_rng(0)
    small, large = (rng.random((h, 2 * h, 3), np.float32) for h in (512, 2048))
    lighting = Lighting.from_latlong(small)
    relight_rig(PAPER_RIG, lighting)
    works: dict[str, Callable[[], object]] = {
        "panorama 512 x 1024 -> ball 32": lambda: Lighting.from_latlong(small, TURN),
        "panorama 512 x 1024 -> ball 128": lambda: Lighting.from_latlong(small, TURN, 128),
        "panorama 2048 x 4096 -> ball 32": lambda: Lighting.from_latlong(large, TURN),
        "panorama 2048 x 4096 -> 256 x 512": lambda: resample.shrink_latlong(large, 256),
        "ball 32 -> latlong 256 x 512": lighting.latlong,
        "ball 32 -> cube 128": lighting.cube,
        "ball 32 turned": lambda: lighting.rotated(TURN),
        "three spheres relit": lambda: relight_rig(PAPER_RIG, lighting),
        "harmonics": lambda: harmonics.spherical_harmonics(lighting),
        "dominant light": lambda: harmonics.dominant_light(lighting),
        **{f"basis of {name}": lambda name=name: build(name) for name in SPHERES},
    }
    for name, work in works.items():
        print(f"{milliseconds(work):9.1f} ms  {name}")


if __name__ == "__main__":
    main()
