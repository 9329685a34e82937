"""Equations 1 and 2: a sphere in any light, as a weighted sum of its basis images."""

import numpy as np
from jaxtyping import Float

from deeplight.errors import ShapeError
from deeplight.lighting import HasLighting, Lighting
from deeplight.reflectance import ReflectanceBasis, rig_bases
from deeplight.sphere import Rig


def relight(basis: ReflectanceBasis, lighting: Lighting) -> Float[np.ndarray, "size size 3"]:
    """Render a sphere under `lighting` as a weighted sum of its basis images.

    Equation 1 of LeGendre et al., CVPR 2019. The solid angle of each direction is already
    inside `basis.weights`, so the sum has no extra factor.

    Returns:
        Linear radiance of the sphere, in the units of `lighting.radiance`; not clipped;
        zero off the sphere.

    Raises:
        ShapeError: the basis was built for another ball size.
    """
    if basis.light_size != lighting.size:
        raise ShapeError(
            f"lighting of {basis.light_size} x {basis.light_size}",
            f"{lighting.size} x {lighting.size}",
            "build the basis with light_size=lighting.size",
        )
    size = basis.view.size
    return (basis.weights @ lighting.radiance.reshape(-1, 3)).reshape(size, size, 3)


def relight_rig(rig: Rig, light: HasLighting) -> dict[str, Float[np.ndarray, "size size 3"]]:
    """All three spheres of a rig under a light, each in its own frame; linear radiance.

    Examples:
        >>> white = deeplight.Lighting(np.ones((32, 32, 3), np.float32))
        >>> spheres = deeplight.relight_rig(deeplight.PAPER_RIG, white)
        >>> {name: round(float(radiance[16, 16, 0]), 1) for name, radiance in spheres.items()}
        {'mirror': 0.8, 'matte_silver': 0.6, 'diffuse': 0.3}
    """
    lighting = light.lighting
    bases = rig_bases(rig, lighting.size)
    return {name: relight(basis, lighting) for name, basis in bases.items()}
