"""Client and diagnosis where there is no bench: macOS and Windows lack some modules of Linux."""

import subprocess
import sys

ELSEWHERE = """
import os, signal, sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name in {"fcntl", "termios", "resource", "pty", "tty", "grp", "pwd", "curses"}:
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Absent())
for module, names in ((os, ("getuid", "geteuid", "fork", "openpty")), (signal, ("SIGHUP",))):
    for name in names:
        delattr(module, name)
"""
PARTS = (
    "smad", "smad.client", "smad.cli", "smad.runlog.reader", "smad.runlog.export", "smad.diagnosis",
    "smad.diagnosis.spring_pair", "smad.checkup.files", "sim_device.plant", "smad.control.runner",
)  # fmt: skip


def test_client_run_logs_and_diagnosis_load_without_the_modules_of_linux() -> None:
    program = ELSEWHERE + "".join(f"import {part}\n" for part in PARTS)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
