"""What the tests in a browser share: whether there is one, and how a page is read and clicked.

Where there is none these tests are skipped; with SMAD_REQUIRE_BROWSER set (as in .ci/run) they fail
instead.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bench.browser import LivePage, what_is_missing
from smad.client import Client
from smad.processes.daemon import DaemonProcess

MISSING = what_is_missing()
REQUIRED = bool(os.environ.get("SMAD_REQUIRE_BROWSER"))
in_a_browser = pytest.mark.skipif(bool(MISSING) and not REQUIRED, reason=MISSING)
TRIES = 3
"""Of what a busy machine may spoil."""
PATIENCE_S = 120.0
"""Until something is there that comes within a second on a machine that is not busy."""


class BrowsedBench:
    """A daemon, its page, and a client of ours beside them."""

    def __init__(self, folder: Path, daemon: DaemonProcess, page: LivePage) -> None:
        self.folder = folder
        self.daemon = daemon
        self.page = page
        # Its worker may be held up for longer than a lease.
        self.client = Client(folder=folder, timeout_s=PATIENCE_S, lease_s=None)


def until(driver: Any, true: Callable[[Any], Any]) -> Any:
    from selenium.webdriver.support.ui import WebDriverWait

    return WebDriverWait(driver, PATIENCE_S, poll_frequency=0.05).until(true)


def text_of(driver: Any, name: str) -> str:
    return str(
        driver.execute_script("return document.getElementById(arguments[0]).textContent", name)
    )


def is_live(driver: Any) -> bool:
    return bool(driver.execute_script("return document.body.dataset.link === 'live'"))


def shown_generation(driver: Any) -> int:
    return int(driver.execute_script("return document.body.dataset.generation || -1"))


def click(driver: Any, selector: str) -> None:
    from selenium.common.exceptions import (
        ElementClickInterceptedException,
        ElementNotInteractableException,
    )
    from selenium.webdriver.common.by import By

    def clicked(driver: Any) -> bool:
        found = driver.find_element(By.CSS_SELECTOR, selector)
        if not found.is_enabled():
            return False
        driver.execute_script(
            "window.missed = true; arguments[0].addEventListener("
            "'click', () => { window.missed = false; }, {capture: true, once: true})",
            found,
        )
        try:
            found.click()
        except (ElementClickInterceptedException, ElementNotInteractableException):
            # A line that came between took its place under the pointer, or it is not drawn yet.
            return False
        # Or the line came after the browser had looked where to click, and something else got it.
        return not driver.execute_script("return window.missed === true")

    until(driver, clicked)


def arm(driver: Any) -> None:
    """Arm; once more where it is refused, as of a board that a busy machine holds up."""
    refused = "document.getElementById('said').classList"
    for _ in range(TRIES):
        driver.execute_script(f"{refused}.remove('refused')")
        click(driver, "#arm")
        click(driver, "#arm-now")
        until(
            driver,
            lambda d: (
                text_of(d, "mode") == "ARMED"
                or d.execute_script(f"return {refused}.contains('refused')")
            ),
        )
        if text_of(driver, "mode") == "ARMED":
            return
    pytest.fail(text_of(driver, "said"))


def choose(driver: Any, selector: str, value: str) -> None:
    driver.execute_script(
        "const list = document.querySelector(arguments[0]); list.value = arguments[1];"
        "list.dispatchEvent(new Event('change', {bubbles: true}))",
        selector,
        value,
    )
