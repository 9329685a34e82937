"""Tables that people write: CSV with a line of column names, as spreadsheets save it."""

import csv
from collections.abc import Sequence
from pathlib import Path

from deeplight.errors import DataSetError
from deeplight.io.boundary import reads_as


@reads_as(DataSetError)
def read_table(path: Path, columns: Sequence[str]) -> list[dict[str, str]]:
    """Give every row by column name; other columns than `columns` may be there, or be empty.

    Raises:
        OSError: there is no such file, or reading it is not permitted.
        DataSetError: it is no CSV in UTF-8, or a row lacks one of `columns`.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:  # as spreadsheets write it
            rows = list(csv.DictReader(file))
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataSetError(f"a CSV table in UTF-8 in {path}", f"{error}", "repair it") from None
    for number, row in enumerate(rows, 1):
        if lacking := [column for column in columns if not row.get(column)]:
            expected = f"columns {', '.join(columns)} in every row of {path}"
            got = f"row {number} without {', '.join(lacking)}"
            raise DataSetError(expected, got, "complete it")
    return [{name: value or "" for name, value in row.items() if name} for row in rows]
