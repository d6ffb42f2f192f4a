"""The live page in a real browser, for its tests and benchmarks: bench, daemon, page, chromium."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar
from urllib.request import urlopen

from smad.client.endpoints import FOLDER_VARIABLE
from smad.config import Config, LinkConfig, RecorderConfig, TelemetryConfig, config_to_toml
from smad.processes.boards import BOARDS
from smad.processes.daemon import DaemonProcess
from smad.processes.simulator import PACED, simulated_bench

_ENDS_WITHIN_S = 120.0
"""On a busy machine."""
_PROGRAMS = ("chromium", "chromedriver")
_QUIET = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)
_COUNT_FRAMES = """window.drawn = 0;
const send = WebSocket.prototype.send;
WebSocket.prototype.send = function (text) {
  if (text.includes('"drawn"')) window.drawn += 1;
  return send.call(this, text);
};
window.received = 0;
const Socket = WebSocket;
window.WebSocket = class extends Socket {
  constructor(...rest) {
    super(...rest);
    this.addEventListener("message", (event) => { window.received += event.data.length; });
  }
};"""
"""The page tells the server of each frame that it has drawn."""


def what_is_missing() -> str:
    """Return what to install for a browser to be driven here; empty when all is there."""
    if not all(map(shutil.which, _PROGRAMS)):
        return "install a browser to try the live page in: apt-get install chromium chromium-driver"
    if importlib.util.find_spec("selenium") is None:
        return "install what drives the browser: pip install '.[test]'"
    return ""


@contextlib.contextmanager
def running_daemon(
    folder: Path, *sim: str, rate_hz: Any = 100, paced: bool = False
) -> Iterator[DaemonProcess]:
    """A simulated bench and its daemon, with their sockets in `folder`.

    `paced`: they wait for each other, however long a busy machine holds one of them up.
    """
    words = [*("--rate", str(rate_hz)), *sim, *(PACED if paced else ())]
    with simulated_bench(words, folder / "tty", waiting=lambda text: None) as port:
        config = Config(
            link=LinkConfig(port=port, rate_hz=rate_hz, baud=BOARDS["python"].baud),
            recorder=RecorderConfig(folder=str(folder / "runs"), automatic=False),
            telemetry=TelemetryConfig(endpoint=""),
        )
        path = folder / "bench.toml"
        path.write_text(config_to_toml(config))
        patience = PACED[1:] if paced else ()
        daemon = DaemonProcess(["--config", str(path), *patience], folder)
        try:
            daemon.wait_until_ready()
            yield daemon
        finally:
            if daemon.process.poll() is None:
                daemon.end()


class Served:
    """A command that serves a bench on any free port: its process and the two lines it says."""

    def __init__(self, folder: Path, arguments: Sequence[str]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "smad", *arguments, "--port", "0"],
            env={**os.environ, FOLDER_VARIABLE: str(folder)},
            stdout=subprocess.PIPE,
            text=True,
            # ctrl-C at the terminal is for whoever started us.
            start_new_session=True,
        )
        assert self.process.stdout is not None
        self.said = [self.process.stdout.readline() for _ in range(2)]

    def end(self) -> int:
        """End it as ctrl-C does; return its exit status."""
        self.process.send_signal(signal.SIGINT)
        status = self.process.wait(timeout=_ENDS_WITHIN_S)
        if self.process.stdout is not None:
            self.process.stdout.close()
        return status


class LivePage(Served):
    """A running `smad view` and its links."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, ["view", "--no-browser"])
        self.command, self.watch = (line.split()[-1] for line in self.said)


@contextlib.contextmanager
def live_page(folder: Path) -> Iterator[LivePage]:
    """`smad view` of the daemon whose sockets are in `folder`."""
    with _ended(LivePage(folder)) as page:
        yield page


@contextlib.contextmanager
def served(folder: Path, arguments: Sequence[str]) -> Iterator[Served]:
    """A command such as `bridge foxglove` for the daemon whose sockets are in `folder`."""
    with _ended(Served(folder, arguments)) as made:
        yield made


S = TypeVar("S", bound=Served)


@contextlib.contextmanager
def _ended(made: S) -> Iterator[S]:
    try:
        yield made
    finally:
        if made.process.poll() is None:
            made.end()


def credentials_of(link: str) -> tuple[str, str]:
    """Open a link as a browser does; return the cookie and the key that come with the page."""
    with urlopen(link) as answer:
        cookie = answer.headers["Set-Cookie"].partition(";")[0]
        match = re.search(r'name="smad-key" content="([^"]*)"', answer.read().decode())
    assert match is not None, "the page has no place for a key"
    return cookie, match[1]


@contextlib.contextmanager
def browser(folder: Path, width: int = 1200, height: int = 1000) -> Iterator[Any]:
    """Chromium without a window; its profile is in `folder`."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for argument in (*_QUIET, f"--user-data-dir={folder}", f"--window-size={width},{height}"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=shutil.which("chromedriver"))
    driver = webdriver.Chrome(options=options, service=service)
    driver.set_script_timeout(_ENDS_WITHIN_S)
    try:
        yield driver
    finally:
        driver.quit()


def open_counting(driver: Any, page: LivePage) -> None:
    """Open the page; `frames_drawn` says from then on how many frames it has drawn."""
    driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": _COUNT_FRAMES})
    driver.get(page.command)


def frames_drawn(driver: Any) -> float:
    """Frames drawn since `open_counting`."""
    return float(driver.execute_script("return window.drawn"))


def kB_received(driver: Any) -> float:
    """What has come over the WebSocket since `open_counting`."""
    return float(driver.execute_script("return window.received")) / 1e3


def heap_MiB(driver: Any) -> float:
    """Memory of the page's objects."""
    return float(driver.execute_script("return performance.memory.usedJSHeapSize")) / 2**20


def resize(driver: Any, width: int, height: int) -> None:
    """Give the page a size, also one that no window can be made as narrow as."""
    driver.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600},
    )


def colours(driver: Any, scheme: str) -> None:
    """Make the browser ask for "dark" or "light"."""
    driver.execute_cdp_cmd(
        "Emulation.setEmulatedMedia",
        {"features": [{"name": "prefers-color-scheme", "value": scheme}]},
    )
