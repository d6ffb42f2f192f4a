"""The inputs that are kept of a target: one archive each, the same bytes for the same inputs."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

_WHEN = (1980, 1, 1, 0, 0, 0)


def read_corpus(archive: Path) -> dict[str, bytes]:
    """Every input by name, in the order of the names; none where there is no archive."""
    if not archive.exists():
        return {}
    with zipfile.ZipFile(archive) as packed:
        return {name: packed.read(name) for name in sorted(packed.namelist())}


def write_corpus(archive: Path, inputs: Mapping[str, bytes]) -> None:
    """Keep these inputs, and no others."""
    with zipfile.ZipFile(archive, "w") as packed:
        for name in sorted(inputs):
            packed.writestr(zipfile.ZipInfo(name, _WHEN), inputs[name], zipfile.ZIP_DEFLATED)
