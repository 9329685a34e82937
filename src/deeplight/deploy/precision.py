"""The precisions that a network's file can have."""

from typing import Literal

Precision = Literal["float32", "float16", "int8-weights", "int8"]
PRECISIONS: tuple[Precision, ...] = ("float32", "float16", "int8-weights", "int8")
