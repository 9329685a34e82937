"""Which rows of a batch belong to one of the processes that train together."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Share:
    """Which rows of a batch belong to this process."""

    rank: int = 0
    ranks: int = 1

    def own(self, whole: Any) -> Any:
        """This process's rows of a whole batch: an array or a tensor whose length divides."""
        rows = len(whole) // self.ranks
        return whole[self.rank * rows : (self.rank + 1) * rows]

    def whole(self, own_rows: int) -> int:
        """Rows of the whole batch."""
        return own_rows * self.ranks


ALONE = Share()
