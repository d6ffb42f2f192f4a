"""The live page in Debian's chromium, on a simulated bench in a process of its own."""

from __future__ import annotations

import http.client
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from bench.browser import LivePage, credentials_of, live_page, resize
from smad.client.arming import arm_when_allowed
from smad.control.commands import Tune
from smad.runlog.reader import read_run
from smad.style.strips import LAYOUT
from smad.view.state import MODE_MEANS

from .browsing import (
    PATIENCE_S,
    BrowsedBench,
    arm,
    choose,
    click,
    in_a_browser,
    is_live,
    text_of,
    until,
)

pytestmark = in_a_browser
HOSTILE = "<img src=x onerror=hacked=1><script>hacked=1</script>"
STOP_BOX = """const box = document.getElementById("stop").getBoundingClientRect();
return [box.left, box.right, box.top]"""
GREYED = """return document.getElementById("stop").disabled
&& document.getElementById("commands").disabled
&& getComputedStyle(document.getElementById("lost")).display !== 'none'"""

AGES = """return [...document.querySelectorAll(".strip h2 .value")].map(
(reading) => getComputedStyle(reading, "::after").content)"""


def pictures(driver: Any) -> dict[str, str]:
    found: dict[str, str] = driver.execute_script(
        "return Object.fromEntries([...document.querySelectorAll('.strip:not([hidden])')].map("
        "(box) => [box.dataset.strip, box.querySelector('canvas').toDataURL()]))"
    )
    return found


def test_the_strips_move_and_show_what_the_bench_does(page: Any, bench: BrowsedBench) -> None:
    arm(page)
    page.execute_script(
        "const kind = document.getElementById('kind'); kind.value = 'sine'; kind.onchange()"
    )
    before = pictures(page)
    assert set(before) == {",".join(names) for names in LAYOUT}
    click(page, "#move button[value=go]")
    until(page, lambda d: "sine" in text_of(d, "said").lower())
    until(page, lambda d: all(now != before[name] for name, now in pictures(d).items()))
    assert bench.client.motion().running == "displacement"
    until(page, lambda d: "to the limit of 80" in d.page_source)


def test_a_page_that_is_loaded_again_goes_on_and_a_new_tab_without_a_link_does_not(
    page: Any, bench: BrowsedBench
) -> None:
    assert "token" not in page.current_url
    page.refresh()
    until(page, is_live)
    key = page.execute_script("return sessionStorage.getItem('smad-key')")
    page.execute_script("sessionStorage.clear()")
    page.refresh()
    until(page, lambda d: "open that link" in text_of(d, "lost-why"))
    assert key not in page.page_source
    page.get(bench.page.command)
    until(page, is_live)


def strip_texts(driver: Any) -> dict[str, str]:
    # A list: the driver sorts the names of an object.
    return dict(
        driver.execute_script(
            "return [...document.querySelectorAll('.strip')].map("
            "(box) => [box.dataset.strip, box.querySelector('h2').textContent])"
        )
    )


def test_a_picked_channel_is_there_after_a_reload(page: Any) -> None:
    choose(page, "#add-strip", "supply_V")
    until(page, lambda d: "supply_V" in strip_texts(d))
    choose(page, ".strip[data-strip=supply_V] .editor select", "rtd_inlet_degC")
    both = "supply_V,rtd_inlet_degC"
    until(page, lambda d: re.search(r"\d V.*\d °C", strip_texts(d).get(both, "")))
    page.execute_script(
        f'document.querySelector(\'[data-strip="{both}"] [title="Move this strip up"]\').click()'
    )
    until(page, lambda d: list(strip_texts(d)).index(both) == len(LAYOUT) - 1)
    order = list(strip_texts(page))
    page.refresh()
    until(page, is_live)
    until(page, lambda d: list(strip_texts(d)) == order)
    until(page, lambda d: re.search(r"\d V.*\d °C", strip_texts(d)[both]))
    page.execute_script('localStorage.setItem(\'smad-layout\', \'{"strips":[["gone"]],"xy":7}\')')
    page.refresh()
    until(page, is_live)
    assert list(strip_texts(page)) == [",".join(names) for names in LAYOUT]


def test_arming_takes_two_steps_and_shows_what_has_to_hold(page: Any, bench: BrowsedBench) -> None:
    click(page, "#arm")
    lines = (
        "return [...document.querySelectorAll('#conditions .holds')].map((line) => line.innerText)"
    )
    until(
        page,
        lambda d: (
            d.execute_script(lines)
            == ["The daemon knows of no obstacle", "Nobody else has exclusive control"]
        ),
    )
    assert bench.client.motion().armed is False
    click(page, "#arm-not")
    assert bench.client.motion().armed is False
    arm(page)
    assert bench.client.status().control.holder == "live page"


def test_badge_and_sentence_change_together(page: Any) -> None:
    page.execute_script(
        "window.pairs = new Set();"
        "new MutationObserver(() => window.pairs.add(['mode', 'mode-means'].map((id) =>"
        "document.getElementById(id).textContent).join(': ')))"
        ".observe(document.getElementById('state'), {childList: true, subtree: true})"
    )
    arm(page)
    click(page, "#stop")
    until(page, lambda d: text_of(d, "mode") == "SAFE")
    seen = {tuple(pair.split(": ")) for pair in page.execute_script("return [...window.pairs]")}
    assert {mode for mode, _ in seen} >= {"ARMED", "SAFE"}
    assert seen <= set(MODE_MEANS.items())


def test_stop_disarms_while_others_flood(page: Any, bench: BrowsedBench) -> None:
    arm(page)
    generation = bench.client.motion().generation
    flood = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "bench.stop_latency",
            "--flood",
            "current",
            bench.client.connection.command,
        ],
        cwd=Path(__file__).parents[3],
    )
    try:
        refused = bench.client.status().counts.refused
        until(page, lambda d: bench.client.status().counts.refused > refused + 100)
        # The page's own commands are no hindrance either.
        page.execute_script(
            "for (let n = 0; n < 40; n += 1) document.querySelector('#move button').click();"
            "document.getElementById('stop').click()"
        )
        until(page, lambda d: text_of(d, "mode") in ("COOL", "SAFE"))
        until(page, lambda d: "stopped" in text_of(d, "said"))
        assert flood.poll() is None
    finally:
        flood.kill()
        flood.wait()
    motion = bench.client.motion()
    assert not motion.armed
    assert motion.generation > generation


def test_a_gain_is_set_and_pages_show_what_is_in_force(page: Any, bench: BrowsedBench) -> None:
    page.execute_script(
        "const input = document.querySelector('#tune input[name=kp_A_per_mm]');"
        "input.value = 7; input.dispatchEvent(new Event('change'))"
    )
    until(page, lambda d: "kp_A_per_mm 7" in text_of(d, "said"))
    # Somebody else changes it, and a page that is opened later shows what is in force.
    shown = "return document.querySelector('#tune input[name=kp_A_per_mm]')?.value"
    bench.client.tune(Tune(kp_A_per_mm=6.0))
    until(page, lambda d: d.execute_script(shown) == "6")
    page.refresh()
    until(page, lambda d: d.execute_script(shown) == "6")


def write(driver: Any, name: str, text: str) -> None:
    driver.execute_script("document.getElementById(arguments[0]).value = arguments[1]", name, text)


def test_a_gain_typed_back_to_what_it_was_goes_on_showing_what_is_in_force(
    page: Any, bench: BrowsedBench
) -> None:
    gain = page.find_element("css selector", "#tune input[name=kp_A_per_mm]")
    before = gain.get_property("value")
    gain.send_keys("5", "\ue003", "\ue004")  # backspace, tab
    assert gain.get_property("value") == before
    bench.client.tune(Tune(kp_A_per_mm=5.5))
    until(page, lambda d: gain.get_property("value") == "5.5")


def test_what_a_stranger_writes_is_shown_as_text(page: Any, bench: BrowsedBench) -> None:
    with bench.client.in_control(HOSTILE, lease_s=60.0):
        until(page, lambda d: HOSTILE in text_of(d, "holder"))
    write(page, "record-name", HOSTILE)
    click(page, "#record-go")
    until(page, lambda d: ".mcap" in text_of(d, "recording"))
    write(page, "note-text", HOSTILE)
    click(page, "#note button")
    until(page, lambda d: HOSTILE in text_of(d, "said"))
    click(page, "#record-go")
    until(page, lambda d: text_of(d, "recording") == "no")
    inside = "return document.body.querySelectorAll('img, script').length"
    assert page.execute_script(inside) == 0
    assert page.execute_script("return typeof hacked") == "undefined"


def test_the_page_says_where_the_last_minute_was_written(page: Any, bench: BrowsedBench) -> None:
    path = Path(bench.client.record_last(1.0).last)
    until(page, lambda d: text_of(d, "last-minute") == f"black-box/{path.name}")


def test_a_note_goes_into_the_run_log(page: Any, bench: BrowsedBench) -> None:
    with bench.client.record("noted") as log:
        until(page, lambda d: ".mcap" in text_of(d, "recording"))
        write(page, "note-text", "all is well")
        click(page, "#note button")
        until(page, lambda d: "all is well" in text_of(d, "said"))
    assert "all is well" in [event.text for event in read_run(log.path).events]


@pytest.mark.parametrize("width", [320, 390, 768, 1600])
def test_no_width_needs_sideways_scrolling(page: Any, width: int) -> None:
    resize(page, width, 800)
    until(page, lambda d: d.execute_script("return innerWidth") == width)
    wide = "return document.documentElement.scrollWidth"
    until(page, lambda d: d.execute_script(wide) <= width)
    left, right, _ = page.execute_script(STOP_BOX)
    assert 0 <= left < right <= width
    page.execute_script("scrollTo(0, 1e6)")
    until(page, lambda d: d.execute_script("return scrollY") > 0)
    assert 0 <= page.execute_script(STOP_BOX)[2] < 200


def test_the_link_for_watching_has_stop_and_no_other_button_that_commands(
    chromium: Any, bench: BrowsedBench
) -> None:
    chromium.get(bench.page.watch)
    until(chromium, is_live)
    assert chromium.execute_script("return document.querySelectorAll('.command, #arm').length") == 0
    until(
        chromium,
        lambda d: (
            "mm" in d.execute_script("return document.querySelector('.strip .value').textContent")
        ),
    )
    arm_when_allowed(bench.client, PATIENCE_S)
    until(chromium, lambda d: text_of(d, "mode") == "ARMED")
    click(chromium, "#stop")
    until(chromium, lambda d: text_of(d, "mode") in ("COOL", "SAFE"))
    assert not bench.client.motion().armed
    bench.client.release_control()  # A stop by somebody else leaves it with who armed.


def answered(page: LivePage, path: str, **headers: str) -> tuple[int, bytes]:
    address = urlsplit(page.command)
    connection = http.client.HTTPConnection(
        address.hostname or "", address.port, timeout=PATIENCE_S
    )
    try:
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


@pytest.mark.parametrize(
    "path", ["/", "/view.js", "/style/vendor/uPlot.js", "/ws", "/?token=wrong", "/../page.py"]
)
def test_a_stranger_gets_nothing(bench: BrowsedBench, path: str) -> None:
    status, body = answered(bench.page, path)
    assert status in (401, 403)
    assert len(body) < 100


def test_who_has_the_link_gets_the_files_that_are_served_and_no_others(bench: BrowsedBench) -> None:
    cookie, key = credentials_of(bench.page.watch)
    assert key.encode() not in answered(bench.page, "/", Cookie=cookie)[1]
    assert answered(bench.page, "/view.js", Cookie=cookie)[0] == 200
    for path in ("/../page.py", "/%2e%2e/page.py", "/vendor", "/nothing", "//etc/passwd"):
        assert answered(bench.page, path, Cookie=cookie)[0] == 404
    assert answered(bench.page, "/", Cookie=cookie, Host="evil.example")[0] == 403


@pytest.mark.parametrize(
    ("origin", "has_cookie", "has_key", "status"),
    [
        ("http://evil.example", True, True, 403),
        (None, True, True, 403),
        ("ours", False, True, 401),
        ("ours", True, False, 401),
    ],
)
def test_no_connection_from_another_page_or_without_cookie_and_key(
    bench: BrowsedBench, origin: str | None, has_cookie: bool, has_key: bool, status: int
) -> None:
    address = urlsplit(bench.page.command)
    held, key = credentials_of(bench.page.command)
    cookie = {"Cookie": held} if has_cookie else {}
    offered: Any = ["smad", f"key.{key}"] if has_key else ["smad"]
    given: Any = f"http://{address.netloc}" if origin == "ours" else origin
    with (
        pytest.raises(InvalidStatus) as refused,
        connect(
            f"ws://{address.netloc}/ws",
            origin=given,
            additional_headers=cookie,
            subprotocols=offered,
        ),
    ):
        pass
    assert refused.value.response.status_code == status


def test_escape_stops_the_bench_wherever_the_focus_is(page: Any, bench: BrowsedBench) -> None:
    arm(page)
    page.find_element("css selector", "#note-text").send_keys("half a note", "\ue00c")
    until(page, lambda d: "stopped" in text_of(d, "said"))
    assert not bench.client.motion().armed


def test_why_a_command_was_refused_is_in_sight_however_far_the_page_is_scrolled(page: Any) -> None:
    resize(page, 390, 700)
    page.execute_script(
        "document.getElementById('queue').open = true;"
        "document.getElementById('queue-what').value = 'nothing';"
        "document.getElementById('queue-add').scrollIntoView()"
    )
    click(page, "#queue-add button")
    until(page, lambda d: "not done" in text_of(d, "said"))
    top, bottom, height = page.execute_script(
        "const box = document.getElementById('said').getBoundingClientRect();"
        "return [box.top, box.bottom, innerHeight]"
    )
    assert 0 < top < bottom <= height


def test_a_page_whose_daemon_is_silent_says_so_greys_its_buttons_and_comes_back_as_it_was(
    page: Any, bench: BrowsedBench
) -> None:
    choose(page, "#window", "300")
    click(page, "#pause")
    bench.daemon.process.send_signal(signal.SIGSTOP)
    try:
        until(page, lambda d: "daemon does not answer" in text_of(d, "lost-what"))
        assert page.execute_script("return document.getElementById('commands').disabled")
        # The daemon hears a stop apart from all else: the page sends it, and says what came of it.
        click(page, "#stop")
        until(page, lambda d: "not done: " in text_of(d, "said"))
        ages = page.execute_script(AGES)
        assert len(ages) >= len(LAYOUT)
        assert all(re.fullmatch(r'" \([1-9]\d* s old\)"', age) for age in ages)
    finally:
        bench.daemon.process.send_signal(signal.SIGCONT)
    until(page, is_live)
    assert not page.execute_script(GREYED)
    assert "5.0 min" in text_of(page, "span")
    assert page.execute_script("return document.body.dataset.time") == "past"
    click(page, "#pause")
    choose(page, "#window", "30")


def test_a_page_whose_server_is_gone_says_so_and_greys_its_buttons(
    chromium: Any, bench: BrowsedBench
) -> None:
    with live_page(bench.folder) as view:
        chromium.get(view.command)
        until(chromium, is_live)
        assert view.end() == 0
        until(chromium, lambda d: "Connection lost" in text_of(d, "lost-what"))
        assert chromium.execute_script(GREYED)
