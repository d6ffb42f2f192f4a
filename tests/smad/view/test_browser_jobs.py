"""Runs, jobs and experiments in chromium, on a simulated bench in a process of its own."""

from __future__ import annotations

import contextlib
import os
import re
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

from bench.browser import browser, live_page
from bench.view_stop import GOAL_MS, latencies_ms
from smad.client.arming import arm_when_allowed
from smad.control.commands import Sine

from .browsing import (
    PATIENCE_S,
    TRIES,
    BrowsedBench,
    arm,
    choose,
    click,
    in_a_browser,
    is_live,
    shown_generation,
    text_of,
    until,
)

pytestmark = in_a_browser
STOPS = 3


@pytest.fixture(scope="module")
def run(bench: BrowsedBench) -> str:
    """A short run in the folder of the bench."""
    # On a busy machine the token of an arming may expire on its way.
    arm_when_allowed(bench.client, PATIENCE_S)
    with bench.client.record("short") as log:
        bench.client.move(Sine(amplitude_mm=2.0, period_s=4.5, cycles=2))
        bench.client.wait_until_done()
    bench.client.disarm()
    return Path(log.path).name


def state_of_job(driver: Any) -> str:
    return str(driver.execute_script("return document.getElementById('job').dataset.state ?? ''"))


def ended(driver: Any) -> bool:
    return state_of_job(driver) in ("done", "failed")


def until_ended(driver: Any, bench: BrowsedBench) -> None:
    """Wait for the end of the page's job, for as long as it gets any processor time.

    A job gives way to all else, here to the other tests. Where we may, it is made their equal; and
    the page draws no curves meanwhile.
    """
    if text_of(driver, "pause") == "Pause":
        driver.execute_script("document.getElementById('pause').click()")
    taken_s, since_s = 0.0, time.monotonic()
    while not ended(driver):
        now_s = 0.0
        for process in _programs_of_job(bench):
            with contextlib.suppress(psutil.NoSuchProcess):
                now_s += sum(process.cpu_times()[:2])
                with contextlib.suppress(psutil.AccessDenied):
                    process.nice(0)
        if now_s > taken_s:
            taken_s, since_s = now_s, time.monotonic()
        assert time.monotonic() - since_s < PATIENCE_S, (taken_s, text_of(driver, "job-lines"))
        time.sleep(0.2)


def _programs_of_job(bench: BrowsedBench) -> list[psutil.Process]:
    """Return the one program that the page starts in a session of its own, and all it starts."""
    found: list[psutil.Process] = []
    for child in psutil.Process(bench.page.process.pid).children():
        with contextlib.suppress(psutil.NoSuchProcess, ProcessLookupError):
            if os.getsid(child.pid) == child.pid:
                found += child, *child.children(recursive=True)
    return found


def opened(driver: Any, section: str) -> None:
    driver.execute_script("document.getElementById(arguments[0]).open = true", section)


def press(driver: Any, run: str, what: str) -> None:
    opened(driver, "runs")
    rows = f"#runs-list tr[data-run='{run}']"
    until(driver, lambda d: d.execute_script(f'return document.querySelector("{rows}") !== null'))
    driver.execute_script(
        f'[...document.querySelectorAll("{rows} button")]'
        ".find((one) => one.textContent === arguments[0]).click()",
        what,
    )


def report_of(driver: Any) -> str:
    """Open the job's page in the way a click does, in a tab of its own; return its text."""
    ours = driver.current_window_handle
    click(driver, "#job-report")
    until(driver, lambda d: len(d.window_handles) == 2)
    driver.switch_to.window(next(one for one in driver.window_handles if one != ours))
    until(driver, lambda d: d.execute_script("return document.readyState") == "complete")
    text = str(driver.execute_script("return document.body.innerText"))
    assert driver.execute_script("return origin") == "null"
    driver.close()
    driver.switch_to.window(ours)
    return text


def test_a_run_is_listed_with_its_results_and_its_page_opens(
    page: Any, run: str, bench: BrowsedBench
) -> None:
    press(page, run, "Results")
    until(page, lambda d: "RMS error" in text_of(d, "runs-list"))
    press(page, run, "Page")
    # Until then the job of a test before is shown.
    until(page, lambda d: text_of(d, "job-title").startswith(run.removesuffix(".mcap")))
    until_ended(page, bench)
    assert state_of_job(page) == "done", text_of(page, "job-lines")
    text = report_of(page)
    assert run.removesuffix(".mcap") in text
    assert "Signals" in text


def test_a_diagnosis_that_the_page_begins_ends_in_its_report(
    page: Any, run: str, bench: BrowsedBench
) -> None:
    press(page, run, "Diagnose")
    until(page, lambda d: state_of_job(d) == "running")
    # One job at a time, and its progress is told.
    press(page, run, "Page")
    until(page, lambda d: "another job is running" in text_of(d, "said"))
    until_ended(page, bench)
    assert state_of_job(page) == "done", text_of(page, "job-lines")
    assert "nothing is missing" in text_of(page, "job-lines")
    assert "othing is missing" in report_of(page)


def test_stop_is_as_quick_and_the_job_goes_on(bench: BrowsedBench, run: str, page: Any) -> None:
    # Other tests share the processors: the best of a few says what the page itself takes.
    alone = latencies_ms(bench.folder, page, "idle", STOPS)
    # A job that is begun before the page has shown the last stop is refused, as it should be.
    until(page, lambda d: shown_generation(d) == bench.client.motion().generation)
    press(page, run, "Diagnose")
    until(page, lambda d: state_of_job(d) == "running")
    taken = latencies_ms(bench.folder, page, "idle", STOPS)
    assert taken[0] <= max(GOAL_MS, 3.0 * alone[0])
    # On a busy machine the job may have come to its own end meanwhile; no stop has ended it.
    assert "it was interrupted" not in text_of(page, "job-now"), text_of(page, "job-lines")


def test_a_job_is_ended_from_the_page(run: str, page: Any, bench: BrowsedBench) -> None:
    # On a busy machine a short job may come to its own end before the click does.
    for _ in range(TRIES):
        press(page, run, "Diagnose")
        until(page, lambda d: state_of_job(d) == "running")
        page.execute_script("document.getElementById('job-end').click()")
        until_ended(page, bench)
        if "it was interrupted" in text_of(page, "job-now"):
            return
    pytest.fail(text_of(page, "job-lines"))


def test_an_experiment_is_drawn_before_go_and_stop_ends_it(page: Any, bench: BrowsedBench) -> None:
    opened(page, "experiments")
    until(page, lambda d: "to the limit of 15 mm" in text_of(d, "experiment-preview"))
    page.execute_script(
        "const input = document.querySelector('#experiment-form [name=step_mm]');"
        "input.value = 15; input.dispatchEvent(new Event('input', {bubbles: true}))"
    )
    until(page, lambda d: "from -15.00 to 15.00 mm" in text_of(d, "experiment-preview"))
    choose(page, "#experiment", "fig11-tracking")
    until(page, lambda d: "fig11-tracking/water" in text_of(d, "experiment-preview"))
    # One that a busy machine keeps from arming, or from renewing its lease, ends by itself: again.
    for _ in range(TRIES):
        click(page, "#experiment-form button")
        until(page, lambda d: state_of_job(d) == "running")
        until(page, lambda d: "smad run" in text_of(d, "holder") or ended(d))
        if not ended(page):
            break
    click(page, "#stop")
    until(page, ended)
    assert not bench.client.motion().armed
    assert "it was interrupted" in text_of(page, "job-now"), text_of(page, "job-lines")


def test_a_motion_beyond_the_limit_is_refused_before_go(page: Any) -> None:
    choose(page, "#kind", "step")
    page.execute_script(
        "const input = document.querySelector('#move [name=displacement_mm]');"
        "input.value = 40; input.dispatchEvent(new Event('input', {bubbles: true}))"
    )
    until(page, lambda d: "up to 15 mm" in text_of(d, "move-preview"))


def test_the_preview_of_a_motion_is_drawn_anew_from_where_the_last_one_ended(page: Any) -> None:
    arm(page)
    choose(page, "#kind", "ramp")
    until(page, lambda d: "; from " in text_of(d, "move-preview"))
    click(page, "#move [value=go]")
    until(page, lambda d: "; at 2.00 mm" in text_of(d, "move-preview"))


def test_a_mark_with_a_note_stands_on_the_page_also_without_a_run_log(page: Any) -> None:
    page.execute_script("document.getElementById('note-text').value = 'all is well'")
    click(page, "#note button")
    until(page, lambda d: "nothing is being recorded" in text_of(d, "said"))
    assert re.search(r"all is well", text_of(page, "said"))


def test_the_job_ends_with_the_server(bench: BrowsedBench, run: str, tmp_path: Path) -> None:
    with live_page(bench.folder) as view, browser(tmp_path / "profile") as driver:
        driver.get(view.command)
        until(driver, is_live)
        press(driver, run, "Diagnose")
        until(driver, lambda d: state_of_job(d) == "running")
        programs = psutil.Process(view.process.pid).children(recursive=True)
        assert programs
        written = list(bench.folder.rglob("*-diagnosis*.html"))
        assert view.end() == 0
        _, alive = psutil.wait_procs(programs, timeout=PATIENCE_S)
        assert not alive
    # It was ended, and not waited for.
    assert list(bench.folder.rglob("*-diagnosis*.html")) == written


def test_no_experiment_is_begun_on_a_bench_that_is_armed_already(
    page: Any, bench: BrowsedBench
) -> None:
    arm(page)
    until(page, lambda d: "this page" in text_of(d, "holder"))
    opened(page, "experiments")
    until(page, lambda d: text_of(d, "experiment-form"))
    click(page, "#experiment-form button")
    until(page, lambda d: "a job must arm it itself" in text_of(d, "said"))
    assert state_of_job(page) != "running"
    assert bench.client.motion().armed
