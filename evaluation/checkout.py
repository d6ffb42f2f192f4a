"""Which code was measured."""

from __future__ import annotations

import functools
import hashlib
import subprocess
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import sim_device.plant
import smad.checkup
import smad.control
import smad.diagnosis
from evaluation.score import first_step


def commit() -> str:
    """Commit of the checkout, with "+" when files have been changed since; empty without one."""
    root = str(Path(__file__).resolve().parents[1])
    words = ("git", "-C", root, "describe", "--always", "--abbrev=12", "--exclude=*", "--dirty=+")
    try:
        result = subprocess.run(words, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return result.stdout.strip()


@functools.cache
def source_digest(*asking: ModuleType) -> str:
    """SHA-256 over the code that a verdict depends on, and the versions of what it calculates with.

    That is the product's diagnosis and check-up, the plant, the controller of the simulated
    experiments, what is kept of a first step, and the packages that are `asking`.
    """
    h = hashlib.sha256()
    for name in ("numpy", "scipy"):
        h.update(f"{name} {version(name)}\0".encode())
    for package in (smad.diagnosis, smad.checkup, sim_device.plant, smad.control, *asking):
        folder = Path(package.__file__ or "").parent
        for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.toml")]):
            h.update(str(path.relative_to(folder)).encode() + b"\0" + path.read_bytes())
    h.update(Path(first_step.__file__).read_bytes())
    return h.hexdigest()
