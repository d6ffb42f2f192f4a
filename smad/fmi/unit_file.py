"""A unit of FMI as a file: what it is said to be, and its parts on disk, read within bounds."""

import re
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from smad.errors import damaged, first_line
from smad.extras import part
from smad.fmi.errors import FmiError

DESCRIPTION = "modelDescription.xml"
MOST_BYTES = 500_000_000
MOST_FILES = 20_000
MOST_DESCRIPTION_BYTES = 50_000_000
"""Unpacked. A unit comes from somebody else, and a small archive can unpack to anything."""


@dataclass(frozen=True)
class UnitFile:
    """A co-simulation unit of FMI 2.0 that runs on this machine; `described` is fmpy's record."""

    path: Path
    described: Any

    @property
    def variables(self) -> dict[str, Any]:
        """Every scalar variable, by name."""
        return {v.name: v for v in self.described.modelVariables}

    @property
    def identifier(self) -> str:
        """What its binaries are called."""
        return str(self.described.coSimulation.modelIdentifier)

    def unpack(self, folder: Path) -> None:
        """Write its parts to `folder`. Raises FmiError for an archive that is damaged."""
        try:
            with zipfile.ZipFile(self.path) as archive:
                archive.extractall(folder)
        except (zipfile.BadZipFile, zlib.error, EOFError, OSError) as error:
            raise damaged(FmiError, self.path, error) from error


def open_unit(path: Path) -> UnitFile:
    """Look at a unit without running anything of it.

    Raises FmiError for what is no whole archive or too large, another version than 2.0, a unit for
    model exchange only, or one without a binary for this machine; MissingPartError without fmpy.
    """
    fmpy = part("fmpy")
    try:
        with zipfile.ZipFile(path) as archive:
            _require_bounded(path, archive)
            version = _version(path, archive)
            names = set(archive.namelist())
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError) as error:
        raise damaged(FmiError, path, error) from error
    if version != "2.0":
        raise FmiError(
            f"{path} is of another version of FMI",
            value=version,
            limit="2.0",
            action="export it for FMI 2.0 co-simulation",
        )
    try:
        described = fmpy.read_model_description(str(path), validate=True)
    except Exception as error:  # fmpy raises bare exceptions for whatever a description may hold
        raise FmiError(
            f"{path}: {DESCRIPTION} is not valid: {first_line(error)}", action="export it again"
        ) from error
    if described.coSimulation is None:
        raise FmiError(f"{path} is for model exchange only", action="export it for co-simulation")
    _require_binary(path, _identifier(path, described.coSimulation.modelIdentifier), names, fmpy)
    return UnitFile(path, described)


def _identifier(path: Path, name: Any) -> str:
    """Return what the binaries are called. Raises FmiError for what leads out of the archive."""
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", str(name)):
        raise FmiError(
            f"{path}: its modelIdentifier is not the name of a library",
            value=str(name),
            limit="letters, digits and underscores, as FMI 2.0 says",
            action="do not run it; export it again",
        )
    return str(name)


def _require_bounded(path: Path, archive: zipfile.ZipFile) -> None:
    members = archive.infolist()
    if DESCRIPTION not in archive.namelist():
        raise FmiError(f"{path} is no FMI unit: it has no {DESCRIPTION}", action="name another")
    described = archive.getinfo(DESCRIPTION).file_size
    for counted, value, most in (
        ("files", len(members), MOST_FILES),
        ("bytes, unpacked", sum(m.file_size for m in members), MOST_BYTES),
        (f"bytes in {DESCRIPTION}", described, MOST_DESCRIPTION_BYTES),
    ):
        if value > most:
            raise FmiError(
                f"{path} is larger than a unit may be",
                value=f"{value} {counted}",
                limit=f"{most} {counted}",
                action="export it without its sources and documents",
            )


def _version(path: Path, archive: zipfile.ZipFile) -> str:
    """What the first element says; the rest may be of a version that nobody here can read."""
    with archive.open(DESCRIPTION) as file:
        try:
            _, root = next(ElementTree.iterparse(file, events=("start",)))
        except (ElementTree.ParseError, StopIteration) as error:
            raise FmiError(
                f"{path}: {DESCRIPTION} is no XML: {first_line(error)}", action="export it again"
            ) from None
    return str(root.get("fmiVersion", "unknown"))


def _require_binary(path: Path, identifier: str, names: set[str], fmpy: Any) -> None:
    binary = f"binaries/{fmpy.platform}/{identifier}{fmpy.sharedLibraryExtension}"
    if binary not in names:
        systems = sorted({n.split("/")[1] for n in names if n.startswith("binaries/") and "/" in n})
        raise FmiError(
            f"{path} has no binary for this machine",
            value=", ".join(name for name in systems if name) or "none",
            limit=fmpy.platform,
            action="export it on or for such a machine",
        )
