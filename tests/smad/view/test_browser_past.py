"""XY and looking back in chromium: a page whose bench is a script, with an hour of run log."""

from __future__ import annotations

import asyncio
import math
import re
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bench.browser import browser, resize
from smad.client.endpoints import FOLDER_VARIABLE
from smad.runlog.header import RunHeader
from smad.runlog.schema import Event, Row
from smad.runlog.writer import write_run
from smad.style.strips import PLACES
from smad.view.server import serving
from smad.view.source import Source
from smad.view.state import bench_state

from .browsing import MISSING, PATIENCE_S, choose, click, in_a_browser, is_live, text_of, until
from .test_forms_and_state import status

pytestmark = in_a_browser
BEGAN_S = 1_700_000_000.0
HOUR_S = 3600.0
IN_MEMORY_S = 60.0
"""The server began so long before the end of the hour."""
RATE_HZ = 20
PERIOD_S = 7.0
SPIKE_S = 1800.0


def known(t_s: float) -> Row:
    """A loop of ±2 mm over 30 to 50 °C; Y tells the time; a spike of one sample in mid-hour."""
    phase = math.tau * t_s / PERIOD_S
    return Row(
        t_s=t_s,
        host_time_s=BEGAN_S + t_s,
        displacement_mm=9.0 if t_s == SPIKE_S else 2.0 * math.sin(phase),
        rtd_x_degC=40.0 + 10.0 * math.cos(phase),
        rtd_y_degC=t_s / 100.0,
        force_N=1.0,
        mode=2,
    )


def written(folder: Path) -> Path:
    def records() -> Iterator[Row | Event]:
        for n in range(int(HOUR_S * RATE_HZ)):
            yield known(n / RATE_HZ)
        yield Event(t_s=SPIKE_S, host_time_s=BEGAN_S + SPIKE_S, kind="note", text="here it was")

    path = folder / "hour.mcap"
    write_run(path, RunHeader(source="sim", name="hour", started_unix_s=BEGAN_S), records())
    return path


async def follow(source: Source, log: Path) -> None:
    """Stands in for a daemon: the last minute of the hour has come, and nothing more comes."""
    source.log_path, source.folder = str(log), str(log.parent)
    axis = source.axis("")
    for n in range(int((HOUR_S - IN_MEMORY_S) * RATE_HZ), int(HOUR_S * RATE_HZ)):
        row = known(n / RATE_HZ)
        axis.now = tuple(getattr(row, name) for name in PLACES)
        axis.feed.add(BEGAN_S + row.t_s, axis.now)
    axis.shown, source.why_away = bench_state(status("SAFE")), ""
    while True:
        axis.heard()
        source.version += 1
        await asyncio.sleep(0.1)


@pytest.fixture(scope="module")
def links(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    assert not MISSING, MISSING
    folder = tmp_path_factory.mktemp("past")
    log = written(folder)
    ready = threading.Event()
    found: list[Any] = []

    async def serve() -> None:
        end = asyncio.Event()
        async with serving("script", 0) as made:
            found.extend((made.links, asyncio.get_running_loop(), end))
            ready.set()
            await end.wait()

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FOLDER_VARIABLE, str(folder))
        patch.setattr(Source, "run", lambda source: follow(source, log))
        thread = threading.Thread(target=lambda: asyncio.run(serve()))
        thread.start()
        assert ready.wait(PATIENCE_S)
        yield found[0]
        found[1].call_soon_threadsafe(found[2].set)
        thread.join()


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    with browser(tmp_path_factory.mktemp("profile")) as driver:
        yield driver


@pytest.fixture
def page(links: Any, chromium: Any) -> Iterator[Any]:
    resize(chromium, 1200, 1400)
    chromium.get(links.watch)
    until(chromium, is_live)
    yield chromium
    assert [entry for entry in chromium.get_log("browser") if entry["level"] == "SEVERE"] == []


LOOP = "rtd_x_degC,displacement_mm"
INK = """const box = document.querySelector(`[data-xy="${arguments[0]}"] canvas`);
const [w, h] = [box.width, box.height];
const data = box.getContext("2d").getImageData(0, 0, w, h).data;
const coloured = (x, y) => { const k = 4 * (y * w + x);
  return data[k + 3] > 0 && Math.max(data[k], data[k + 1], data[k + 2])
    - Math.min(data[k], data[k + 1], data[k + 2]) > 60; };
const plot = document.querySelector(`[data-xy="${arguments[0]}"] .u-over`);
const [left, top] = [plot.offsetLeft, plot.offsetTop];
const [across, down] = [plot.clientWidth, plot.clientHeight];
const ink = {inside: 0, ring: 0, outside: 0};
for (let x = 0; x < across; x += 1) for (let y = 0; y < down; y += 1) {
  if (!coloured(left + x, top + y)) continue;
  const r = Math.hypot((x - across / 2) / (across / 2.24), (y - down / 2) / (down / 2.24));
  ink[r < 0.93 ? "inside" : r > 1.07 ? "outside" : "ring"] += 1;
}
return ink"""
"""Coloured pixels: the axes have a room of 6 % around the loop, so its radius is known."""


def test_a_known_loop_is_drawn_as_a_ring_with_each_cycle_in_its_colour(page: Any) -> None:
    box = f"document.querySelector('[data-xy=\"{LOOP}\"]')"
    until(page, lambda d: int(d.execute_script(f"return {box}.dataset.points")) > 1100)
    ink = page.execute_script(INK, LOOP)
    assert ink["ring"] > 300
    assert ink["inside"] + ink["outside"] == 0
    cycles = page.execute_script(f"return {box}.dataset.cycles").split(",")
    assert len(cycles) == 6
    assert int(cycles[-1]) == pytest.approx(IN_MEMORY_S / PERIOD_S, abs=1)
    colours = page.execute_script(
        f"return [...{box}.querySelectorAll('.cycles b')].map((b) => b.style.color)"
    )
    assert len(set(colours)) == 6


def test_another_pair_is_drawn_once_it_is_chosen(page: Any) -> None:
    upwards = f"[data-xy='{LOOP}'] select[aria-label=Upwards]"
    page.execute_script("document.querySelector(arguments[0]).focus()", upwards)
    choose(page, upwards, "rtd_y_degC")
    # The next arrow key chooses on.
    assert page.execute_script("return document.activeElement.value") == "rtd_y_degC"
    other = "[data-xy='rtd_x_degC,rtd_y_degC']"
    until(
        page,
        lambda d: re.search(
            r"3[56]\.\d °C at \d\d\.\d °C",
            d.execute_script(
                f'return document.querySelector("{other} .values")?.textContent ?? ""'
            ),
        ),
    )
    click(page, "#reset")


def heading(driver: Any, strip: str) -> str:
    return str(
        driver.execute_script(
            "return document.querySelector(`[data-strip='${arguments[0]}'] h2`).textContent", strip
        )
    )


HEAT = "rtd_x_degC,rtd_y_degC,reference_degC"
MOTION = "displacement_mm,reference_mm"


def paused(driver: Any) -> None:
    click(driver, "#pause")
    until(driver, lambda d: d.execute_script("return document.body.dataset.past"))
    # The scroll bar reaches back to the beginning of the log once it has been looked at.
    until(
        driver,
        lambda d: (
            d.execute_script("return Number(document.getElementById('scroll').min)")
            <= BEGAN_S + 1.0
        ),
    )


def scroll_to(driver: Any, t_s: float) -> None:
    driver.execute_script(
        "const bar = document.getElementById('scroll'); bar.value = arguments[0];"
        "document.body.dataset.past = ''; bar.dispatchEvent(new Event('input'))",
        BEGAN_S + t_s,
    )
    until(driver, lambda d: d.execute_script("return document.body.dataset.past"))


def test_paused_the_page_scrolls_back_over_the_hour_of_the_log(page: Any) -> None:
    paused(page)
    for t_s in (600.0, SPIKE_S + 10.0, HOUR_S - 5.0):
        scroll_to(page, t_s)
        until(page, lambda d, t_s=t_s: f"Y {t_s / 100:.1f} °C" in heading(d, HEAT))
    assert "from run log" in text_of(page, "span")
    click(page, "#pause")
    until(page, lambda d: d.execute_script("return document.body.dataset.time") == "live")
    until(page, lambda d: "Y 36.0 °C" in heading(d, HEAT))


def test_an_hour_in_one_strip_keeps_the_spike_of_one_sample_and_its_mark(page: Any) -> None:
    paused(page)
    page.execute_script("document.body.dataset.past = ''")
    page.execute_script(
        "const list = document.getElementById('window');"
        "list.selectedIndex = 2; list.dispatchEvent(new Event('change'))"
    )
    until(page, lambda d: d.execute_script("return document.body.dataset.past"))
    until(page, lambda d: "60.0 min" in text_of(d, "span"))
    # The pointer on the spike, which is half way: its value is that of the sample.
    box = page.execute_script(
        "const box = document.querySelector(`[data-strip='${arguments[0]}'] .u-over`)"
        ".getBoundingClientRect(); return [box.left, box.top, box.width, box.height]",
        MOTION,
    )

    def swept(driver: Any) -> bool:
        seen = []
        for step in range(-6, 7):
            x = box[0] + box[2] * SPIKE_S / HOUR_S + step / 2
            move_pointer(driver, x, box[1] + box[3] / 2)
            seen.append(heading(driver, MOTION))
        return any("measured 9.00 mm" in text for text in seen)

    until(page, swept)


def test_an_hour_against_another_signal_has_its_points_and_no_lines_between_them(page: Any) -> None:
    paused(page)
    page.execute_script("document.body.dataset.past = ''")
    choose(page, "#window", "3600")
    until(page, lambda d: d.execute_script("return document.body.dataset.past"))
    until(page, lambda d: sum(d.execute_script(INK, LOOP).values()) > 100)
    click(page, "#pause")
    choose(page, "#window", "30")


SAVED = """const done = arguments[0];
URL.createObjectURL = (blob) => { blob.text().then(done); return "data:,"; };
document.querySelector("#save [data-save=svg]").click()"""


def test_in_a_saved_figure_each_unit_has_an_axis_and_time_is_in_seconds(page: Any) -> None:
    page.execute_script(
        "localStorage.setItem('smad-layout', JSON.stringify("
        "{strips: [['rtd_y_degC', 'force_N']], xy: [], tail_s: 60}))"
    )
    page.refresh()
    until(page, is_live)
    until(page, lambda d: "Y 36.0 °C" in heading(d, "rtd_y_degC,force_N"))
    svg = page.execute_async_script(SAVED)
    assert ">Spring temperature (°C)<" in svg
    assert ">Tendon force (N)<" in svg
    assert ">time (s)<" in svg
    assert {">0<", ">5<", ">30<"} <= set(re.findall(">[0-9]+<", svg))
    click(page, "#reset")


SHEET = """const done = arguments[0];
import("./style/sheet.js").then(({sheetOf}) => {
  const box = (lines) => ({title: "Force", unit: "N", x: [0, 1], y: [0, 1], lines});
  const through = sheetOf([box([{x: [0, 1], y: [-9, 10], pen: "main", label: ""}])], "s", 85);
  const labels = Array.from("ABCDEF", (run) =>
    ({x: [], y: [], pen: "main", label: `${run} measured`}));
  const keyed = sheetOf([box(labels)], "s", 85);
  done([through.items.filter(({thick}) => thick === 0.9)[0].points,
    keyed.items.filter(({words}) => /measured/.test(words)).map(({x, y}) => [x, y]), keyed.width]);
})"""


def test_a_line_ends_at_the_edge_of_a_saved_figure_and_all_names_are_in_it(page: Any) -> None:
    points, names, width = page.execute_async_script(SHEET)
    (x0, y0), (x1, y1) = points
    # A nineteenth of the way is inside: the line is as steep as it was.
    left, right = 40.0, width - 8.0
    assert (x1 - x0) / (right - left) == pytest.approx(1 / 19)
    assert y0 - y1 == pytest.approx(90.0)
    assert len({tuple(place) for place in names}) == 6
    assert all(left <= x < right - 30.0 for x, _ in names)


CLOCK = """const done = arguments[0];
import("./plot.js").then(({clock}) => done([0.02, 0.5, 5].map((step) =>
  clock(null, Array.from({length: 9}, (_, n) => 1.7e9 + n * step), 0, 0, step))))"""


def test_each_time_at_an_axis_is_told_from_the_next_at_any_zoom(page: Any) -> None:
    for labels in page.execute_async_script(CLOCK):
        assert len(set(labels)) == 9


ASLEEP = """const done = arguments[0];
const meta = {name: "smad-key", content: "k"};
document.head.append(Object.assign(document.createElement("meta"), meta));
import("./link.js").then(({Link}) => {
  const said = [], closed = [];
  window.WebSocket = class { close() { closed.push(this); } };
  const link = new Link({lost: (why) => said.push(why), late: () => said.push("late")});
  const first = link.socket;
  link.check();
  const early = said.length;
  // Its clock that nobody sets stood still.
  const now = Date.now;
  Date.now = () => now() + 7e3;
  link.check();
  Date.now = () => now() + 3.6e6;
  link.check();
  Date.now = now;
  link.open = () => {};
  done([early, said, closed.length === 1 && closed[0] === first, link.socket]);
})"""


def test_after_the_computer_slept_nothing_is_shown_as_live_and_the_page_connects_anew(
    page: Any,
) -> None:
    early, said, closed, socket = page.execute_async_script(ASLEEP)
    assert (early, closed, socket) == (0, True, None)
    # As long as the connection may carry a stop, the page lets it be pressed.
    assert said[0] == "late"
    assert "has not said anything" in said[1]


def move_pointer(driver: Any, x: float, y: float) -> None:
    driver.execute_cdp_cmd("Input.dispatchMouseEvent", {"type": "mouseMoved", "x": x, "y": y})


def test_the_cursor_shows_the_values_of_all_strips_at_its_time(page: Any) -> None:
    paused(page)
    scroll_to(page, 1000.0)
    box = page.execute_script(
        "const box = document.querySelector('.strip .u-over').getBoundingClientRect();"
        "return [box.left, box.top, box.width, box.height]"
    )
    move_pointer(page, box[0] + box[2] / 2, box[1] + box[3] / 2)
    # The middle of the 30 s before: another strip than the one under the pointer.
    until(page, lambda d: re.search(r"Y 9\.[89] °C", heading(d, HEAT)))


def test_a_span_that_is_dragged_over_is_shown_and_a_watching_page_may(page: Any) -> None:
    box = page.execute_script(
        "const box = document.querySelector('.strip .u-over').getBoundingClientRect();"
        "return [box.left, box.top, box.width, box.height]"
    )
    y = box[1] + box[3] / 2
    for kind, x in (("mousePressed", 0.5), ("mouseMoved", 0.6), ("mouseMoved", 0.7),
                    ("mouseReleased", 0.7)):  # fmt: skip
        page.execute_cdp_cmd(
            "Input.dispatchMouseEvent",
            {"type": kind, "x": box[0] + box[2] * x, "y": y, "button": "left", "clickCount": 1},
        )
    until(page, lambda d: d.execute_script("return document.body.dataset.past"))
    until(page, lambda d: re.search(r", (5\.[89]|6\.[012]) s", text_of(d, "span")))
    assert page.execute_script("return document.querySelectorAll('.command').length") == 0


A_DAY = """const done = arguments[0];
import("./data.js").then(({Data}) => {
  const names = ["displacement_mm", "force_N", "rtd_x_degC"];
  const data = new Data({channels: names.map((name) => ({name, scale: 1})), limits: {}});
  data.show(names, names, 3600, 300);
  const lengths = new Set();
  for (let n = 0; n < 10000; n += 1) {
    const t = [n * 8.64, n * 8.64 + 4];
    const y = names.map(() => [n, n]);
    data.take({whole: n === 0, from_s: t[0], t, y, now: [n, n, n],
      xy: {from_s: t[0], t, cycle: [n, n], y}});
    if (n > 500) lengths.add([data.live.t.length, data.live.xy.t.length,
      ...data.live.y.values().map((curve) => curve.length)].join());
  }
  done([...lengths]);
})"""


def test_a_day_of_frames_leaves_a_page_with_its_windows_and_no_more(page: Any) -> None:
    lengths = page.execute_async_script(A_DAY)
    assert len(lengths) <= 3
    assert all(max(map(int, one.split(","))) <= 2 * 3600 / 8.64 + 4 for one in lengths)
