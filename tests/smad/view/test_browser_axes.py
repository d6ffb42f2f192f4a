"""The live page of a bench of several axes in Debian's chromium: tiles, one axis at a time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from bench.browser import live_page
from smad.processes.daemon import running_daemon
from smad.processes.simulator import PACED

from .browsing import (
    MISSING,
    BrowsedBench,
    arm,
    choose,
    click,
    in_a_browser,
    text_of,
    until,
)

pytestmark = in_a_browser
NAMES = ["pitch-1", "yaw-1", "pitch-2"]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BrowsedBench]:
    assert not MISSING, MISSING
    folder = tmp_path_factory.mktemp("axes")
    (folder / "bench.toml").write_text(f'[recorder]\nfolder = "{folder / "runs"}"\n')
    arguments = ["--sim", *PACED, "--axes", str(len(NAMES)), "--config", str(folder / "bench.toml")]
    with running_daemon(arguments, folder) as daemon, live_page(folder) as page:
        made = BrowsedBench(folder, daemon, page)
        with made.client:
            yield made


def tiles(driver: Any) -> dict[str, str]:
    return dict(
        driver.execute_script(
            "return [...document.querySelectorAll('#tiles button')].map("
            "(box) => [box.dataset.axis, box.textContent])"
        )
    )


def armed(bench: BrowsedBench) -> dict[str, bool]:
    return {name: motion.armed for name, motion in (bench.client.motion().axes or {}).items()}


def look_at(driver: Any, axis: str) -> None:
    click(driver, f'#tiles [data-axis="{axis}"]')
    until(driver, lambda d: text_of(d, "bench") == f"bench: {axis}")
    until(driver, lambda d: d.execute_script("return document.body.dataset.link") == "live")


def test_every_axis_has_a_tile_with_position_temperatures_and_state(page: Any) -> None:
    until(page, lambda d: all("°C" in text and "SAFE" in text for text in tiles(d).values()))
    assert list(tiles(page)) == NAMES
    assert text_of(page, "bench") == "bench: pitch-1"
    until(page, lambda d: all("–" not in text for text in tiles(d).values()))


def test_a_click_on_a_tile_shows_that_axis_and_commands_go_to_it(
    page: Any, bench: BrowsedBench
) -> None:
    arm(page)
    assert armed(bench) == dict.fromkeys(NAMES, True)
    look_at(page, "yaw-1")
    click(page, "#move button[value=go]")
    until(page, lambda d: "begun" in text_of(d, "said"))
    motions = bench.client.motion().axes or {}
    assert [name for name, motion in motions.items() if motion.running != "idle"] == ["yaw-1"]
    until(page, lambda d: "displacement" in tiles(d)["yaw-1"])
    click(page, "#stop")
    until(page, lambda d: "stopped" in text_of(d, "said"))
    assert armed(bench) == dict.fromkeys(NAMES, False)
    until(page, lambda d: all("ARMED" not in text for text in tiles(d).values()))


def test_an_axis_is_left_out_of_an_arming_by_its_box_which_keeps_the_focus(
    page: Any, bench: BrowsedBench
) -> None:
    click(page, "#arm")
    boxes = "return document.querySelectorAll('#conditions input').length"
    until(page, lambda d: d.execute_script(boxes) == len(NAMES))
    # However many statuses come, a box stays: it keeps the focus of a keyboard.
    page.execute_script(
        "window.statuses = 0; const send = WebSocket.prototype.send;"
        "WebSocket.prototype.send = function (text) {"
        "window.statuses += text.includes('alive'); return send.call(this, text); };"
        "document.querySelectorAll('#conditions input')[2].focus()"
    )
    until(page, lambda d: d.execute_script("return window.statuses") > 2)
    page.execute_script("document.activeElement.click()")
    click(page, "#arm-now")
    until(page, lambda d: text_of(d, "mode") == "ARMED")
    # The page tells of the first axis, whose board may be a sample ahead of the second.
    until(page, lambda d: armed(bench)["yaw-1"])
    assert armed(bench) == {"pitch-1": True, "yaw-1": True, "pitch-2": False}


def test_the_past_of_an_axis_is_its_own(page: Any, bench: BrowsedBench) -> None:
    look_at(page, "pitch-2")
    until(page, lambda d: d.execute_script("return document.body.dataset.time") == "live")
    # An hour reaches further back than the run log that another test may have begun.
    choose(page, "#window", "3600")
    click(page, "#pause")
    until(page, lambda d: "from memory" in text_of(d, "span"))
