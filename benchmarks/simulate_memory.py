"""Does memory grow with the number of panoramas? Peak memory and speed, two folders, one process.

python benchmarks/simulate_memory.py FOLDER_OF_PANORAMAS

Films 1 take in each of 4 and then of 24 panoramas, each in a fresh process.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

CHILD = """
import json, resource, sys, time
from pathlib import Path
from deeplight.jobs import Engine
from deeplight.simulate.run import Recipe, plan, simulate
recipe = Recipe(train_takes=1, eval_takes=0, seen_takes=0, frames=4)
shards, simulation = plan(Path(sys.argv[1]), Path(sys.argv[2]), recipe)
start = time.perf_counter()
manifest = simulate(shards, simulation, Engine(workers=1))
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps([manifest.examples("train"), time.perf_counter() - start, peak]))
"""


def film(panoramas: list[Path], scratch: Path) -> tuple[int, float, float]:
    """Examples, seconds and peak MiB of filming these panoramas in one process."""
    folder = scratch / f"{len(panoramas)}"
    folder.mkdir()
    rows = ["file,split,place,scene"]
    for path in panoramas:
        shutil.copy(path, folder)
        rows.append(f"{path.name},train,{path.stem},outdoor")
    (folder / "manifest.csv").write_text("\n".join(rows))
    command = [sys.executable, "-c", CHILD, str(folder), str(folder / "data")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    examples, seconds, peak = json.loads(done.stdout)
    return examples, seconds, peak


def main(folder: str) -> None:
    everything = sorted(Path(folder).glob("*.exr"))
    with tempfile.TemporaryDirectory() as scratch:
        for count in (4, 24):
            examples, seconds, peak = film(everything[:count], Path(scratch))
            print(f"{count} panoramas: {examples / seconds:.1f} images/s, peak {peak:.0f} MiB")


if __name__ == "__main__":
    main(sys.argv[1])
