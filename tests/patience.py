"""How long a test waits: the time of an idle machine, more on a busy one."""

import os


def patient(seconds: float) -> float:
    """A time limit in seconds for something that takes less on an idle machine."""
    busy = os.getloadavg()[0] / (os.cpu_count() or 1) if hasattr(os, "getloadavg") else 1.0
    return seconds * max(1.0, 2 * busy)
