"""Light measured with a camera: exposures of a mirror ball or panorama to an environment."""
