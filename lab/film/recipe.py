"""What to film: the settings of a film set, and the troubles a film can have."""

from dataclasses import dataclass

from deeplight.errors import ConfigError
from deeplight.simulate.phone import PHONES

TROUBLES = {
    "low_texture": "the place has no fine texture",
    "dark": "two and a half stops too dark, noisy, a long shutter",
    "over_exposed": "more than a stop too bright, highlights blown",
    "partly_out": "the outer sphere hangs partly out of the frame",
    "hand": "a finger covers part of a sphere for part of the clip",
    "dropped_frames": "frames are missing, and so are their times",
    "variable_rate": "frames come at uneven times",
    "hlg10": "10-bit HLG in BT.2020, HEVC",
    "landscape": "phone and rig held sideways: a wide upright frame with the spheres at its side",
    "rotated": "stored with another turn than phones store portrait with",
    "blur": "hectic movement at a long shutter",
    "still": "the camera hardly moves, so that nothing distinguishes the rig from the place",
}
SPLITS = ("any", "train", "val", "test")


@dataclass(frozen=True)
class FilmRecipe:
    """What decides every byte of a set of simulated films.

    Attributes:
        clips: how many.
        seconds: of each clip.
        rate: frames a second.
        size: width of the upright portrait frame in pixels; the height is 16 / 9 of it.
        troubles: given to all clips but the first third, one or two each in turn: low_texture,
            dark, over_exposed, partly_out, hand, dropped_frames, variable_rate, hlg10,
            landscape, rotated, blur, still; or all.
        split: film in places of this split only: "train", "val", "test" or "any".
        phone: camera preset.
        vary_rig: draw order, distance and tilt of the spheres; else the paper's rig.
        tag: print an AprilTag on the rig's bar.
        truth_every: frames from one true lighting to the next.
        seed: another seed films other clips.
    """

    clips: int = 24
    seconds: float = 3.0
    rate: float = 30.0
    size: int = 1080
    troubles: tuple[str, ...] = ()
    split: str = "any"
    phone: str = "paper"
    vary_rig: bool = True
    tag: bool = False
    truth_every: int = 10
    seed: int = 0

    def __post_init__(self) -> None:
        least = {"clips": 1, "rate": 1.0, "size": 64, "truth_every": 1, "seed": 0}
        for name, limit in least.items():
            if not getattr(self, name) >= limit:
                got = f"{getattr(self, name)}"
                raise ConfigError(f"film.{name} of at least {limit}", got, "correct it")
        if not 0 < self.seconds <= 600 or self.size > 2160 or self.size % 2 or self.rate > 240:
            got = f"{self.seconds:g} s of {self.size} pixels at {self.rate:g} frames a second"
            expected = "clips of up to 600 s, an even width up to 2160 and a rate up to 240"
            raise ConfigError(expected, got, "correct it")
        unknown = [t for t in self.troubles if t not in (*TROUBLES, "all")]
        if unknown:
            known = ", ".join((*TROUBLES, "all"))
            raise ConfigError(f"film.troubles of {known}", unknown[0], "choose of these")
        if self.split not in SPLITS or self.phone not in PHONES:
            expected = f"a split of {', '.join(SPLITS)} and a phone of {', '.join(PHONES)}"
            raise ConfigError(expected, f"{self.split}, {self.phone}", "choose of these")

    @property
    def height(self) -> int:
        """Of the upright portrait frame, even."""
        return 2 * round(self.size * 8 / 9)

    @property
    def frames(self) -> int:
        """Of each clip."""
        return max(1, round(self.seconds * self.rate))

    def troubles_of(self, clip: int) -> tuple[str, ...]:
        """What is wrong with a clip: nothing in the first third, then each in turn, then pairs."""
        chosen = tuple(TROUBLES) if "all" in self.troubles else self.troubles
        number = clip - -(-self.clips // 3)
        if number < 0 or not chosen:
            return ()
        first = chosen[number % len(chosen)]
        lap = number // len(chosen)
        second = chosen[(number + 4 + lap) % len(chosen)]
        return tuple(dict.fromkeys((first, second) if lap else (first,)))
