"""Panels of a page: what stands in it, how long runs are thinned, and that a browser draws it."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from msgspec.structs import replace

from bench.browser import browser, colours, what_is_missing
from smad.cli.log import log
from smad.errors import RunLogError
from smad.report.page import Page, Section, render
from smad.report.panels import Panel, Panels, Trace
from smad.report.planes import Curve, Plane, Quantity
from smad.report.runs import elapsed_s, page_of, panels_of, run_parts
from smad.runlog.reader import read_run
from smad.runlog.schema import Event, Row
from smad.runlog.writer import write_run
from smad.style.decimation import Decimation
from tests.smad.runlog.helpers import HEADER, rows, write_small_run

MISSING = what_is_missing()
_ALIGNMENTS = """window.alignments = {};
const fillText = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
  window.alignments[text] = this.textAlign;
  return fillText.call(this, text, ...rest);
};"""
NASTY = "</script><script>document.title = 'mine'</script>"


def drawn(panels: Panels) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(panels.as_json())
    return found


def test_a_long_trace_keeps_the_extremes_of_each_stretch() -> None:
    x = np.arange(50_000) / 500.0
    y = np.sin(x)
    y[31_415] = 7.0
    cut = Decimation(x, 1000)
    thin = cut.thinned(y)
    assert thin.shape == cut.x.shape
    assert cut.x.size <= 1000
    assert np.all(np.diff(cut.x) > 0.0)
    assert (thin.min(), thin.max()) == (y.min(), 7.0)
    assert abs(cut.x[thin.argmax()] - x[31_415]) < 0.2


@pytest.mark.parametrize("most", [100, 10_000])
def test_a_pause_breaks_the_line(most: int) -> None:
    x = np.arange(2000) / 100.0
    x[1200:] += 30.0
    cut = Decimation(x, most)
    thin = cut.thinned(np.ones(2000))
    (at,) = np.flatnonzero(np.isnan(thin))
    assert 12.0 < cut.x[at] < 42.0
    assert np.all(np.diff(cut.x) > 0.0)


def test_traces_of_one_run_share_their_times_and_what_is_missing_is_null() -> None:
    x = np.arange(3.0)
    panel = Panel(
        "P", "mm", 1, [Trace("a", x, np.array([0.123, np.nan, 2.0]), "x"), Trace("b", x, x, "y")]
    )
    data = drawn(Panels([panel]))
    assert data["xs"] == [[0.0, 1.0, 2.0]]
    assert [trace["y"] for trace in data["panels"][0]["traces"]] == [[0.12, None, 2.0], [0, 1, 2]]


def test_a_name_cannot_leave_the_data() -> None:
    x = np.arange(2.0)
    panels = Panels([Panel(NASTY, "mm", 1, [Trace(NASTY, x, x, "x")])])
    assert drawn(panels)["panels"][0]["title"] == NASTY
    text = render(Page("t", [Section("s", [panels])]))
    assert NASTY not in text
    assert re.findall(r"""(?:src|href)=["'](?!#)""", text) == []


def test_time_runs_on_where_the_board_restarted() -> None:
    assert elapsed_s(np.array([5.0, 5.1, 5.2, 0.0, 0.1])) == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
    assert elapsed_s(np.array([])).shape == (0,)


def test_what_happened_after_a_restart_of_the_board_is_marked_there(tmp_path: Path) -> None:
    clock = [(5.0, 100.0), (5.1, 100.1), (5.2, 100.2), (0.0, 103.0), (0.1, 103.1)]
    events = [
        Event(t_s=5.1, host_time_s=100.1, kind="note", text="before"),
        Event(t_s=0.1, host_time_s=103.1, kind="note", text="after"),
    ]
    samples = [Row(t_s=t, host_time_s=h, displacement_mm=t) for t, h in clock]
    write_run(tmp_path / "run.mcap", HEADER, [*samples, *events])
    marks = panels_of(run_parts([read_run(tmp_path / "run.mcap")])).marks
    assert [mark.x for mark in marks] == pytest.approx([0.1, 0.4])


def test_a_note_after_a_restart_of_the_board_is_marked_where_it_was_made(tmp_path: Path) -> None:
    before, after = list(rows(100, 500)), list(rows(100))
    after = [replace(row, host_time_s=row.host_time_s + 6.0) for row in after]
    noted = Event(t_s=0.5, host_time_s=after[50].host_time_s, kind="note", text="cold again")
    write_run(tmp_path / "run.mcap", HEADER, [*before, *after, noted])
    (drawn,) = run_parts([read_run(tmp_path / "run.mcap")])
    (mark,) = panels_of([drawn]).marks
    assert mark.x == pytest.approx(drawn.x[150])


def two_runs(folder: Path) -> tuple[Path, Path]:
    bench = replace(HEADER, source="bench")
    write_run(folder / "real.mcap", bench, rows(100))
    return folder / "real.mcap", write_small_run(folder / "made.mcap", 300)


def test_what_was_measured_is_drawn_over_what_was_simulated(tmp_path: Path) -> None:
    runs = run_parts([read_run(path) for path in two_runs(tmp_path)])
    assert [one.name for one in runs] == ["A: made", "B: real"]
    displacement = panels_of(runs).panels[0]
    assert [trace.label for trace in displacement.traces] == ["A measured", "B measured"]
    assert len({trace.pen for trace in displacement.traces}) == 2


def test_each_quantity_has_an_axis_of_its_own_and_voltages_wait(tmp_path: Path) -> None:
    write_run(tmp_path / "run.mcap", HEADER, (replace(row, v_x_V=1.0) for row in rows(10)))
    panels = panels_of(run_parts([read_run(tmp_path / "run.mcap")])).panels
    assert [(panel.unit, panel.on_demand) for panel in panels] == [
        ("mm", False), ("N", False), ("°C", False), ("%", False), ("V", True),
    ]  # fmt: skip
    assert panels[3].traces[0].y.max() == 50.0


def test_a_pen_that_is_no_colour_is_refused() -> None:
    one = np.zeros(1)
    place = Quantity("force", "N", 2, 0.0)
    plane = Plane("loop", place, place, [Curve(label="loop", x=one, y=one, pen="leek")])
    panel = Panel("force", "N", 2, [Trace("force", one, one, "leek")])
    for block in (Panels([panel]), Panels([], planes=[plane])):
        with pytest.raises(KeyError, match="no colour is named 'leek'; there are back, "):
            block.as_json()


def test_a_part_keeps_its_time_and_an_empty_one_is_refused(tmp_path: Path) -> None:
    run = read_run(write_small_run(tmp_path / "run.mcap", 300))
    (part,) = run_parts([run], 1.0, 2.0)
    assert (part.x[0], part.x[-1]) == pytest.approx((1.0, 2.0))
    assert "too hot" in render(page_of([part]))
    with pytest.raises(RunLogError, match=r"0 to 2\.99 s"):
        run_parts([run], 50.0, 60.0)


def test_the_command_writes_a_page_beside_the_first_log(tmp_path: Path) -> None:
    real, made = two_runs(tmp_path)
    done = CliRunner().invoke(log, ["plot", str(real), str(made)])
    assert done.output.strip() == str(tmp_path / "real.html")
    assert "Runs made, real" in (tmp_path / "real.html").read_text("utf-8")


@pytest.mark.skipif(
    bool(MISSING) and not os.environ.get("SMAD_REQUIRE_BROWSER"), reason=MISSING or "-"
)
def test_a_browser_draws_zooms_and_says_the_values(tmp_path: Path) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    page = tmp_path / "page.html"
    page.write_text(render(page_of(run_parts([read_run(path) for path in two_runs(tmp_path)]))))
    with browser(tmp_path / "profile") as driver:
        driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": _ALIGNMENTS})

        def pointed() -> str:
            return str(driver.find_element(By.CSS_SELECTOR, ".tools output").text)

        colours(driver, "dark")
        driver.get(f"file://{page}")
        plot = driver.find_element(By.CSS_SELECTOR, ".u-over")
        ActionChains(driver).move_to_element(plot).perform()
        # Halfway along the longer run of 3 s; the other ended after 1 s.
        assert pointed().startswith("time (s): 1.49")
        temperature = driver.find_elements(By.CSS_SELECTOR, ".panel h3")[2].text
        assert "A X 21.5 °C" in temperature
        assert "B X – °C" in temperature
        drag = ActionChains(driver).move_to_element_with_offset(plot, -200, 0).click_and_hold()
        drag.move_by_offset(100, 0).release().move_to_element(plot).perform()
        assert pointed().startswith("time (s): 1.0")
        assert driver.title == "Runs made, real"
        page.write_text(render(page_of(run_parts([read_run(tmp_path / "made.mcap")]))))
        driver.get(f"file://{page}")
        # An event's text begins at its line; the axes before it were aligned otherwise.
        assert driver.execute_script("return window.alignments['too hot']") == "left"
        assert driver.get_log("browser") == []
