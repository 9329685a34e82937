"""Precomputed radiance transfer: an object that any light can shade in real time.

Section 4.4 of the paper shows its light with it, after Sloan, Kautz and Snyder 2002. What the
object blocks, reflects onto itself and takes from the ground it stands on is worked out once, as a
linear map from spherical harmonics of the light to the light that leaves each vertex.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Float32, Int, UInt8

from deeplight import brdf, harmonics
from deeplight.camera_response import LUMINANCE, decode, encode
from deeplight.compose.materials import REFLECTIVITY
from deeplight.compose.mesh import Mesh
from deeplight.errors import ConfigError
from deeplight.transfer.clusters import Clusters, clustered
from deeplight.transfer.ground import Ground, open_plane
from deeplight.transfer.mesh import MAX_VERTICES, TransferSurface, prepared
from deeplight.transfer.solve import Progress, Solution, Work, solve

MAX_ORDER = 8
_MOST_GLOSSY = MAX_VERTICES * 25**2  # numbers: 250 MB, twice while light bounces
_DARK = 0.05  # share of white light


@dataclass(frozen=True)
class TransferSettings:
    """What to work out.

    Attributes:
        order: of the harmonics; (order + 1)^2 coefficients.
        samples: rays from each point.
        bounces: of light between object and ground.
        diffuse: reflectivity of the diffuse finish; None is the mesh's own colours.
        glossy: reflectivity of the glossy finish, rough metal; None leaves it out.
        roughness: its GGX alpha.
        ground: what it stands on; None is nothing, with light from below.
        longest_edge: longer ones are split; a share of the object's longest side.
        clusters, components: how many numbers the glossy finish gets.
    """

    order: int = 4
    samples: int = 512
    bounces: int = 2
    diffuse: float | None = REFLECTIVITY["diffuse"]
    glossy: float | None = REFLECTIVITY["silver"]
    roughness: float = brdf.MATTE_SILVER_ROUGHNESS
    ground: Ground | None = field(default_factory=Ground)
    longest_edge: float = 1 / 20
    clusters: int = 16
    components: int = 8

    def __post_init__(self) -> None:
        checks: dict[str, tuple[float | None, float, float]] = {
            f"an order of 1 to {MAX_ORDER}": (self.order, 1, MAX_ORDER),
            "16 to 65,536 samples": (self.samples, 16, 65_536),
            "0 to 20 bounces": (self.bounces, 0, 20),
            "a diffuse reflectivity from 0 to 1": (self.diffuse, 0, 1),
            "a glossy reflectivity from 0 to 1": (self.glossy, 0, 1),
            "a roughness from 0.1 to 1": (self.roughness, 0.1, 1),
            "a longest edge of at least 0.002": (self.longest_edge, 0.002, math.inf),
            "1 to 64 clusters": (self.clusters, 1, 64),
            "1 to 32 components": (self.components, 1, 32),
        }
        for expected, (got, least, most) in checks.items():
            if got is not None and not least <= got <= most:
                raise ConfigError(expected, f"{got:g}", "correct it")


@dataclass(frozen=True, eq=False)
class Glossy:
    """Rough metal: matrices from the light's harmonics to those of what leaves.

    What leaves is a function of the eye's mirror direction about the normal.
    """

    reflectivity: float
    roughness: float
    clusters: Clusters


@dataclass(frozen=True, eq=False)
class Shadowed:
    """The plane with the object on it: irradiance over pi in light of each harmonic."""

    ground: Ground
    transfer: Float32[np.ndarray, "points coefficients"]


@dataclass(frozen=True, eq=False)
class Transfer:
    """An object ready to be lit; its own frame: +Y up, it stands on y = 0, longest side 1.

    Attributes:
        order, bounces: see `TransferSettings`.
        vertices, normals, triangles: of the surface.
        reflectivity: of the diffuse finish, linear RGB; unused where there are colours.
        colours: of the diffuse finish at each vertex, gamma-encoded; None is one for all.
        diffuse: what leaves each vertex in light of each harmonic, per unit of reflectivity.
        glossy, shadowed: None where they were not asked for.
    """

    order: int
    bounces: int
    vertices: Float32[np.ndarray, "vertices 3"]
    normals: Float32[np.ndarray, "vertices 3"]
    triangles: Int[np.ndarray, "triangles 3"]
    reflectivity: tuple[float, float, float]
    colours: UInt8[np.ndarray, "vertices 3"] | None
    diffuse: Float32[np.ndarray, "vertices coefficients"]
    glossy: Glossy | None
    shadowed: Shadowed | None

    def diffuse_radiance(
        self, light: Float[np.ndarray, "given 3"]
    ) -> Float[np.ndarray, "vertices 3"]:
        """What leaves each vertex, in all directions; `light` is in the object's frame."""
        tint = np.array(self.reflectivity)
        if self.colours is not None:
            tint = decode(self.colours / 255.0)
        result: np.ndarray = tint * np.maximum(self.diffuse @ self._fitting(light), 0)
        return result

    def glossy_radiance(
        self, light: Float[np.ndarray, "given 3"], eyes: Float[np.ndarray, "vertices 3"]
    ) -> Float[np.ndarray, "vertices 3"]:
        """What leaves each vertex towards the eye in direction `eyes`."""
        if self.glossy is None:
            raise ConfigError("a transfer with the glossy finish", "one without", "make it again")
        normals, clusters = self.normals, self.glossy.clusters
        mirrored = 2 * (eyes * normals).sum(-1, keepdims=True) * normals - eyes
        lobes = harmonics.basis(mirrored, self.order)
        sent = np.einsum("cpji,ik->cpjk", clusters.matrices, self._fitting(light))[clusters.cluster]
        parts = np.concatenate([np.ones_like(clusters.weights[:, :1]), clusters.weights], 1)
        radiance = np.einsum("np,nj,npjk->nk", parts, lobes, sent, optimize=True)
        result: np.ndarray = self.glossy.reflectivity * np.maximum(radiance, 0)
        return result

    def shadow(self, light: Float[np.ndarray, "given 3"]) -> Float[np.ndarray, "size size 3"]:
        """Light on the ground with the object over that without; row by row as `Ground.points`."""
        if self.shadowed is None:
            raise ConfigError("a transfer with the ground", "one without", "make it again")
        fitting, size = self._fitting(light), self.shadowed.ground.size
        whole = open_plane(self.order) @ fitting
        lit = np.maximum(self.shadowed.transfer @ fitting, 0)
        ratio = np.divide(lit, whole, out=np.ones_like(lit), where=whole > 0)
        return ratio.reshape(size, size, 3)

    def _fitting(self, light: Float[np.ndarray, "given 3"]) -> Float[np.ndarray, "coefficients 3"]:
        """Light of another order, cut or filled up with 0."""
        result = np.zeros(((self.order + 1) ** 2, 3))
        count = min(len(light), len(result))
        result[:count] = light[:count]
        return result


def precompute(
    meshes: Sequence[Mesh],
    settings: TransferSettings = TransferSettings(),
    progress: Progress = lambda done, total: None,
) -> tuple[Transfer, tuple[str, ...]]:
    """Work out an object's transfer.

    Returns:
        The transfer, and a line for each thing that was changed in the mesh.

    Raises:
        ImageFileError: a mesh without surface, or with too many vertices.
        ConfigError: the glossy finish would not fit into memory.
        MissingExtraError: the `render` extra is not installed.
    """
    surface, notes = prepared(meshes, settings.longest_edge)
    count = len(surface.vertices)
    if settings.glossy is not None and count * (settings.order + 1) ** 4 > _MOST_GLOSSY:
        most = _MOST_GLOSSY // (settings.order + 1) ** 4
        expected = f"at most {most:,} vertices for a glossy finish of order {settings.order}"
        raise ConfigError(expected, f"{count:,}", "lower the order, or leave glossy out")
    colours = _encoded(surface) if settings.diffuse is None else None
    work = Work(
        order=settings.order,
        samples=settings.samples,
        bounces=settings.bounces,
        diffuse=_albedo(colours, settings.diffuse),
        glossy=settings.glossy,
        roughness=settings.roughness,
    )
    solution = solve(surface, settings.ground, work, progress)
    one = settings.diffuse if settings.diffuse is not None else 1.0
    normals = surface.normals.astype(np.float32)
    transfer = Transfer(
        order=settings.order,
        bounces=settings.bounces,
        vertices=surface.vertices.astype(np.float32),
        normals=normals,
        triangles=surface.triangles,
        reflectivity=(one, one, one),
        colours=colours,
        diffuse=solution.diffuse[:, 0],
        glossy=_glossy(solution, normals, settings),
        shadowed=_shadowed(solution, settings),
    )
    return transfer, (*notes, *_suspicions(transfer))


def _suspicions(transfer: Transfer) -> tuple[str, ...]:
    """What looks as if the mesh were not meant to be so."""
    white = transfer.diffuse[:, 0] * np.sqrt(4 * np.pi)
    if float(np.median(white)) > _DARK:
        return ()
    return ("hardly any light gets to most of its vertices: do its faces look inwards?",)


def _encoded(surface: TransferSurface) -> UInt8[np.ndarray, "vertices 3"]:
    """The surface's own colours as a file holds them."""
    return np.round(encode(np.clip(surface.colours, 0, 1)) * 255).astype(np.uint8)


def _albedo(
    colours: UInt8[np.ndarray, "vertices 3"] | None, diffuse: float | None
) -> float | Float[np.ndarray, "vertices"]:
    """How much the object sends on to itself and the ground: grey, even if it is coloured."""
    if colours is not None:
        grey: np.ndarray = decode(colours / 255.0) @ LUMINANCE
        return grey
    assert diffuse is not None  # one of the two is there
    return diffuse


def _shadowed(solution: Solution, settings: TransferSettings) -> Shadowed | None:
    if settings.ground is None:
        return None
    return Shadowed(settings.ground, solution.ground[:-1, 0])


def _glossy(solution: Solution, normals: np.ndarray, settings: TransferSettings) -> Glossy | None:
    if solution.glossy is None or settings.glossy is None:
        return None
    parts = clustered(solution.glossy, normals, settings.clusters, settings.components)
    return Glossy(settings.glossy, settings.roughness, parts)
