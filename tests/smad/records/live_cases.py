"""The published cases that are no command on a file: plants, readers that leave, running benches.

`python -m tests.smad.records.live_cases` gives each, and prints what is said; it takes a minute.
What each must say is held by the tests of its room. Numbers are those of the list of cases.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from smad.diagnosis import diagnose
from smad.diagnosis.runs import GapRun
from smad.errors import SmadError
from tests.smad.records.cases import asked, prepare
from tests.smad.records.kinds import Heater, heated

SMAD = (sys.executable, "-m", "smad")
BENCH = "published-cases"


def changed_plant(change) -> Heater:
    class Broken(Heater):
        def simulate(self, point, run, *, fast=False):
            return change(super().simulate(point, run, fast=fast))

    return Broken()


class NoRest(Heater):
    def regimes(self, run, side):
        return {"heating": run.inputs["power_W"] > 0.5}


def failing(shown):
    raise ValueError("solver did not converge")


PLANTS = {
    "another length": changed_plant(lambda shown: {k: v[:-1] for k, v in shown.items()}),
    "lists": changed_plant(lambda shown: {k: list(v) for k, v in shown.items()}),
    "columns": changed_plant(lambda shown: {k: v[:, None] for k, v in shown.items()}),
    "no channel": changed_plant(lambda shown: {}),
    "an exception": changed_plant(failing),
    "no rest": NoRest(),
}


def plants() -> Iterator[str]:
    """Case 11: a plant that breaks its contract."""
    columns = heated().columns
    run = GapRun(
        "a",
        columns["t_s"],
        {"power_W": columns["power_W"]},
        {"temperature_degC": columns["temperature_degC"]},
    )
    for name, plant in PLANTS.items():
        try:
            said = diagnose([run], plant=plant).verdict.headline
        except SmadError as error:
            said = str(error)
        yield f"11 a plant gives {name}: {said}"


def reader_that_leaves(folder: Path) -> Iterator[str]:
    """Case 16: a result whose reader left."""
    words = asked("const").format(folder=folder)
    shell = f"{' '.join(SMAD)} {words} --json v.json | head -1; exit ${{PIPESTATUS[0]}}"
    done = run("bash", "-c", shell, folder=folder)
    size = (folder / "v.json").stat().st_size
    yield f"16 --json v.json | head -1: status {done.returncode}, v.json has {size} bytes"


def gymnasium() -> Iterator[str]:
    """Case 20: an action that a wrapper rounds beyond its range."""
    import gymnasium as gym

    import smad.envs  # noqa: F401

    single = gym.make("smad/SpringPair-v0", action="currents", episode_s=0.5)
    rescaled = gym.wrappers.RescaleAction(single, -1.0, 1.0)
    rescaled.reset(seed=0)
    rng, refused = np.random.default_rng(0), 0
    for _ in range(40):
        for kind in (np.float32, np.float64):
            try:
                ended = rescaled.step(np.clip(rng.normal(0.0, 2.0, 4), -1.0, 1.0).astype(kind))
            except SmadError:
                refused += 1
            else:
                if ended[2] or ended[3]:
                    rescaled.reset()
    yield f"20 80 rescaled actions at their ends: {refused} refused"


def run(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, capture_output=True, text=True, check=False, cwd=folder)


def smad_says(*words: str, folder: Path) -> str:
    done = run(*SMAD, *words, "--bench", BENCH, folder=folder)
    return f"{' '.join((done.stdout + done.stderr).split())[:400]} (status {done.returncode})"


@contextlib.contextmanager
def started(*words: str, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    with (folder / "log.txt").open("ab") as log:
        process = subprocess.Popen([*SMAD, *words], cwd=folder, stdout=log, stderr=log)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.kill()
            process.wait()


def wait_for(text: str, folder: Path, *, without: str = "\0", seconds: float = 120.0) -> None:
    """Wait until `smad status` says one text and not another."""
    ends = time.monotonic() + seconds
    while not (text in (said := smad_says("status", folder=folder)) and without not in said):
        if time.monotonic() > ends:
            raise TimeoutError((folder / "log.txt").read_text())
        time.sleep(0.5)


def benches(folder: Path) -> Iterator[str]:
    """Cases 19, 21, 22 and 23: a board that goes and comes back, a sensor, a daemon that ends."""
    port = str(folder / "board")
    start = ("start", "--port", port, "--bench", BENCH, "--no-realtime")
    with started("sim", "--symlink", port, folder=folder) as board:
        while not os.path.lexists(port):
            time.sleep(0.2)
        with started(*start, folder=folder) as daemon:
            wait_for("°C", folder)
            board.kill()
            board.wait()
            time.sleep(6.0)
            yield f"19 the board is gone for 6 s: {smad_says('status', folder=folder)}"
            with started("sim", "--symlink", port, folder=folder):
                wait_for("°C", folder, without=" old")
                yield f"21 its port is back: {smad_says('status', folder=folder)}"
            daemon.send_signal(signal.SIGSTOP)
            yield f"23 the daemon is stopped: {smad_says('status', folder=folder)}"
            daemon.send_signal(signal.SIGCONT)
            daemon.kill()
            daemon.wait()
            yield f"23 the daemon is killed: {smad_says('status', folder=folder)}"
    with started(
        "start",
        "--sim",
        "--fault",
        "sensor_open@30",
        "--bench",
        BENCH,
        "--no-realtime",
        folder=folder,
    ):
        wait_for("°C", folder)
        smad_says("arm", folder=folder)
        wait_for("fault", folder)
        yield f"22 a sensor is open: {smad_says('status', folder=folder)}"


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        prepare(folder)
        for cases in (plants(), reader_that_leaves(folder), gymnasium(), benches(folder)):
            for line in cases:
                print(line.replace(name, "…"), flush=True)


if __name__ == "__main__":
    main()
