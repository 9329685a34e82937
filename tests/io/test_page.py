"""Reports in HTML: escaped, self-contained, with true numbers on their charts."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from deeplight.report.chart import Chart, Curve, Mark, round_numbers
from deeplight.report.page import Figure, Heading, Link, Page, PageRow, Paragraph, Table

PIXELS = np.full((4, 6, 3), 90, np.uint8)


def test_a_page_of_a_name_that_is_not_utf_8_is_written(tmp_path: Path) -> None:
    Page("Clip n\udcff", "n\udcff.mp4").write(tmp_path / "a.html")
    assert "n?.mp4" in (tmp_path / "a.html").read_text(encoding="utf-8")


def test_text_is_escaped_and_nothing_comes_from_the_network(tmp_path: Path) -> None:
    page = Page("<script>alert(1)</script>", "a & b")
    page.add(
        Heading('"><img src=x>'),
        Paragraph("<b>bold</b>", "warning"),
        Table(("<i>", "n"), [("<u>", 3), (Link("<s>", "a.html"), 4.5)]),
        PageRow([Figure(PIXELS, "<em>", alt='"quoted"')], "side by side"),
        Figure(PIXELS, exact=True),
        Chart("<svg>", [Curve("</svg>", [0, 1], [0, 1])], [Mark("<k>", [0.5])]),
    )
    page.write(tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    for tag in ("<script", "<b>", "<i>", "<u>", "<s>", "<em>", "<k>", "http:", "https:"):
        assert tag not in text
    assert text.count("<img") == text.count("data:image/") == 2
    assert text.count("<svg") == text.count("</svg>") == 1
    assert 'href="a.html"' in text


def test_every_picture_has_an_alternative_text() -> None:
    page = Page("title")
    page.add(Figure(PIXELS, "what is seen"))
    alternatives = re.findall(r'alt="([^"]*)"', page.html())
    assert alternatives == ["what is seen"]


@pytest.mark.parametrize(("low", "high"), [(0, 1), (-3, 17), (0.011, 0.012), (5, 5e6)])
def test_axis_numbers_enclose_the_values_evenly(low: float, high: float) -> None:
    ticks = round_numbers(low, high)
    assert ticks[0] <= low
    assert ticks[-1] >= high
    assert 3 <= len(ticks) <= 9
    assert np.allclose(np.diff(ticks), ticks[1] - ticks[0])


def test_a_chart_keeps_proportions_and_breaks_at_gaps() -> None:
    curve = Curve("c", [0, 1, 2, 3, 4], [0, 1, math.nan, 1, 0])
    chart = Chart("t", [curve])
    assert len(chart.lines(curve)) == 2
    assert chart.across(2) == pytest.approx((chart.left + chart.right) / 2)
    assert chart.up(0) == chart.bottom
    assert chart.up(1) == chart.top


def test_a_chart_of_one_value_can_be_drawn() -> None:
    chart = Chart("t", [Curve("c", [2.0], [0.0])])
    assert chart.top < chart.up(0.0) < chart.bottom
    assert "nan" not in "".join(chart.lines(chart.curves[0]))
