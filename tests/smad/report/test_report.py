"""Pages and plots."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

from smad.errors import CommandError, SmadError
from smad.report.page import (
    Beside,
    Code,
    Fold,
    Page,
    Picture,
    Section,
    Table,
    Text,
    render,
    write_page,
)
from smad.report.panels import Panel, Panels, Trace
from smad.report.plots import decimated, draw, label, new_figure, picture, svg_of
from smad.report.printed import write_figure
from smad.style.palette import in_print

TABLE = Table(("name", "value"), (("a", "1.0"), ("long name", "12.5")), numeric=frozenset({1}))


def drawn() -> Figure:
    figure, (axes,) = new_figure()
    draw(axes, np.arange(10.0), np.arange(10.0) ** 2, "a <b> & c", "main")
    label(axes, "time, s", "mm")
    return figure


def figure_svg() -> str:
    return svg_of(drawn(), 'title with "quotes" & <tags>')


def test_everything_but_figures_is_escaped() -> None:
    nasty = "<script>alert('x')</script>"
    page = Page(nasty, [Section(nasty, [Text(nasty), Table((nasty,), ((nasty,),)), Code(nasty)])])
    assert "<script" not in render(page)
    assert render(page).count("&lt;script&gt;") == 7


def test_a_value_on_a_page_stays_with_its_unit_and_a_command_as_it_is_typed() -> None:
    page = render(Page("tau_s = 0.6 ± 0.1 s", [Section("", [Text("5 mm"), Code("move 5 mm")])]))
    assert page.count("0.6\u00a0±\u00a00.1\u00a0s") == 2
    assert "5\u00a0mm" in page
    assert "move 5 mm" in page


def test_a_figure_is_svg_with_text_and_without_anything_from_outside() -> None:
    svg = figure_svg()
    assert svg.startswith("<svg")
    assert "time, s" in svg
    assert "a &lt;b&gt; &amp; c" in svg
    assert "<!DOCTYPE" not in svg
    assert "<metadata" not in svg
    assert "<image" not in svg


def test_the_same_figure_is_the_same_text() -> None:
    assert figure_svg() == figure_svg()


def test_a_page_is_written_whole_and_readable_by_others(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    page = Page("t", [Section("s", [Picture(figure_svg(), "caption"), TABLE])])
    assert write_page(page, path) == path
    written = path.read_text(encoding="utf-8")
    said = re.search(r"<footer>smad [\d.]+, (\d{4}-\d\d-\d\d \d\d:\d\d UTC)</footer>", written)
    assert said is not None
    assert written == render(page, said[1])
    assert path.stat().st_mode & 0o044 or path.stat().st_mode & 0o600
    assert list(path.parent.iterdir()) == [path]


def test_what_is_folded_away_is_under_its_title() -> None:
    inside = Fold("The file", [Code("a = 1"), Beside([[Code("left")], [Code("right")]])])
    text = render(Page("t", [Section("s", [inside]), Section("More", [TABLE], folded=True)]))
    assert "<details><summary>The file</summary>" in text
    assert text.index("<details>") < text.index("<pre>a = 1</pre>") < text.index("</details>")
    assert text.index("<pre>left</pre>") < text.index("<pre>right</pre>") < text.index("</details>")
    assert "<details><summary><h2>More</h2></summary>" in text


def test_a_figure_can_be_saved_as_svg_pdf_and_png_and_is_the_same_each_time() -> None:
    one, again = (picture(drawn(), "Force & time", "what it shows") for _ in range(2))
    assert one == again
    assert one.pdf.startswith(b"%PDF")
    assert one.name == "force-time"
    text = render(Page("t", [Section("s", [Fold("More", [one])])]))
    assert 'download="force-time.pdf" href="data:application/pdf;base64,' in text
    assert all(f'value="{kind}"' in text for kind in ("svg", "png"))
    assert "<script" in text
    assert "<script" not in render(Page("t", [Section("s", [Picture(one.svg)])]))


def test_a_page_that_cannot_be_written_names_its_path(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SmadError, match=r"file/page\.html"):
        write_page(Page("t", []), tmp_path / "file" / "page.html")


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.lists(st.floats(-1e6, 1e6), min_size=50, max_size=400), st.integers(10, 40))
def test_decimation_keeps_extremes_and_is_short(values: list[float], most: int) -> None:
    y = np.array(values)
    t = np.arange(y.size, dtype=float)
    short_t, short_y = decimated(t, y, most)
    assert short_t.size <= most + 1
    assert (short_y.min(), short_y.max()) == (y.min(), y.max())
    assert np.all(np.diff(short_t) >= 0.0)
    assert np.isin(short_y, y).all()


def test_a_pause_breaks_the_line_in_print_and_the_springs_differ_without_colours(
    tmp_path: Path,
) -> None:
    t = np.arange(3000.0) + 500.0 * (np.arange(3000) >= 1500)
    traces = [Trace("X", t, np.sin(t), "x"), Trace("Y", t, np.cos(t), "y")]
    svg = write_figure(Panels([Panel("Force", "N", 2, traces)]), tmp_path / "f.svg").read_text()
    lines = re.findall(rf'd="([^"]+)"[^>]*stroke-dasharray[^>]*stroke: {in_print("y")}', svg)
    assert len(lines) > 0
    assert max(line.count("M ") for line in lines) == 2


def test_a_gap_stays_a_gap() -> None:
    y = np.ones(10_000)
    y[4000:5000] = np.nan
    _, short = decimated(np.arange(10_000.0), y, 100)
    assert np.isnan(short).any()


def test_a_figure_of_voltages_alone_shows_them_and_one_of_nothing_is_refused(
    tmp_path: Path,
) -> None:
    x = np.arange(3.0)
    volts = Panels([Panel("Voltage", "V", 1, [Trace("X", x, x, "x")], on_demand=True)])
    assert "Voltage (V)" in write_figure(volts, tmp_path / "a.svg").read_text()
    with pytest.raises(CommandError, match="no signal"):
        write_figure(Panels([]), tmp_path / "b.svg")
