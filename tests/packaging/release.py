"""What `make release` made, tried where nothing else is: python release.py DIST PHOTOS.

Runs in an environment that has the wheel and what the wheel asks for; needs no test program.
"""

import json
import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import version
from pathlib import Path

import numpy as np

from deeplight import read_environment

SITE = "src/deeplight/demo/site/"


def main(dist: Path, photos: Path) -> None:
    """Stop at the first thing that is wrong."""
    release = version("deeplight")
    every_file_is_there(dist, release)
    the_wheel_is_run(photos)
    print(f"deeplight {release}: files, estimate, convert and page are as they should be")


def every_file_is_there(dist: Path, release: str) -> None:
    """Each with its page or its network inside, none with anything of this machine."""
    with tarfile.open(dist / f"deeplight-{release}.tar.gz") as sdist:
        names = {name.split("/", 1)[1] for name in sdist.getnames() if "/" in name}
    assert f"{SITE}index.html" in names, "the sdist has no page"
    assert f"{SITE}model/deeplight.onnx" not in names, "the sdist has the network twice"
    assert "src/deeplight/weights/deeplight.onnx" in names
    assert "blender/deeplight/blender_manifest.toml" in names
    assert not [name for name in names if "node_modules" in name]
    with tarfile.open(dist / f"deeplight-npm-{release}.tgz") as npm:
        names = set(npm.getnames())
    assert {"package/dist/index.js", "package/dist/index.d.ts", "package/LICENSE"} <= names
    assert "package/dist/deeplight.onnx" in names
    with zipfile.ZipFile(dist / "deeplight-blender.zip") as extension:
        assert f'version = "{release}"' in extension.read("blender_manifest.toml").decode()
    with zipfile.ZipFile(dist / f"deeplight-page-{release}.zip") as page:
        assert {"index.html", "service-worker.js", "model/deeplight.onnx"} <= set(page.namelist())


def the_wheel_is_run(photos: Path) -> None:
    """An estimate, a light for another tool, the page: as somebody who installed it would."""
    bin_ = Path(sys.executable).parent
    for arguments in (
        ["--version"],
        ["estimate", photos, "--out", "light"],
        ["convert", photos / "hall.jpg", "--out", "hall.glb"],
        ["demo", "--export", "page"],
    ):
        subprocess.run([bin_ / "deeplight", *map(str, arguments)], check=True)
    facts = json.loads(Path("light/hall.json").read_text())
    assert facts["lamps"]["lamps"], "no lamp in a hall full of them"
    radiance = read_environment(Path("light/hall.json")).radiance
    assert np.isfinite(radiance).all()
    assert radiance.max() > 5, "no light brighter than white in a hall full of lamps"
    assert Path("hall.glb").read_bytes()[:4] == b"glTF"
    assert Path("page/index.html").is_file()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
