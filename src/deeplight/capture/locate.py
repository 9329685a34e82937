"""Where the three spheres of a clip are (section 3.1): by what stays while the world moves.

The rig is rigid and held in front of the phone, so one place per sphere serves the whole clip.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from deeplight.camera import PinholeCamera
from deeplight.capture import overlay
from deeplight.capture.candidates import completed, find_candidates, triples
from deeplight.capture.conic import Cone, ellipse
from deeplight.capture.located import (
    Located,
    LocateSettings,
    NotLocated,
    TagRig,
    cones_of,
    moved_together,
    rig_of,
)
from deeplight.capture.materials import name_spheres
from deeplight.capture.motion import WORKING_SIDE, Evidence, Sample, evidence, gather
from deeplight.capture.refine import SphereOutline, refine, refine_place
from deeplight.capture.sizes import alike_sizes, even_sizes, mirror_of_size
from deeplight.capture.tag import cones_next_to_tag, tag_corners
from deeplight.io.video import VideoFrame
from deeplight.sphere import SPHERES

__all__ = ["LocateSettings", "Located", "NotLocated", "TagRig", "locate"]

LEAST_FRAMES = 8  # fewer do not show what stays from what moves
LEAST_TRAVEL = 0.02  # of the picture's shorter side, that the world must move by in the clip
_LEAST_SCORE = 0.3  # of three circles together (`triples`)
_LEAST_SUPPORT = 0.2  # share of the outline that the frames must show to be there
_FULL_SUPPORT = 0.35  # the same where less speaks for a sphere: no motion, or a place on the bar
_TOGETHER = {_LEAST_SUPPORT: 0.4, _FULL_SUPPORT: 0.5}  # will do as well; noise comes to 0.3
_ERROR_FOR_SUPPORT = 0.22  # the fainter the outlines, the better the light must explain the spheres
_UNCLEAR = 0.5  # support below which a person should look
_LEAST_SEEN = 0.5  # share of the outline that must lie inside the picture
_LEAST_CONFIDENCE = 0.9  # in the names
_LARGEST_ERROR = 0.16  # of pixel values, with which the mirror explains the others
_CLEAR_SUPPORT = 0.5  # of all three outlines in a moving world: what is no sphere comes to 0.21
_ERROR_OF_CLEAR = 0.25  # of those: bright paint, or a lamp in whose shadow one of them lies
_NAMING_FRAMES = 6
_STIFFNESS = 0.08  # of the sizes that a tag gives; see `Size`
_SAVED_SHIFT = 0.25  # how far, in radii, a saved rig's sphere may have moved

_CUT_OFF = "a sphere less than half in the picture"
_EXPECTED = "a mirror, a matte silver and a diffuse sphere that stay in the frame"


@dataclass(frozen=True, eq=False)
class _Clip:
    """A clip being looked at."""

    sample: Sample
    camera: PinholeCamera
    how: LocateSettings

    def failed(
        self, got: str, do: str, seen: Evidence | None = None, cones: list[Cone] | None = None
    ) -> NotLocated:
        frame = self.sample.stills[len(self.sample.stills) // 2].rgb()
        strength = None if seen is None else seen.strength
        picture = overlay.failed_picture(frame, strength, cones or [], self.camera, got)
        return NotLocated(_EXPECTED, got, do, picture)


def locate(
    stills: Iterable[VideoFrame], camera: PinholeCamera, how: LocateSettings | None = None
) -> Located:
    """Find and name the three spheres of a clip; reads `stills` once, in bounded memory.

    Args:
        stills: every frame of the clip, in order.
        camera: of the upright full frame.
        how: settings; the defaults look for spheres of 8 cm in any place.

    Raises:
        NotLocated: not sure of all three; its `overlay` shows what was seen.
    """
    sample = gather(stills)
    if not sample.stills:
        raise NotLocated(_EXPECTED, "a clip without frames", "give another clip")
    height, width = sample.stills[0].luma.shape
    if (height, width) != (camera.height, camera.width):
        camera = PinholeCamera(width, height, camera.vertical_fov_rad)
    clip = _Clip(sample, camera, how or LocateSettings())
    if isinstance(clip.how.rig, TagRig):
        return _by_tag(clip, clip.how.rig)
    if clip.how.rig is not None:
        return _by_saved_rig(clip, cones_of(clip.how.rig))
    return _by_flow(clip)


def _by_flow(clip: _Clip) -> Located:
    sample, camera = clip.sample, clip.camera
    if sample.count < LEAST_FRAMES:
        raise clip.failed(f"only {sample.count} frames", "give a longer clip, or a rig file")
    seen = evidence(sample)
    working = sample.working_camera(camera)
    found = find_candidates(seen, working)
    options = [
        [candidate.cone for candidate in three]
        for score, three in triples(found)[:3]
        if score > _LEAST_SCORE
    ]
    circles = [candidate.cone for candidate in found]
    reason = f"{len(found)} still circles but no three alike"
    still = seen.travel_px < LEAST_TRAVEL * WORKING_SIDE
    if still:
        reason = "a camera that hardly moves"
    for i, three in enumerate(options + completed(found, working)):
        doubtful = still or i >= len(options)
        outcome = _checked(clip, three, _FULL_SUPPORT if doubtful else _LEAST_SUPPORT)
        if isinstance(outcome, Located):
            return outcome
        if i == 0 and options and not still:
            reason, circles = outcome, three
    raise clip.failed(
        reason, "look at the overlay; give a rig file if they are there", seen, circles
    )


def _checked(clip: _Clip, cones: list[Cone], least_support: float) -> Located | str:
    """The spheres near three circles, or why those are not the rig."""
    frames = [still.luma for still in clip.sample.stills]
    outlines = [refine(cone, frames, clip.camera) for cone in cones]
    if min(outline.seen for outline in outlines) < _LEAST_SEEN:
        return _CUT_OFF
    colour = _colour_frames(clip)
    naming = name_spheres([outline.cone for outline in outlines], colour, clip.camera)
    clear = min(o.support for o in outlines) > _CLEAR_SUPPORT and least_support == _LEAST_SUPPORT
    if naming.error > (_ERROR_OF_CLEAR if clear else _LARGEST_ERROR):
        return f"three circles that do not light each other (error {naming.error:.2f})"
    if naming.confidence < _LEAST_CONFIDENCE:
        return f"three spheres, but not which is which (sure to {naming.confidence:.0%})"
    named = dict(zip(naming.names, outlines, strict=True))
    named = alike_sizes(named, frames, clip.camera)
    start = cones[naming.names.index("mirror")]
    named["mirror"], warnings = even_sizes(named, start, frames, clip.camera)
    fault = _fault(list(named.values()), least_support)
    # Not the mirror's outline: by its sides something is found in any world.
    rough = [named[name] for name in SPHERES if name != "mirror"]
    faintest = min(max(o.support, o.together / 2) for o in rough)
    if not (fault or clear) and naming.error > _ERROR_FOR_SUPPORT * faintest:
        return "faint outlines of what could be spheres"
    return fault or _located(clip, named, naming.confidence, "flow", warnings)


def _fault(outlines: list[SphereOutline], least_support: float) -> str | None:
    """Why these outlines are not those of three spheres of one size, if they are not."""
    if min(outline.seen for outline in outlines) < _LEAST_SEEN:
        return _CUT_OFF
    together = _TOGETHER[least_support]
    if any(o.support < least_support and o.together < together for o in outlines):
        return "only part of a round outline"
    for i, one in enumerate(outlines):
        for other in outlines[:i]:
            between = np.arccos(np.clip(one.cone.direction @ other.cone.direction, -1, 1))
            if between < 0.95 * (one.cone.angular_radius_rad + other.cone.angular_radius_rad):
                return "circles that overlap"
    radii = [outline.cone.angular_radius_rad for outline in outlines]
    return "circles of different sizes" if max(radii) > 1.3 * min(radii) else None


def _colour_frames(clip: _Clip) -> list[np.ndarray]:
    kept = clip.sample.stills
    chosen = np.unique(np.linspace(0, len(kept) - 1, _NAMING_FRAMES).astype(int))
    return [kept[i].rgb() for i in chosen]


def _by_saved_rig(clip: _Clip, saved: dict[str, Cone]) -> Located:
    named, do = {}, "leave out the rig file, or locate the rig again"
    frames = [still.luma for still in clip.sample.stills]
    for name, cone in saved.items():
        outline = refine(cone, frames, clip.camera, near=True)
        if outline.seen < _LEAST_SEEN or outline.support < _LEAST_SUPPORT:
            got = f"a saved rig whose {name} sphere has no outline here"
            raise clip.failed(got, do, None, list(saved.values()))
        if _moved_by(cone, outline.cone) > _SAVED_SHIFT:
            got = f"a saved rig whose {name} sphere has moved"
            raise clip.failed(got, do, None, list(saved.values()))
        named[name] = outline
    naming = name_spheres([o.cone for o in named.values()], _colour_frames(clip), clip.camera)
    if naming.names != tuple(named) and naming.confidence > _LEAST_CONFIDENCE:
        got = "a saved rig with other materials in its places"
        raise clip.failed(got, do, None, list(saved.values()))
    together = moved_together(saved, {n: o.cone for n, o in named.items()})
    named = {n: replace(outline, cone=together[n]) for n, outline in named.items()}
    return _located(clip, named, 1.0, "saved rig", ())


def _by_tag(clip: _Clip, rig: TagRig) -> Located:
    frames = [still.luma for still in clip.sample.stills]
    corners = tag_corners(frames, rig.tag_id)
    if corners is None:
        do = "show the tag to the camera, or leave out the rig file"
        raise clip.failed(f"no AprilTag 36h11 number {rig.tag_id} in the clip", do)
    cones = cones_next_to_tag(corners, rig, clip.camera)
    if cones is None:
        raise clip.failed("a tag that puts the spheres behind the camera", "correct the rig file")
    seen = {name: refine(cone, frames, clip.camera) for name, cone in cones.items()}
    sure = {name: o.cone for name, o in seen.items() if _near_outline(cones[name], o)}
    cones = cones_next_to_tag(corners, rig, clip.camera, sure) or cones
    named, warnings = {}, []
    for name, cone in cones.items():
        # Its size is known better from where the three are than from one outline.
        if name == "mirror":
            places = [cone, seen[name].cone]
            outline = mirror_of_size(places, cone.angular_radius_rad, frames, clip.camera)
        else:
            outline = refine_place(cone, frames, clip.camera, _STIFFNESS)
        if outline.seen < _LEAST_SEEN:
            got = f"a tag that puts the {name} sphere outside the picture"
            raise clip.failed(got, "correct the rig file", None, list(cones.values()))
        named[name] = outline
        if not _near_outline(cone, outline):
            warnings.append(f"no clear outline of the {name} sphere: it is where the tag says")
            named[name] = replace(outline, cone=cone)
    return _located(clip, named, 1.0, "tag", tuple(warnings))


def _near_outline(cone: Cone, outline: SphereOutline) -> bool:
    return outline.support >= _LEAST_SUPPORT and _moved_by(cone, outline.cone) < _SAVED_SHIFT


def _moved_by(one: Cone, other: Cone) -> float:
    """How far the centre or the radius moved, in radii."""
    shift = np.arccos(np.clip(one.direction @ other.direction, -1, 1))
    growth = abs(one.angular_radius_rad - other.angular_radius_rad)
    return float(max(shift, growth) / one.angular_radius_rad)


def _located(
    clip: _Clip,
    named: dict[str, SphereOutline],
    sure: float,
    method: Literal["flow", "tag", "saved rig"],
    warnings: tuple[str, ...],
) -> Located:
    cones = {name: named[name].cone for name in SPHERES}
    diameters = dict.fromkeys(SPHERES, clip.how.diameter_m)
    if isinstance(clip.how.rig, TagRig):
        diameters = clip.how.rig.diameters_m
    distance = {n: diameters[n] / 2 / np.sin(c.angular_radius_rad) for n, c in cones.items()}
    confidence = {n: sure * min(1.0, 0.3 + named[n].support) for n in SPHERES}
    unclear = [n.replace("_", " ") for n in SPHERES if named[n].support < _UNCLEAR]
    if unclear:
        warnings += (f"an outline that is hard to see: {', '.join(unclear)}",)
    cut = [n.replace("_", " ") for n in SPHERES if named[n].seen < 1]
    if cut:
        warnings += (f"partly out of the picture: {', '.join(cut)}",)
    frame = clip.sample.stills[len(clip.sample.stills) // 2].rgb()
    labels = {n: f"{n.replace('_', ' ')} {confidence[n]:.2f}" for n in SPHERES}
    picture = overlay.found_picture(frame, cones, labels, clip.camera)
    ovals = {name: ellipse(clip.camera, cone) for name, cone in cones.items()}
    rig = rig_of(cones, clip.how.name)
    return Located(rig, distance, confidence, ovals, warnings, method, picture)
