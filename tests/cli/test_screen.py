"""What is seen of a verb whose output goes to a file."""

import pytest
from rich.table import Table

from deeplight.cli.screen import print_tables


def test_a_table_has_all_its_columns_in_a_narrow_pipe(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    names = [f"a long name {number}" for number in range(12)]
    table = Table("", title="all of them")
    for name in names:
        table.add_column(name, no_wrap=True)
    table.add_row("a row", *names)
    print_tables([table])
    _, _, head, _, row, _ = capsys.readouterr().out.splitlines()
    assert all(name in head and name in row for name in names)
