"""The built page as files: which there are, what they are, and a copy of them for any web host."""

import hashlib
import html
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from urllib.parse import urlsplit

from deeplight.errors import ConfigError
from deeplight.estimators.onnx import shipped_model
from deeplight.io.atomic import replacing, results_folder

MODEL = "model/deeplight.onnx"
"""Where the page looks for the network; the installed package's own is given there."""

PAGE, WORKER = "index.html", "service-worker.js"

PICTURE = b'content="./icons/share.jpg"'
"""In the page: what is shown of a link to it."""

HASHED = "assets/"
"""Files in this folder have their content's hash in their names: they never change."""

TYPES = {
    ".bin": "application/octet-stream",
    ".css": "text/css; charset=utf-8",
    ".glb": "model/gltf-binary",
    ".gltf": "model/gltf+json",
    ".html": "text/html; charset=utf-8",
    ".ico": "image/x-icon",
    ".jpg": "image/jpeg",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".mjs": "text/javascript; charset=utf-8",
    ".onnx": "application/octet-stream",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
    ".wasm": "application/wasm",
    ".webmanifest": "application/manifest+json",
    ".webp": "image/webp",
}


@dataclass(frozen=True)
class Site:
    """The files of the page by their address, without the leading slash."""

    files: Mapping[str, Path]

    @classmethod
    def installed(cls, folder: Path | None = None) -> "Site":
        """The page that came with this installation; links in its folder are left out.

        Raises:
            ConfigError: it was not built.
        """
        folder = folder or Path(str(resources.files("deeplight") / "demo" / "site"))
        if not (folder / "index.html").is_file():
            do = "install a released wheel, or in a checkout run: make web"
            if "site-packages" in folder.parts:  # a copy of the checkout, made without the page
                do += " && pip install ."
            raise ConfigError("the built page", f"no {folder / 'index.html'}", do)
        files = {
            path.relative_to(folder).as_posix(): path
            for path in sorted(folder.rglob("*"))
            if path.is_file() and not path.is_symlink() and folder.resolve() in _parents(path)
        }
        return cls(MappingProxyType(files | {MODEL: shipped_model()}))

    def copied(self, to: Path, address: str | None = None) -> int:
        """Write the files into a folder for any web host; give how many.

        `address` is where that folder will be: links to the page show its picture only by a whole
        address.

        Raises:
            ConfigError: the folder has something in it already, or the address is none of a folder.
            OSError: it cannot be written.
        """
        if to.exists() and (not to.is_dir() or any(to.iterdir())):
            raise ConfigError("an empty or new folder", f"{to}", "name another, or empty it")
        changed = self._addressed(address) if address is not None else {}
        with results_folder(to):
            for name, path in self.files.items():
                with replacing(to / name) as temporary:
                    if name in changed:
                        temporary.write_bytes(changed[name])
                    else:
                        shutil.copyfile(path, temporary)
        return len(self.files)

    def _addressed(self, address: str) -> dict[str, bytes]:
        """The page with its picture's whole address, and the worker that knows the page's hash."""
        parts = urlsplit(address)
        if (
            parts.scheme not in ("http", "https")
            or not parts.netloc
            or parts.query
            or parts.fragment
        ):
            raise ConfigError("https://HOST/FOLDER/", address, "give the page's address")
        folder = html.escape(address.rstrip("/") + "/")
        old = self.files[PAGE].read_bytes()
        new = old.replace(PICTURE, PICTURE.replace(b"./", folder.encode()))
        before, after = (hashlib.sha256(page).hexdigest()[:16].encode() for page in (old, new))
        worker = self.files[WORKER].read_bytes() if WORKER in self.files else b""
        if new == old or before not in worker:
            raise ConfigError("a page with a picture", f"{self.files[PAGE]}", "build it: make web")
        return {PAGE: new, WORKER: worker.replace(before, after)}


def content_type(name: str) -> str:
    """What a file is; a browser is not to guess."""
    return TYPES.get(Path(name).suffix.lower(), "application/octet-stream")


def content_policy() -> str:
    """The Content-Security-Policy: nothing from elsewhere, no inline scripts, WASM allowed."""
    return (resources.files("deeplight") / "demo" / "policy.txt").read_text("utf-8").strip()


def tag_of(path: Path) -> str:
    """An entity tag: the same as long as the content is."""
    with path.open("rb") as file:
        return f'"{hashlib.file_digest(file, "sha256").hexdigest()[:24]}"'


def _parents(path: Path) -> list[Path]:
    """The real folders a file lies in: a linked folder leads out of the site."""
    return list(path.resolve().parents)
