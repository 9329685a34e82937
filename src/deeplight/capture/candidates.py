"""Circles among the edges that stay: where a sphere may be seen.

A plane through the camera's centre and a short piece of edge touches a sphere with that outline.
If d is the ray through the piece and N the plane's normal, the axis of the sphere's cone is
d cos(rho) + N sin(rho) or d cos(rho) - N sin(rho): every piece of edge votes for two axes for
each angular radius. That is exact anywhere in the frame, where spheres are ellipses.
"""

from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from jaxtyping import Float

from deeplight.camera import PinholeCamera
from deeplight.capture.conic import Cone, moved, pixel_scale, rays_around
from deeplight.capture.motion import Evidence
from deeplight.frames import normalised

SMALLEST_RAD, LARGEST_RAD = np.radians(1.2), np.radians(9.0)
_RATIO = 1.1  # between neighbouring radii of the vote
_FAINT = 0.2  # edges steadier than this vote; moving texture reaches 1 / sqrt(frames)
_ANGLES = np.arange(72) * (2 * np.pi / 72)
_LEAST_COVERAGE = 0.22  # of the outline of a sphere; chance circles of texture reach 0.2
_CLEARER = 1.3  # a circle inside one by so much clearer is part of what that one shows
_BORDER = 0.15  # centres may lie outside the picture by this share of its shorter side


@dataclass(frozen=True)
class Candidate:
    """A circle of edges that stay.

    Attributes:
        cone: where it is.
        coverage: share of its outline with a steady edge across it, each edge counted by its
            steadiness, 0 to 1; what lies outside the picture does not count.
    """

    cone: Cone
    coverage: float


def find_candidates(found: Evidence, camera: PinholeCamera, most: int = 30) -> list[Candidate]:
    """Circles of steady edges, best first; `camera` is that of the working scale."""
    rays, normals, weights = edge_planes(found, camera)
    steps = int(np.ceil(np.log(LARGEST_RAD / SMALLEST_RAD) / np.log(_RATIO)))
    peaks: list[tuple[float, Cone]] = []
    for rho in SMALLEST_RAD * _RATIO ** np.arange(steps + 1):
        peaks += _peaks(rays, normals, weights, float(rho), camera)
    peaks.sort(key=lambda peak: -peak[0])
    chosen: list[Candidate] = []
    tried: list[Cone] = []
    for _, cone in peaks:
        if len(tried) >= 2 * most or any(_same(cone, other, 0.25) for other in tried):
            continue
        tried.append(cone)
        candidate = settled(cone, found, camera)
        if candidate and not any(_same(candidate.cone, other.cone) for other in chosen):
            chosen.append(candidate)
    return sorted(chosen, key=lambda candidate: -candidate.coverage)[:most]


def edge_planes(
    found: Evidence, camera: PinholeCamera
) -> tuple[Float[np.ndarray, "edges 3"], Float[np.ndarray, "edges 3"], Float[np.ndarray, "edges"]]:
    """Ray, normal of the touching plane, and steadiness of every pixel on a thin steady edge."""
    strength = found.strength
    rows, columns = np.nonzero(_thin(found) & (strength > _FAINT))
    weights = strength[rows, columns]
    x, y = found.edge_x[rows, columns] / weights, found.edge_y[rows, columns] / weights
    rays = camera.rays()[rows, columns]
    along = np.stack([-y, -x, np.zeros_like(x)], axis=-1)  # the edge's direction; y runs down
    return rays, normalised(np.cross(rays, along)), (weights - _FAINT) / (1 - _FAINT)


def _thin(found: Evidence) -> np.ndarray:
    """Pixels whose edge is not weaker than its neighbours' across it."""
    strength = found.strength.astype(np.float32)
    height, width = strength.shape
    length = np.maximum(strength, 1e-6)
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    step_x, step_y = found.edge_x / length, found.edge_y / length
    result = np.ones(strength.shape, bool)
    for sign in (-1, 1):
        neighbours = cv2.remap(
            strength,
            (x + sign * step_x).astype(np.float32),
            (y + sign * step_y).astype(np.float32),
            cv2.INTER_LINEAR,
        )
        result &= strength >= neighbours
    return result


def _peaks(
    rays: np.ndarray, normals: np.ndarray, weights: np.ndarray, rho: float, camera: PinholeCamera
) -> list[tuple[float, Cone]]:
    """The axes most edges agree on for one angular radius, with their share of the outline."""
    both = np.concatenate([np.cos(rho) * rays + s * np.sin(rho) * normals for s in (-1, 1)])
    row, column = camera.pixel_of_directions(both)
    border = round(_BORDER * min(camera.height, camera.width))
    height, width = camera.height + 2 * border, camera.width + 2 * border
    row, column = np.rint(row).astype(int) + border, np.rint(column).astype(int) + border
    kept = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    index = (row * width + column)[kept]
    votes = np.bincount(index, np.tile(weights, 2)[kept], minlength=height * width)
    radius_px = rho * pixel_scale(camera)
    sigma = max(1.0, 0.5 * (_RATIO - 1) * radius_px)  # half a step of the radius
    share = cv2.GaussianBlur(votes.reshape(height, width).astype(np.float32), (0, 0), sigma)
    share = share * np.float32(sigma**2 / radius_px)  # 2 pi sigma^2 over 2 pi r
    reach = 2 * int(0.5 * radius_px) + 1
    highest = cv2.dilate(share, np.ones((reach, reach), np.uint8))
    rows, columns = np.nonzero((share == highest) & (share > 0.08))
    best = np.argsort(-share[rows, columns])[:12]
    f = pixel_scale(camera)
    x = (columns[best] - border - (camera.width - 1) / 2) / f
    y = ((camera.height - 1) / 2 - rows[best] + border) / f
    axes = normalised(np.stack([x, y, np.full(len(best), -1.0)], axis=-1))
    shares = share[rows[best], columns[best]]
    return [(float(s), Cone(axis, rho)) for s, axis in zip(shares, axes, strict=True)]


def settled(cone: Cone, found: Evidence, camera: PinholeCamera) -> Candidate | None:
    """The circle moved onto the outline around it, and how much of an outline it is.

    None where it runs away from where it began or out of the picture.
    """
    start, pixel = cone, 1 / pixel_scale(camera)
    for reach in (0.25, 0.2, 0.15, 0.1):
        step = max(reach * cone.angular_radius_rad, 2 * pixel)
        offsets = np.linspace(-step, step, 13)
        outline, inside = _outline(cone, offsets, found, camera)
        if inside.mean() < 0.3:
            return None
        weight = outline**2 * np.exp(-2 * (offsets / step) ** 2)
        total = weight.sum(axis=1)
        shift = (weight @ offsets) / (total + 1e-9)
        cone = moved(cone, *fitted(_ANGLES, shift, np.minimum(total, 1.0) * inside))
        if not 0.5 < cone.angular_radius_rad / start.angular_radius_rad < 1.6:
            return None
    step = max(0.04 * cone.angular_radius_rad, 1.2 * pixel)
    outline, inside = _outline(cone, np.linspace(-step, step, 5), found, camera)
    if inside.mean() < 0.3:
        return None
    return Candidate(cone, float(outline.max(axis=1)[inside].mean()))


def fitted(
    angles_rad: Float[np.ndarray, "angles"],
    offsets_rad: Float[np.ndarray, "angles"],
    weights: Float[np.ndarray, "angles"],
) -> tuple[Float[np.ndarray, "2"], float]:
    """How to move and grow a cone for its outline to pass `offsets_rad` outside the present one.

    Weighted least squares of offset = u cos + v sin + growth.
    """
    columns = np.stack([np.cos(angles_rad), np.sin(angles_rad), np.ones_like(angles_rad)], axis=-1)
    weighted = columns * weights[:, None]
    normal = columns.T @ weighted + 1e-9 * np.eye(3)
    u, v, growth = np.linalg.solve(normal, weighted.T @ offsets_rad)
    return np.array([u, v]), float(growth)


def _outline(
    cone: Cone, offsets: np.ndarray, found: Evidence, camera: PinholeCamera
) -> tuple[np.ndarray, np.ndarray]:
    """How much of an outline lies at each angle and offset, 0 to 1; which angles are in the frame.

    A steady edge across the outline, less what is steady just outside it: inside a shiny sphere
    there are steady edges too (the rim squeezes the reflections into rings), outside are none.
    """
    pixel = 1 / pixel_scale(camera)
    gap = max(2.5 * pixel, 0.06 * cone.angular_radius_rad)
    beyond = gap + np.array([0.0, 0.8]) * max(3 * pixel, 0.15 * cone.angular_radius_rad)
    every = np.concatenate([offsets, (offsets[:, None] + beyond).ravel()])
    row, column = camera.pixel_of_directions(rays_around(cone, _ANGLES, every))
    row, column = row.astype(np.float32), column.astype(np.float32)
    x = cv2.remap(found.edge_x.astype(np.float32), column, row, cv2.INTER_LINEAR)
    y = cv2.remap(found.edge_y.astype(np.float32), column, row, cv2.INTER_LINEAR)
    count, middle = len(offsets), len(offsets) // 2
    out_x, out_y = np.gradient(column[:, :count], axis=1), np.gradient(row[:, :count], axis=1)
    length = np.hypot(out_x, out_y) + 1e-9
    edge = np.abs(x[:, :count] * out_x + y[:, :count] * out_y) / length
    outside = np.hypot(x, y)[:, count:].reshape(len(_ANGLES), count, -1).mean(axis=2)
    r, c = row[:, middle], column[:, middle]
    inside = (r > 1) & (r < camera.height - 2) & (c > 1) & (c < camera.width - 2)
    return np.maximum(edge - outside, 0), inside


def separation_rad(one: Cone, other: Cone) -> float:
    """Angle between the axes of two cones."""
    return float(np.arccos(np.clip(one.direction @ other.direction, -1, 1)))


def _same(one: Cone, other: Cone, share: float = 0.15) -> bool:
    near = share * min(one.angular_radius_rad, other.angular_radius_rad)
    grown = abs(one.angular_radius_rad - other.angular_radius_rad)
    return separation_rad(one, other) < near and grown < near


def triples(candidates: list[Candidate], most: int = 4) -> list[tuple[float, list[Candidate]]]:
    """Three circles that may be the rig's, best first, with their scores.

    Spheres of one size at nearly one distance have nearly one angular radius, and do not overlap.
    """
    scored = []
    for three in combinations(_outermost(candidates), 3):
        radii = np.log([candidate.cone.angular_radius_rad for candidate in three])
        if np.ptp(radii) > np.log(1.6):
            continue
        if any(_overlap(a.cone, b.cone) for a, b in combinations(three, 2)):
            continue
        coverage = [candidate.coverage for candidate in three]
        score = np.mean(coverage) + 0.5 * min(coverage) - 0.5 * (np.ptp(radii) / np.log(1.3)) ** 2
        scored.append((float(score), list(three)))
    return sorted(scored, key=lambda pair: -pair[0])[:most]


def _outermost(candidates: list[Candidate]) -> list[Candidate]:
    """Clear circles without those inside a larger and clearer one: what a mirror shows."""
    return [
        inner
        for inner in candidates
        if inner.coverage > _LEAST_COVERAGE
        and not any(
            outer.coverage > _CLEARER * inner.coverage
            and outer.cone.angular_radius_rad > inner.cone.angular_radius_rad
            and separation_rad(outer.cone, inner.cone) < outer.cone.angular_radius_rad
            for outer in candidates
        )
    ]


def _overlap(one: Cone, other: Cone) -> bool:
    return separation_rad(one, other) < 0.93 * (one.angular_radius_rad + other.angular_radius_rad)


def completed(
    candidates: list[Candidate], camera: PinholeCamera, most: int = 3
) -> list[list[Cone]]:
    """Threes made of two clear circles of one size and a third where a straight bar has it.

    For a sphere without enough of an outline to be a candidate itself.
    """
    pairs: list[tuple[float, Cone, Cone]] = []
    for one, other in combinations(_outermost(candidates), 2):
        uneven = abs(np.log(one.cone.angular_radius_rad / other.cone.angular_radius_rad))
        if uneven < np.log(1.15) and not _overlap(one.cone, other.cone):
            pairs.append((float(one.coverage + other.coverage - uneven), one.cone, other.cone))
    pairs.sort(key=lambda pair: -pair[0])
    threes = []
    for _, left, right in pairs[:most]:
        for cone in on_bar(left, right):
            row, column = (a[0] for a in camera.pixel_of_directions(cone.direction[None]))
            within = 0 < row < camera.height and 0 < column < camera.width
            if within and not (_overlap(cone, left) or _overlap(cone, right)):
                threes.append([left, right, cone])
    return threes


def on_bar(left: Cone, right: Cone) -> list[Cone]:
    """Where a third sphere of the same size may be on an even, straight bar with two others."""
    # Centres in units of the radius, which is one for all three.
    a, b = (cone.direction / np.sin(cone.angular_radius_rad) for cone in (left, right))
    return [
        Cone(normalised(third), float(np.arcsin(1 / np.linalg.norm(third))))
        for third in ((a + b) / 2, 2 * b - a, 2 * a - b)
    ]
