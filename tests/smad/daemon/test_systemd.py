"""The unit file, as systemd itself judges it."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

UNIT = Path(__file__).resolve().parents[3] / "smad/processes/smad@.service"
INSTALLED = "/opt/smad/bin/smad"


def verified(text: str, folder: Path) -> subprocess.CompletedProcess[str]:
    path = folder / "smad@bench.service"
    path.write_text(text)
    return subprocess.run(
        ["systemd-analyze", "verify", str(path)], capture_output=True, text=True, check=False
    )


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here")
def test_the_unit_file_is_one_that_systemd_accepts_without_a_word(tmp_path: Path) -> None:
    text = UNIT.read_text()
    assert INSTALLED in text
    # The program is not installed there on this machine; any that exists will do.
    whole = verified(text.replace(INSTALLED, sys.executable), tmp_path)
    assert (whole.returncode, whole.stdout + whole.stderr) == (0, "")
    # That it can object at all.
    broken = verified(text.replace("WatchdogSec=2", "WatchdogSec=often"), tmp_path)
    assert "Failed to parse sec value" in broken.stderr
