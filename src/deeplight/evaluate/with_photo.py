"""A network's estimate with the photo put into it, as `deeplight estimate` gives it."""

import numpy as np
from jaxtyping import Float32, Int64

from deeplight.camera import BACKGROUND_HEIGHT, BACKGROUND_WIDTH
from deeplight.contract import ModelContract
from deeplight.errors import ConfigError
from deeplight.estimators.environment import assemble
from deeplight.estimators.fill import Fill, chosen
from deeplight.estimators.projection import ImagePlane
from deeplight.estimators.tilt import seen_tilt
from deeplight.evaluate.models import NamedModel
from deeplight.lighting import Lighting

HEIGHT = 128  # of the environment: its texels are finer than the ball's pixels
DARKEST = 1e-6  # radiance: black still has a logarithm


class WithPhoto:
    """A network whose answer is its environment, photo and lamps in it, on the mirror ball."""

    def __init__(self, network: NamedModel, fill: Fill | None = "auto") -> None:
        self._network, self._fill = network, fill
        whole = ModelContract()
        self._plane = ImagePlane(-whole.right, whole.right, whole.bottom, whole.top)

    @property
    def name(self) -> str:
        """What tables call it."""
        more = {
            "auto": "",
            "photo": ", no detail",
            None: ", not continued",
            "any": ", any detail",
        }.get(self._fill, f", {self._fill} detail")
        return f"{self._network.name} with the photo{more}"

    def estimate_inputs(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch size size 3"]:
        """Give ln radiance for the data set's pictures, in [-0.5, 0.5].

        Raises:
            ConfigError: pictures of another shape than the data set's portrait backgrounds.
        """
        if inputs.shape[2:] != (BACKGROUND_HEIGHT, BACKGROUND_WIDTH):
            got = f"{inputs.shape[3]} x {inputs.shape[2]}"
            expected = f"backgrounds of {BACKGROUND_WIDTH} x {BACKGROUND_HEIGHT}"
            raise ConfigError(expected, got, "measure without the photo")
        levels: Int64[np.ndarray, "batch 3 height width"] = np.round((inputs + 0.5) * 255)
        pictures = levels.transpose(0, 2, 3, 1).astype(np.uint8)
        answers, lamps, heads = self._network.estimate_fully(inputs)
        lights = [Lighting.from_log_radiance(answer) for answer in answers]
        balls = []
        for light, picture, own, said in zip(lights, pictures, lamps, heads, strict=True):
            tilt = seen_tilt(picture, self._plane, said)
            fill = chosen(self._fill, said)
            balls.append(assemble(light, picture, self._plane, HEIGHT, own, fill, tilt))
        radiance = np.stack([scene.environment.lighting.radiance for scene in balls])
        return np.log(np.maximum(radiance, DARKEST)).astype(np.float32)
