"""Which code was measured."""

from __future__ import annotations

import subprocess
from pathlib import Path


def commit() -> str:
    """Commit of the checkout, with "+" when files have been changed since; empty without one."""
    root = str(Path(__file__).resolve().parents[1])
    words = ("git", "-C", root, "describe", "--always", "--abbrev=12", "--exclude=*", "--dirty=+")
    try:
        said = subprocess.run(words, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return said.stdout.strip()
