"""Take a picture of the live page: `python tools/screenshot.py [--dark] [-o FILE]`.

A simulated bench follows a sinusoid; chromium draws the page of `smad view`.
"""

from __future__ import annotations

import argparse
import base64
import tempfile
import time
from pathlib import Path

from bench.browser import browser, colours, live_page, running_daemon
from smad.client import Client
from smad.client.arming import arm_when_allowed
from smad.control.commands import Sine

PICTURE = Path(__file__).resolve().parents[1] / "docs/img/live-page.png"
SHOWN_S = 30.0
SPEED = "4"
PLOTS_SHARE = 0.675
"""Of the width of the page."""


def main() -> None:
    """Move the bench, and save what the page shows of it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dark", action="store_true", help="in dark colours")
    parser.add_argument("--width", type=int, default=1200)
    parser.add_argument("--height", type=int, default=1142)
    parser.add_argument("-o", "--output", type=Path, default=PICTURE)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="smad-picture-") as name:
        folder = Path(name)
        with (
            running_daemon(folder, "--speed", SPEED, "--paced-by-host"),
            Client(folder=folder, timeout_s=60.0, lease_s=None) as client,
            live_page(folder) as page,
            browser(folder / "profile", given.width, given.height) as driver,
        ):
            arm_when_allowed(client, 60.0)
            client.move(Sine(amplitude_mm=4.0, period_s=10.0, cycles=1000))
            driver.get(page.watch)
            colours(driver, "dark" if given.dark else "light")
            began_s = client.motion().board_time_s
            while client.motion().board_time_s < began_s + float(SPEED) * SHOWN_S:
                time.sleep(0.5)
            # The column beside the plots names the folder of this bench, and is left out.
            height = driver.execute_script("return innerHeight")  # less than the window's
            clip = {"x": 0, "y": 0, "width": PLOTS_SHARE * given.width, "height": height}
            taken = driver.execute_cdp_cmd(
                "Page.captureScreenshot", {"clip": {**clip, "scale": 1}, "format": "png"}
            )
            given.output.write_bytes(base64.b64decode(taken["data"]))
            client.disarm()
    print(given.output)


if __name__ == "__main__":
    main()
