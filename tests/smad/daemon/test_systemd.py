"""The unit files, as systemd itself judges them."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "smad/processes"
UNITS = sorted(path.name for path in FOLDER.glob("*.service"))
INSTALLED = "/opt/smad/bin/smad"


def verified(name: str, text: str, folder: Path) -> subprocess.CompletedProcess[str]:
    # The other units are beside it, as they are where they were installed.
    for unit in UNITS:
        (folder / unit).write_text(whole(unit))
    path = folder / name.replace("@", "@bench")
    path.write_text(text)
    return subprocess.run(
        ["systemd-analyze", "verify", str(path)], capture_output=True, text=True, check=False
    )


def whole(name: str) -> str:
    text = (FOLDER / name).read_text()
    assert INSTALLED in text
    # The program is not installed there on this machine; any that exists will do.
    return text.replace(INSTALLED, sys.executable)


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here")
@pytest.mark.parametrize("name", UNITS)
def test_a_unit_file_is_one_that_systemd_accepts_without_a_word(name: str, tmp_path: Path) -> None:
    done = verified(name, whole(name), tmp_path)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")
    # That it can object at all.
    broken = verified(name, whole(name).replace("RestartSec=5", "RestartSec=often"), tmp_path)
    assert "Failed to parse" in broken.stderr
