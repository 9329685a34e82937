"""The paper's own figures, to stand next to ours: on its own data, so to be read for scale only."""

from typing import NamedTuple

CAVEAT = (
    "The paper's figures are of its own 1,080p captures in other places with another camera; ours"
    " are of simulated ones. They give the scale, and which order to expect of the ablations."
)


class PaperRow(NamedTuple):
    """One row of Table 1: (indoor, outdoor) of each measure, unseen places."""

    name: str
    l1_diffuse: tuple[float, float]
    l1_matte_silver: tuple[float, float]
    l1_mirror: tuple[float, float]
    theta_rgb_deg: tuple[float, float]


TABLE_1 = (
    PaperRow("L1(m,d,s) + adv", (0.12, 0.13), (0.13, 0.13), (0.17, 0.16), (9.8, 10.8)),
    PaperRow("L1(m,d,s)", (0.12, 0.13), (0.12, 0.13), (0.15, 0.14), (9.9, 11.0)),
    PaperRow("L1(m)", (0.20, 0.18), (0.16, 0.15), (0.14, 0.13), (11.0, 13.5)),
    PaperRow("L1(s)", (0.12, 0.13), (0.13, 0.13), (0.21, 0.20), (10.0, 11.4)),
    PaperRow("L1(d)", (0.12, 0.13), (0.15, 0.15), (0.28, 0.27), (10.0, 11.2)),
)
