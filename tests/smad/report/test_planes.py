"""Planes: which quantities are set against each other, and which cycle a sample belongs to."""

from __future__ import annotations

import io
import json
import os
import re
import zlib
from pathlib import Path

import numpy as np
import pytest
from fontTools.ttLib import TTFont

from bench.browser import browser, what_is_missing
from smad.report.page import Page, Section, render
from smad.report.panels import Panels, followed
from smad.report.planes import MOST_POINTS, QUANTITIES, Curve, Plane, cycles_of, planes_of
from smad.report.plots import draw, new_figure, picture
from smad.runlog.cycles import TURN_MM, Cycles
from smad.style.palette import in_print
from smad.view.access import REPORT_HEADERS

MISSING = what_is_missing()


def columns(n: int = 1000, cycles: int = 4) -> dict[str, np.ndarray]:
    """A run that begins at rest, goes up first, and whose loops are ellipses in temperature."""
    phase = np.linspace(0.0, 2.0 * np.pi * cycles, n)
    return {
        "t_s": np.linspace(0.0, 40.0, n),
        "reference_mm": 5.0 * np.sin(phase),
        "displacement_mm": 5.0 * np.sin(phase - 0.3),
        "force_N": 1.5 + 0.2 * np.cos(phase),
        "rtd_x_degC": 40.0 + 10.0 * np.sin(phase + 0.6),
        "rtd_y_degC": 40.0 - 10.0 * np.sin(phase + 0.6),
        "i_meas_x_A": np.maximum(0.0, np.sin(phase)),
        "i_meas_y_A": np.maximum(0.0, -np.sin(phase)),
    }


def test_a_cycle_begins_where_the_displacement_has_risen_from_its_lowest_point() -> None:
    run = columns()
    cycle = cycles_of(run)
    assert set(cycle) == {1, 2, 3, 4, 5}
    begins = np.flatnonzero(np.diff(cycle)) + 1
    lowest = run["displacement_mm"].min()
    assert run["displacement_mm"][begins] == pytest.approx(lowest + TURN_MM, abs=0.1)


def test_a_sample_has_the_same_cycle_in_a_report_as_on_the_live_page() -> None:
    run = columns()
    run["displacement_mm"] = run["displacement_mm"] + np.random.default_rng(1).normal(0, 0.03, 1000)
    live = Cycles()
    assert [live.add(value) + 1 for value in run["displacement_mm"]] == cycles_of(run).tolist()


def test_a_ripple_is_no_cycle_and_a_run_without_motion_has_one() -> None:
    run = columns()
    run["displacement_mm"] = run["displacement_mm"] + 0.1 * np.sin(np.arange(1000))
    assert cycles_of(run)[-1] == 5
    assert set(cycles_of({"t_s": np.arange(5.0)})) == {1}


def test_of_a_blocked_spring_the_temperature_defines_the_cycles() -> None:
    warm = 40.0 + 20.0 * np.sin(np.linspace(0.0, 6.0 * np.pi, 700))
    still = {"t_s": np.arange(700.0), "displacement_mm": np.zeros(700), "rtd_x_degC": warm}
    assert cycles_of(still)[-1] == 4


def test_one_run_has_its_cycles_and_several_have_their_colours() -> None:
    run = columns()
    alone = planes_of([("a", "run-1", run["t_s"], run)])
    assert [(plane.y.label, plane.x.label) for plane in alone] == [
        ("displacement", "temperature of X"),
        ("displacement", "temperature of Y"),
        ("tendon force", "displacement"),
    ]
    assert alone[0].curves[0].cycle is not None
    both = planes_of([(name, pen, run["t_s"], run) for name, pen in (("a", "x"), ("b", "y"))])
    assert [(curve.pen, curve.cycle) for curve in both[0].curves] == [("x", None), ("y", None)]


def test_what_does_not_move_has_no_plane_and_a_blocked_pair_shows_its_force() -> None:
    run = columns()
    run["displacement_mm"] = np.zeros(1000)
    run["rtd_y_degC"] = np.full(1000, 25.0)
    titles = [plane.title for plane in planes_of([("a", "run-1", run["t_s"], run)])]
    assert titles == ["Tendon force against temperature of X"]
    assert planes_of([("a", "run-1", run["t_s"], {"t_s": run["t_s"]})]) == []


def test_values_stand_in_the_page_once_and_those_of_one_moment_stay_together() -> None:
    run = columns(3 * MOST_POINTS)
    data = json.loads(Panels((), planes=planes_of([("a", "x", run["t_s"], run)])).as_json())
    assert len(data["values"]) == 6
    assert {len(values) for values in data["values"]} == {MOST_POINTS}
    curve = data["planes"][0]["curves"][0]
    x, y = (data["values"][curve[name]] for name in ("x", "y"))
    assert x == np.round(run["rtd_x_degC"][::3], 2).tolist()
    assert y == np.round(run["displacement_mm"][::3], 3).tolist()


def test_a_pause_breaks_a_loop() -> None:
    run = columns()
    run["t_s"] = run["t_s"] + 30.0 * (np.arange(1000) >= 600)
    data = json.loads(Panels((), planes=planes_of([("a", "x", run["t_s"], run)])).as_json())
    curve = data["planes"][0]["curves"][0]
    x, t, cycle = (data["values"][curve[name]] for name in ("x", "t", "cycle"))
    assert [k for k, value in enumerate(x) if value is None] == [600]
    assert len(x) == len(t) == len(cycle) == 1001
    assert t[599] == t[600] < t[601] - 30.0


def a_known_loop() -> Panels:
    """A circle of 1000 samples, and the time that it takes."""
    t = np.linspace(0.0, 10.0, 1000)
    x, y = 40.0 + 10.0 * np.cos(t), np.sin(t)
    plane = Plane(
        "Loop",
        QUANTITIES["rtd_x_degC"],
        QUANTITIES["displacement_mm"],
        [Curve(label="circle", pen="x", x=x, y=y, t=t, cycle=np.where(t < 2 * np.pi, 1, 2))],
    )
    both = {"reference_mm": y, "displacement_mm": y}
    return Panels([followed(t, both)], planes=[plane])


@pytest.mark.skipif(
    bool(MISSING) and not os.environ.get("SMAD_REQUIRE_BROWSER"), reason=MISSING or "-"
)
def test_a_browser_draws_a_known_loop_and_names_the_sample_under_the_pointer(
    tmp_path: Path,
) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    page = tmp_path / "page.html"
    page.write_text(render(Page("t", [Section("s", [a_known_loop()])])))
    with browser(tmp_path / "profile") as driver:
        driver.get(f"file://{page}")
        plane = driver.find_element(By.CSS_SELECTOR, ".plane .u-over")
        width, height = plane.size["width"], plane.size["height"]
        # The loop fills the plane but for 4 % of its range on each side.
        right, up = round(width / 2 / 1.08), round(height / 2 / 1.08)

        def said(dx: int, dy: int) -> str:
            ActionChains(driver).move_to_element_with_offset(plane, dx, dy).perform()
            return str(driver.find_element(By.CSS_SELECTOR, ".plane output").text)

        assert said(right, 0).startswith(("50.0 °C, ", "49.9 °C, "))
        assert "1.00 mm; cycle " in said(0, -up)
        # A zoom of the panels to their first half leaves the plane what belongs to it.
        strip = driver.find_element(By.CSS_SELECTOR, ".panel .u-over")
        half = round(strip.size["width"] / 2) - 2
        drag = ActionChains(driver).move_to_element_with_offset(strip, -half, 0).click_and_hold()
        drag.move_by_offset(half, 0).release().perform()
        assert "; cycle 1; 0.0 s" in said(right, 0)
        assert driver.get_log("browser") == []


def buttons(place: str) -> str:
    """Selects what saves a figure."""
    return f"{place} [data-save], {place} .save button[value], {place} .save a"


def glyphs_of(pdf: bytes) -> dict[str, bytes]:
    """The glyph of each letter, as a PDF says for whoever copies its text."""
    pairs = re.findall(rb"^<([0-9a-f]{4})> <([0-9a-f]{4})>$", pdf, re.MULTILINE)
    return {chr(int(letter, 16)): glyph for glyph, letter in pairs}


@pytest.mark.skipif(
    bool(MISSING) and not os.environ.get("SMAD_REQUIRE_BROWSER"), reason=MISSING or "-"
)
def test_panels_planes_and_pictures_are_saved_as_files_for_print(tmp_path: Path) -> None:
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.ui import WebDriverWait

    figure, (axes,) = new_figure()
    draw(axes, [0.0, 1.0], [0.0, 1.0], "a line", "x")
    page, saved = tmp_path / "page.html", tmp_path / "saved"
    blocks = [a_known_loop(), picture(figure, "A picture")]
    # The live page hands a report out under this policy, of which a file can hold a part.
    policy = REPORT_HEADERS["Content-Security-Policy"].partition("; frame-ancestors")[0]
    head = f'<head><meta http-equiv="Content-Security-Policy" content="{policy}">'
    page.write_text(render(Page("t", [Section("s", blocks)])).replace("<head>", head, 1))
    files: dict[str, bytes] = {}
    with browser(tmp_path / "profile") as driver:
        driver.get(f"file://{page}")
        driver.execute_cdp_cmd(
            "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(saved)}
        )
        for place in (".tools", ".plane", "figure:not(.panels)"):
            for button in driver.find_elements(By.CSS_SELECTOR, buttons(place)):
                kind = button.get_attribute("data-save") or button.get_attribute("value") or "pdf"
                before = {path.name for path in saved.glob("*")} if saved.exists() else set()
                driver.execute_script("arguments[0].click()", button)

                def new(_: object, before: set[str] = before, kind: str = kind) -> list[Path]:
                    return [p for p in saved.glob(f"*.{kind}") if p.name not in before]

                (path,) = WebDriverWait(driver, 60.0).until(new)
                files[f"{place} {kind}"] = path.read_bytes()
        assert driver.get_log("browser") == []
    assert len(files) == 3 + 3 + 3
    for name, data in files.items():
        begins = {"svg": b"<svg", "pdf": b"%PDF-1.", "png": b"\x89PNG"}[name.split()[-1]]
        assert data.startswith(begins), name
    strips = files[".tools svg"].decode()
    assert f'width="{85 * 72 / 25.4:.2f}pt"' in strips
    assert "Displacement (mm)" in strips
    assert strips.count("<polyline") > 4
    assert in_print("main") in strips
    # Each colour as every program writes it, also that of a cycle.
    strokes = re.findall('stroke="([^"]+)"', files[".plane svg"].decode())
    assert all(re.fullmatch("#[0-9a-f]{6}", stroke) for stroke in strokes)
    pdf = files[".tools pdf"]
    place = int(pdf.rsplit(b"startxref\n", 1)[1].split()[0])
    assert pdf[place:].startswith(b"xref")
    glyphs = glyphs_of(pdf)
    assert b"<" + b"".join(glyphs[letter] for letter in "Displacement (mm)") + b"> Tj" in pdf
    assert glyphs["Ω"] not in (glyphs["?"], glyphs["O"])
    # Publishers refuse a file without its font, and programs place a picture by its resolution.
    begin = pdf.index(b"stream\n", pdf.index(b"/Length1")) + len(b"stream\n")
    font = TTFont(io.BytesIO(pdf[begin : pdf.index(b"\nendstream", begin)]))
    assert font["maxp"].numGlyphs > len(set(glyphs.values())) > 200
    width = font["hmtx"][font.getGlyphName(int(glyphs["D"], 16))][0] / font["head"].unitsPerEm
    assert b" %d [%d]" % (int(glyphs["D"], 16), round(1000 * width)) in pdf
    png = files[".tools png"]
    assert png[37:41] == b"pHYs"
    assert int.from_bytes(png[41:45]) == round(600 / 0.0254)
    assert int.from_bytes(png[50:54]) == zlib.crc32(png[37:50])
