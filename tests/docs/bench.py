"""A simulated bench and its daemon, running in the background while a page's commands are tried."""

import contextlib
import signal
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

START_DEADLINE_S = 240.0

FAST = ("--speed", "4", "--paced-by-host", "--patience", "20")
"""Board and daemon wait for each other, so that a busy machine makes a page slower, never wrong."""


@contextlib.contextmanager
def running_bench(
    folder: Path, env: dict[str, str], options: Sequence[str] | None
) -> Iterator[None]:
    """Run `smad start --sim` in `folder` for as long as the block lasts; nothing for None.

    Raises RuntimeError with what the daemon printed when it does not come up.
    """
    if options is None:
        yield
        return
    log = folder / "daemon.log"
    with log.open("w") as output:
        daemon = subprocess.Popen(
            ["smad", "start", "--sim", *FAST, *options],
            cwd=folder,
            env=env,
            stdout=output,
            stderr=output,
        )
        try:
            _wait_until_ready(daemon, folder, env, log)
            yield
        finally:
            daemon.send_signal(signal.SIGINT)
            try:
                daemon.wait(timeout=START_DEADLINE_S)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()


def _wait_until_ready(
    daemon: subprocess.Popen[bytes], folder: Path, env: dict[str, str], log: Path
) -> None:
    """Until it is ready and has read the parameters of every board: none is armed before."""
    deadline = time.monotonic() + START_DEADLINE_S
    while time.monotonic() < deadline and daemon.poll() is None:
        if "smad: ready: " in log.read_text():
            asked = subprocess.run(
                ["smad", "status", "--json"], cwd=folder, env=env, capture_output=True, check=False
            )
            unread = b'"params_agree":null' in asked.stdout.replace(b" ", b"")
            if asked.returncode == 0 and not unread:
                return
        time.sleep(0.02)
    raise RuntimeError(f"the daemon did not start:\n{log.read_text()}")
