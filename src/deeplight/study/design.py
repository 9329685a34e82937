"""Make a study: one static folder that shows pairs of pictures, and the key to its codes.

    out/site/index.html     what people open; nothing in it names a method
    out/site/pictures/      every picture under a code, re-encoded without its metadata
    out/key.json            which code is which method and scene: keep it from the people asked

The page needs no server and can reach none: its content policy forbids every connection. It draws
its own random order for each person, and hands the answers to the person as a file.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import UInt8

from deeplight.errors import ConfigError, DataSetError
from deeplight.io.atomic import replacing
from deeplight.io.photos import encode_jpeg, photo_paths, read_photo
from deeplight.mappings.resample import shrink

KEY = "key.json"
SITE = "site"
VERSION = 1
JPEG_QUALITY = 95
LONGEST_PX = 1600
TEMPLATE = Path(__file__).with_name("page.html")
_PLACEHOLDER = "/*STUDY*/null"

PROMPTS = {
    "real": "In which picture does the object look more like a real part of the photo?",
    "reference": "Which picture looks more like the one at the top?",
}
CONSENT = """You will see pairs of pictures and choose one of each pair. It takes about {minutes} \
minutes. There are no right or wrong opinions, but please look at every pair.

Taking part is voluntary; you can stop at any moment by closing the page, and then nothing is kept.

The page sends nothing to anybody and stores nothing after it is closed. It keeps your choices, \
how long each took and whether the pictures stood side by side or one above the other, under a \
random number that is not connected with you. At the end you get them as a file, which you hand to \
whoever asked you."""

Picture = UInt8[np.ndarray, "height width 3"]


@dataclass(frozen=True)
class Sitting:
    """What one person is shown.

    Attributes:
        pairs: of two methods' pictures of one scene.
        catches: of a picture and a ruined copy of it: who looks chooses the whole one.
        identical: of twice the same picture: they measure a preference for one side.
    """

    pairs: int = 40
    catches: int = 6
    identical: int = 2

    def __post_init__(self) -> None:
        if self.pairs < 1 or min(self.catches, self.identical) < 0:
            raise ConfigError("at least 1 pair, and no negative number", f"{self}", "change it")

    @property
    def total(self) -> int:
        return self.pairs + self.catches + self.identical


@dataclass(frozen=True)
class Study:
    """What is asked, and about which pictures.

    Attributes:
        methods: folder of each method's pictures, by the name that reports call it; pictures of
            one scene have the same file name (whatever their ending) in every folder.
        question: "real" = which looks more real; "reference" = which is closer to the reference.
        reference: folder of reference pictures, for that question.
        session: what one person is shown.
        title, consent, contact: texts of the first page; left out, `CONSENT` and no address.
        seed: of the codes.
    """

    methods: Mapping[str, Path]
    question: Literal["real", "reference"] = "real"
    reference: Path | None = None
    session: Sitting = field(default_factory=Sitting)
    title: str = "Which picture?"
    consent: str = ""
    contact: str = ""
    seed: int = 0

    def __post_init__(self) -> None:
        if len(self.methods) < 2:
            got = f"{len(self.methods)}"
            raise ConfigError("at least two methods to compare", got, "give --method NAME=FOLDER")
        if (self.question == "reference") != (self.reference is not None):
            expected = "--reference FOLDER with --question reference, and only with it"
            raise ConfigError(expected, f"--question {self.question}", "give both or neither")


def named_folders(given: Sequence[str]) -> dict[str, Path]:
    """Folders by the name that stands before each: NAME=FOLDER.

    Raises:
        ConfigError: another form, or one name twice.
    """
    found: dict[str, Path] = {}
    for item in given:
        name, equals, folder = item.partition("=")
        if not (name and equals and folder):
            raise ConfigError("--method NAME=FOLDER", repr(item), "name the method")
        if name in found:
            raise ConfigError("methods of different names", f"{name} twice", "rename one")
        found[name] = Path(folder)
    return found


def make_study(study: Study, out: Path) -> dict[str, Any]:
    """Write the folder of a study and its key; give the key.

    Raises:
        DataSetError: a folder lacks a scene that another one has, or pictures differ in size.
        ConfigError: more pairs are wanted than there are, or `out` holds another study.
        ImageFileError, OSError: a picture cannot be read, or `out` cannot be written.
    """
    files = scenes_of(study)
    possible = len(files) * len(study.methods) * (len(study.methods) - 1) // 2
    if study.session.pairs > possible:
        got = f"{possible} of {len(files)} scenes and {len(study.methods)} methods"
        do = f"say --session.pairs {possible}, or give pictures of more scenes"
        raise ConfigError(f"{study.session.pairs} different pairs for each person", got, do)
    conditions = _codes("c", list(study.methods), study.seed)
    codes = _codes("s", list(files), study.seed + 1)
    identity = _identity(study, files)
    _check_vacant(out / KEY, identity)
    shown = [
        {"id": codes[scene], **_write_scene(out / SITE, study, conditions, by_method)}
        for scene, by_method in files.items()
    ]
    key = {
        "format": "deeplight-study-key",
        "version": VERSION,
        "study": identity,
        "question": study.question,
        "session": vars(study.session),
        "conditions": {code: name for name, code in conditions.items()},
        "scenes": {code: scene for scene, code in codes.items()},
    }
    _write_page(out / SITE / "index.html", _page_data(study, identity, conditions, shown))
    with replacing(out / KEY) as temporary:
        temporary.write_text(json.dumps(key, indent=1) + "\n", encoding="utf-8")
    return key


def scenes_of(study: Study) -> dict[str, dict[str, Path]]:
    """The picture of every scene by method; "" is the reference.

    Raises:
        DataSetError: a folder lacks a scene, or holds none.
    """
    folders = dict(study.methods) | ({"": study.reference} if study.reference else {})
    found = {name: _pictures_in(folder) for name, folder in folders.items()}
    scenes = sorted(set().union(*found.values()))
    for name, pictures in found.items():
        missing = [scene for scene in scenes if scene not in pictures]
        if missing:
            got = f"{len(missing)} missing, the first {missing[0]}"
            do = "add them, or take them out of the other folders"
            raise DataSetError(f"a picture of every scene in {folders[name]}", got, do)
    return {scene: {name: found[name][scene] for name in found} for scene in scenes}


def ruined(picture: Picture) -> Picture:
    """The picture in coarse blocks of wrong colours: nobody who looks prefers it."""
    height, width, _ = picture.shape
    rows = max(2, round(12 * height / max(height, width)))
    columns = max(2, round(12 * width / max(height, width)))
    blocks = 255 - shrink(picture, rows, columns)[..., [1, 2, 0]]
    result: Picture = shrink(blocks, height, width).round().astype(np.uint8)
    return result


def _pictures_in(folder: Path) -> dict[str, Path]:
    if not folder.is_dir():
        raise DataSetError(f"a folder of pictures at {folder}", "no such folder", "correct it")
    found: dict[str, Path] = {}
    for path in photo_paths([folder]):
        if path.stem in found:
            got = f"{found[path.stem].name} and {path.name} in {folder}"
            raise DataSetError("one picture of each scene", got, "remove one")
        found[path.stem] = path
    return found


def _codes(letter: str, names: Sequence[str], seed: int) -> dict[str, str]:
    """A code for each name, whose order says nothing."""
    order = np.random.default_rng(seed).permutation(len(names))
    return {name: f"{letter}{place + 1}" for name, place in zip(names, order, strict=True)}


def _check_vacant(path: Path, identity: str) -> None:
    """Answers to another study would lose their key."""
    if path.is_file() and identity not in path.read_text(encoding="utf-8"):
        raise ConfigError(f"no other study in {path.parent}", "one", "choose another folder")


def _identity(study: Study, files: Mapping[str, Mapping[str, Path]]) -> str:
    """A name of the study, so that answers to another one are noticed."""
    digest = hashlib.sha256(f"{study.question} {study.seed} {study.session}".encode())
    for scene, by_method in files.items():
        for name, path in by_method.items():
            digest.update(f"{scene} {name} ".encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def _write_scene(
    site: Path, study: Study, conditions: Mapping[str, str], files: Mapping[str, Path]
) -> dict[str, Any]:
    pictures = {name: _fitting(read_photo(path).pixels) for name, path in files.items()}
    sizes = {picture.shape[:2] for picture in pictures.values()}
    if len(sizes) > 1:
        got = ", ".join(f"{width} x {height}" for height, width in sorted(sizes))
        first = next(iter(files.values())).stem
        raise DataSetError(f"pictures of {first} of one size", got, "render them alike")
    written = {name: _write_picture(site, picture) for name, picture in pictures.items()}
    whole = min(conditions, key=lambda name: conditions[name])
    shown: dict[str, Any] = {
        "pictures": {conditions[name]: file for name, file in written.items() if name},
        "whole": conditions[whole],
        "ruined": _write_picture(site, ruined(pictures[whole])),
    }
    if study.reference is not None:
        shown["reference"] = written[""]
    return shown


def _fitting(picture: Picture) -> Picture:
    """No larger than screens show; nobody waits for 12 megapixels 80 times."""
    height, width, _ = picture.shape
    scale = LONGEST_PX / max(height, width)
    if scale >= 1:
        return picture
    smaller: Picture = shrink(picture, round(height * scale), round(width * scale))
    return smaller.round().astype(np.uint8)


def _write_picture(site: Path, picture: Picture) -> str:
    """Write it under a name made of its content, which names no method; give the address."""
    content = encode_jpeg(np.ascontiguousarray(picture), JPEG_QUALITY)
    address = f"pictures/{hashlib.sha256(content).hexdigest()[:20]}.jpg"
    with replacing(site / address) as temporary:
        temporary.write_bytes(content)
    return address


def _page_data(
    study: Study, identity: str, conditions: Mapping[str, str], scenes: list[dict[str, Any]]
) -> dict[str, Any]:
    minutes = max(1, round(study.session.total * 8 / 60))
    return {
        "study": identity,
        "version": VERSION,
        "title": study.title,
        "prompt": PROMPTS[study.question],
        "consent": list(_paragraphs(study.consent or CONSENT.format(minutes=minutes))),
        "contact": study.contact,
        "conditions": sorted(conditions.values()),
        "scenes": sorted(scenes, key=lambda scene: str(scene["id"])),
        "session": vars(study.session),
    }


def _paragraphs(text: str) -> Iterator[str]:
    return (" ".join(part.split()) for part in text.split("\n\n") if part.strip())


def _write_page(path: Path, data: Mapping[str, Any]) -> None:
    # "</script>" in a text would end the script, so no "<" is left in it.
    inside = json.dumps(data, ensure_ascii=True).replace("<", "\\u003c")
    page = TEMPLATE.read_text(encoding="utf-8").replace(_PLACEHOLDER, inside)
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
