"""A made-up built page for tests of the demo."""

from pathlib import Path

SECRET = b"not for you"
FILES = {
    "index.html": b"<!doctype html><title>DeepLight</title>",
    "assets/page-1a2b.js": b"export {};",
    "runtime/ort.wasm": b"\0asm\1\0\0\0",
    "with space.txt": b"space",
}


def write_site(folder: Path) -> Path:
    """Write a built page into `folder`, with a secret next to it and links that lead there."""
    site = folder / "site"
    for name, content in FILES.items():
        (site / name).parent.mkdir(parents=True, exist_ok=True)
        (site / name).write_bytes(content)
    (folder / "secret.txt").write_bytes(SECRET)
    (folder / "outside").mkdir()
    (folder / "outside/secret.txt").write_bytes(SECRET)
    (site / "link.txt").symlink_to(folder / "secret.txt")
    (site / "linked").symlink_to(folder / "outside")
    return site
