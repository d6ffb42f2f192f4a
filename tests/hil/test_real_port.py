"""SMAD_HIL_PORT, tried: the firmware behind a pseudo-terminal stands for a serial line."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from sim_device.firmware.build import build, reason_to_skip
from tests.hil.conftest import PATIENCE_S

TRIED = "daemon_is_killed or signal_disarms or loses_power"
BAUD = "921600"


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Path]:
    if reason_to_skip("host"):
        pytest.skip(reason_to_skip("host"))
    name = tmp_path / "line"
    board = subprocess.Popen(
        [*build("host"), "--pty", str(name), "--store", str(tmp_path / "store")],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert board.stdout is not None
        assert board.stdout.readline().startswith("ready: /dev/")
        yield name
    finally:
        board.terminate()
        board.communicate(timeout=PATIENCE_S)
    assert not name.exists()


def test_the_suite_runs_against_the_port_that_the_environment_names(line: Path) -> None:
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-rs",
            "-n",
            "0",
            "-p",
            "no:cacheprovider",
            "tests/hil/test_bench_fails_well.py",
            "-k",
            f"port and ({TRIED})",
        ],
        cwd=Path(__file__).parents[2],
        env={**os.environ, "SMAD_HIL_PORT": str(line), "SMAD_HIL_BAUD": BAUD},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "a real board's power cannot be cut by a test" in done.stdout
    assert "2 passed, 1 skipped" in done.stdout
