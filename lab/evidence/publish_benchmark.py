"""Write the checksums of a benchmark of `deeplight.evaluate.benchmark`, once, when it is new.

python -m lab.evidence.publish_benchmark v1 HDRI
"""

import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

from deeplight.evaluate.benchmark import RECIPES, Published, make, pixels_sha256, published_path
from deeplight.simulate.panorama import places_in


def published(name: str, hdri: Path) -> Published:
    """Film the recipe in a temporary folder and gather its checksums."""
    recipe = RECIPES[name]
    with tempfile.TemporaryDirectory() as folder:
        manifest = make(hdri, Path(folder), recipe, workers=1)
        shards = {r.file: r.sha256 for records in manifest.splits.values() for r in records}
    films = {place.path for place in places_in(hdri) if place.split in ("val", "test")}
    return Published(
        asdict(recipe), {path.name: pixels_sha256(path) for path in sorted(films)}, shards
    )


if __name__ == "__main__":
    found = published(sys.argv[1], Path(sys.argv[2]))
    path = published_path(sys.argv[1])
    path.write_text(found.to_json(), encoding="utf-8")
    print(f"{len(found.shards)} shards of {len(found.panoramas)} panoramas: {path}")
