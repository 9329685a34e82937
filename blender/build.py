"""Pack the Blender extension: python blender/build.py [FOLDER] writes deeplight-blender.zip."""

import sys
import zipfile
from pathlib import Path

SOURCE = Path(__file__).resolve().parent / "deeplight"


def build(folder: Path) -> Path:
    """The extension as one file that Blender installs, the same bytes each time."""
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / "deeplight-blender.zip"
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(SOURCE.iterdir()):
            if path.suffix in (".py", ".toml"):
                archive.writestr(zipfile.ZipInfo(path.name), path.read_bytes())
    return target


if __name__ == "__main__":
    print(build(Path(sys.argv[1] if len(sys.argv) > 1 else "dist")))
