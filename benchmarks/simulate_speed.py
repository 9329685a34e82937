"""How fast is recipe v2 filmed, next to v1? Both in one process, take about.

python benchmarks/simulate_speed.py FOLDER_OF_PANORAMAS [PANORAMAS]

Films 16 takes of 3 frames of each recipe in each panorama, as `deeplight simulate` does: reading
and preparing the panorama, filming, JPEG. Prints examples per second of processor time, which other
programs on the machine disturb less than the clock, and the ratio. Set OMP_NUM_THREADS=1.
"""

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from deeplight.dataset import Example, ShardJob
from deeplight.simulate.run import Recipe, Simulation, plan

TAKES, FRAMES = 16, 3


def simulation(folder: Path, phones: str, scratch: Path) -> Simulation:
    recipe = Recipe(train_takes=TAKES, eval_takes=0, seen_takes=0, frames=FRAMES, phones=phones)
    return plan(folder, scratch / phones, recipe)[1]


def examples(made: Simulation, phones: str, place: int) -> Iterator[Example]:
    """All takes in one panorama, in jobs of as many as that recipe films in a row."""
    visit = 4 if phones == "v1" else TAKES
    places = len(made.places["train"])
    for round_ in range(TAKES // visit):
        first = (round_ * places + place) * visit * FRAMES
        job = ShardJob("train", 1, first, visit * FRAMES)
        yield from (item for item in made.examples(job) if isinstance(item, Example))


def main(folder: str, panoramas: int) -> None:
    seconds, counts = {"v1": 0.0, "v2": 0.0}, {"v1": 0, "v2": 0}
    with tempfile.TemporaryDirectory() as scratch:
        made = {phones: simulation(Path(folder), phones, Path(scratch)) for phones in seconds}
        places = len(made["v1"].places["train"])
        chosen = [n * places // panoramas for n in range(panoramas)]
        for phones, one in made.items():
            next(examples(one, phones, chosen[0]))  # builds the spheres' bases
        for place in chosen:
            for phones, one in made.items():
                start = time.process_time()
                counts[phones] += len(list(examples(one, phones, place)))
                seconds[phones] += time.process_time() - start
    rates = {phones: counts[phones] / seconds[phones] for phones in seconds}
    for phones, rate in rates.items():
        print(f"{phones}: {rate:.0f} examples/s of one core ({counts[phones]} examples)")
    print(f"v2 over v1: {rates['v2'] / rates['v1']:.1f}")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 6)
