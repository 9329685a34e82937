"""DeepLight: the light of a whole scene from one ordinary photo."""

__version__ = "0.1.0"
