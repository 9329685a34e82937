"""Triangles and how their surface reflects: what every mesh file is brought to."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int, UInt8

from deeplight.frames import normalised

LEAST_FACING = 0.05
"""Cosine between a normal and the view of what is seen: 87 degrees at most."""


@dataclass(frozen=True, eq=False)
class Finish:
    """How a mesh's own material reflects: glTF's metallic-roughness model.

    Attributes:
        colour: base colour, linear.
        colour_map: base colour texture, sRGB; multiplied by `colour` when the file is read.
        roughness, metallic: 0 to 1; each may have a map of one channel.
        wrap: what lies around the maps: "repeat", "clamp" or "mirror".
        lost: the file names a texture or a material that could not be read.
        notes: what else of the file's surface could not be applied.
    """

    colour: tuple[float, float, float] = (0.6, 0.6, 0.6)
    colour_map: UInt8[np.ndarray, "height width 3"] | None = None
    roughness: float = 0.6
    metallic: float = 0.0
    roughness_map: UInt8[np.ndarray, "rows columns"] | None = None
    metallic_map: UInt8[np.ndarray, "rows columns"] | None = None
    wrap: str = "repeat"
    lost: bool = False
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with one finish; +Y is up.

    Attributes:
        vertices, faces: as usual; a face's vertices run anticlockwise seen from outside.
        normals: of the vertices; None for flat triangles.
        uv: texture coordinates of the vertices, (0, 0) the texture's lower left.
        colours: linear, of the vertices, instead of the finish's.
        finish: what the file says of the surface.
    """

    vertices: Float[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "m 3"]
    normals: Float[np.ndarray, "n 3"] | None = None
    uv: Float[np.ndarray, "n 2"] | None = None
    colours: Float[np.ndarray, "n 3"] | None = None
    finish: Finish = Finish()

    def towards(self, eye: Float[np.ndarray, "3"]) -> "Mesh":
        """The same for a camera at `eye`: no face that it sees has normals that turn away from it.

        Smoothed normals at an outline belong to the faces behind it as well, and a renderer shades
        what they turn away as its own back: a rim of dark dots.
        """
        if self.normals is None:
            return self
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        seen = np.einsum("fc,fc->f", np.cross(b - a, c - a), eye - a) > 0
        side = np.full(len(self.vertices), -1.0)  # of an open surface one may see the back
        side[self.faces[seen]] = 1.0
        view = normalised(eye - self.vertices)
        missing = LEAST_FACING - side * np.einsum("vc,vc->v", self.normals, view)
        bent = self.normals + (side * np.maximum(missing, 0))[:, None] * view
        return replace(self, normals=normalised(bent))
