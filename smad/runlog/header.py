"""The header of a run: what one has to know to use the rows, or to do the run again."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from datetime import datetime, tzinfo
from importlib import metadata
from typing import Literal

import msgspec
from msgspec import Struct

METADATA_NAME = "smad"
SCHEMA_VERSION = "1"

Source = Literal["bench", "sim", "import", "unknown"]
_PACKAGES = ("smad", "msgspec", "mcap", "numpy", "pyserial", "pyzmq")


class RunHeader(Struct, kw_only=True, frozen=True):
    """Stored as the MCAP metadata record `smad`, every field as text.

    `configuration` and `parameter_file` are the full texts (TOML), `message_schema` the JSON
    description of the wire messages, `board` what the board said of itself. `repeats` names the run
    whose inputs were played again. `axes` are the names of several axes, empty for one. Units are
    in the names.
    """

    source: Source = "unknown"
    name: str = ""
    started_unix_s: float = 0.0
    rate_hz: float | None = None
    axis: int = 0
    axis_count: int = 1
    axes: tuple[str, ...] = ()
    seed: int | None = None
    part: int = 1
    repeats: str = ""
    configuration: str = ""
    parameter_file: str = ""
    gains: dict[str, float] = {}
    versions: dict[str, str] = {}
    board: dict[str, str] = {}
    message_schema: str = ""
    notes: list[str] = []
    extra: dict[str, str] = {}

    @property
    def parameter_sha256(self) -> str:
        """Hash of the parameter file's text, in hex; empty where there is no file."""
        if not self.parameter_file:
            return ""
        return hashlib.sha256(self.parameter_file.encode()).hexdigest()

    def to_metadata(self) -> dict[str, str]:
        """The header as MCAP metadata: text to text, numbers and tables as JSON."""
        texts = {"runlog_schema": SCHEMA_VERSION, "parameter_sha256": self.parameter_sha256}
        for name in self.__struct_fields__:
            if name == "axes" and not self.axes:
                continue
            value = getattr(self, name)
            texts[name] = value if isinstance(value, str) else msgspec.json.encode(value).decode()
        return texts

    @classmethod
    def from_metadata(cls, texts: Mapping[str, str]) -> RunHeader:
        """The header back from MCAP metadata. A field that does not fit keeps its default.

        Keys of other programs, and fields that do not fit, are kept in `extra`.
        """
        values: dict[str, object] = {}
        strays: dict[str, str] = {}
        fields = {field.name: field for field in msgspec.structs.fields(cls)}
        for name, text in texts.items():
            if name in ("runlog_schema", "parameter_sha256"):
                continue
            field = fields.get(name)
            if field is None:
                strays[name] = text
                continue
            try:
                values[name] = (
                    msgspec.convert(text, field.type)
                    if field.type is str or name == "source"
                    else msgspec.json.decode(text, type=field.type)
                )
            except (msgspec.MsgspecError, ValueError, RecursionError):
                strays[name] = text
        header = msgspec.convert(values, cls)
        return msgspec.structs.replace(header, extra={**header.extra, **strays})


def header_of(header: RunHeader, axis: str) -> RunHeader:
    """Return the header of one of several axes, with the configuration of all; of one, itself."""
    if axis not in header.axes:
        return header
    prefix = f"{axis}."
    return msgspec.structs.replace(
        header,
        axes=(),
        gains={n.removeprefix(prefix): v for n, v in header.gains.items() if n.startswith(prefix)},
        board={n.removeprefix(prefix): v for n, v in header.board.items() if n.startswith(prefix)},
        extra={**header.extra, "axis": axis},
    )


def installed_versions() -> dict[str, str]:
    """Versions of Python, the kernel and the packages that a run depends on."""
    versions = {"python": platform.python_version(), "kernel": platform.release()}
    for package in _PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "not installed"
    return versions


def date_of(unix_s: float, zone: tzinfo | None = None) -> str:
    """Return a Unix time as date and time of a zone, by default of this computer; none for 0."""
    try:
        return f"{datetime.fromtimestamp(unix_s, zone):%Y-%m-%d %H:%M:%S}" if unix_s else ""
    except (OverflowError, ValueError, OSError):
        # A damaged header, or another program's, may hold what no calendar does.
        return f"{unix_s:g} s"
