"""How fast examples are read: `python benchmarks/dataset_reading.py DATA [--split train]`.

Prints examples per second for the whole example, for its pixels alone (what training reads) and
for opening the split, each the best of three, so that a busy machine does not count.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np

from deeplight.dataset import SplitIndex, open_dataset


def seconds(work: Callable[[], object]) -> float:
    """Give the least time of three."""
    times = []
    for _ in range(3):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data")
    parser.add_argument("--split", default="train")
    parser.add_argument("--count", type=int, default=1000)
    arguments = parser.parse_args()

    def open_index() -> SplitIndex:
        return open_dataset(arguments.data).index(arguments.split)

    index = open_index()
    order = np.random.default_rng(0).permutation(len(index))[: arguments.count].tolist()
    print(f"open {len(index)} examples: {1e3 * seconds(open_index):.1f} ms")
    for name, read in (
        ("members", index.members),
        ("pixels", index.pixels),
        ("whole", index.__getitem__),
    ):
        took = seconds(lambda read=read: [read(number) for number in order])  # type: ignore[misc]
        print(
            f"{name:8} {len(order) / took:8.0f} examples/s  {1e3 * took / len(order):.3f} ms each"
        )


if __name__ == "__main__":
    main()
