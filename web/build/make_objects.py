"""Make the page's built-in objects: web/public/objects, each small enough for a phone.

python web/build/make_objects.py

About half a minute for each. The shapes are our own, coarser than `deeplight compose` takes them.
"""

import json
from pathlib import Path

from deeplight.compose import shapes
from deeplight.compose.mesh import Mesh
from deeplight.compose.pot import pot
from deeplight.transfer.file import write
from deeplight.transfer.precompute import TransferSettings, precompute

FOLDER = Path(__file__).parents[1] / "public" / "objects"
LARGEST_BYTES = 400_000
OBJECTS = {
    "bunny": ("Bunny", shapes.bunny, 40),
    "pot": ("Teapot", pot, 52),
    "sphere": ("Ball", shapes.ball, 26),
}


def main() -> None:
    index = []
    for name, (title, shape, cells) in OBJECTS.items():
        path = FOLDER / f"{name}.transfer"
        transfer, _ = precompute(
            [Mesh(*shape(cells))], TransferSettings(samples=1024, longest_edge=0.1)
        )
        write(path, transfer)
        if path.stat().st_size > LARGEST_BYTES:
            raise SystemExit(f"{path} has {path.stat().st_size:,} bytes: take fewer cells")
        index.append({"name": name, "title": title, "file": path.name})
        print(f"{path.name}: {len(transfer.vertices):,} vertices, {path.stat().st_size:,} bytes")
    (FOLDER / "index.json").write_text(json.dumps(index, indent=2) + "\n")


if __name__ == "__main__":
    main()
