"""The supervisor as its C, compiled: what a board runs, and thirty times as fast as the Python.

python -m firmware_protocol.supervisor.compiled     compile it, where a C compiler is

`fastest_supervisor` gives it where there is a library of the present text, else the Python: both
decide the same, to the last bit (tests/firmware_protocol/supervisor). Its records are structures of
C with the fields of `memory`. Samples and setpoints go to the library; Python carries out the other
commands, which are rare, in the same memory.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, cast

from firmware_protocol.supervisor import ranges
from firmware_protocol.supervisor.limits import Limits
from firmware_protocol.supervisor.memory import Command, Measurements, Memory
from firmware_protocol.supervisor.ranges import Range, stored_limits
from firmware_protocol.supervisor.supervisor import Supervisor
from firmware_protocol.supervisor.table import LINE_COUNT

SOURCES = Path(__file__).resolve().parent
C = SOURCES.parent / "c"
LIBRARY = C / "supervisor.so"
FLAGS = ("-std=c99", "-O2", "-shared", "-fPIC")


def text_digest() -> str:
    """A name for the present text: of the Python, and of the C that was made from it."""
    digest = hashlib.sha256()
    for path in sorted([*SOURCES.glob("*.py"), *C.glob("*.[ch]")]):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def build_library(target: Path = LIBRARY) -> bool:
    """Compile the library to `target`; return whether a C compiler is here (`cc`, or what CC says).

    Raises subprocess.CalledProcessError for a compiler that fails.
    """
    compiler = shutil.which(os.environ.get("CC", "cc"))
    if compiler is None:
        return False
    with tempfile.TemporaryDirectory(prefix="smad-supervisor-") as folder:
        text = Path(folder) / "text.c"
        text.write_text(f'const char smad_sv_text[] = "{text_digest()}";\n')
        made = Path(folder) / LIBRARY.name
        sources = (str(C / "smad_supervisor.c"), str(text))
        subprocess.run([compiler, *FLAGS, f"-I{C}", *sources, "-o", str(made)], check=True)
        # Whoever has an older one loaded keeps it.
        beside = target.with_suffix(".new")
        shutil.copyfile(made, beside)
        beside.replace(target)
    return True


def _structure(name: str, members: Sequence[tuple[str, object]], spans: Mapping[str, Range]) -> Any:
    """The structure of a record, in the layout of `smad_supervisor.h`."""
    return type(
        name,
        (ctypes.Structure,),
        {
            "_fields_": [
                (member, kind * len(value) if isinstance(value, list) else kind)
                for member, value, stored in ranges.in_order(members, spans)
                for kind in (getattr(ctypes, f"c_{stored.removesuffix('_t')}"),)
            ]
        },
    )


def _members(record: Any) -> list[tuple[str, object]]:
    return [(field.name, getattr(record, field.name)) for field in fields(record)]


def _filled(structure: Any, record: Any) -> Any:
    """A structure with the values of a record."""
    made = structure()
    _fill(made, record)
    return made


def _fill(structure: Any, record: Any) -> None:
    for name, value in _members(record):
        setattr(structure, name, tuple(value) if isinstance(value, list) else value)


class Library:
    """A library of the text with the digest `text`. Raises OSError for any other."""

    def __init__(self, path: Path, text: str) -> None:
        # The interpreter stays locked: a sample takes a microsecond.
        library = ctypes.PyDLL(str(path))
        try:
            built_of = (ctypes.c_char * len(text)).in_dll(library, "smad_sv_text").value
        except ValueError:
            built_of = b""
        if built_of != text.encode():
            raise OSError(f"{path} was built of another text of the supervisor")
        self.memory = _structure("Memory", _members(Memory(LINE_COUNT)), ranges.MEMORY)
        self.measurements = _structure("Measured", _members(Measurements()), ranges.MEASUREMENTS)
        self.command = _structure("Command", _members(Command()), ranges.COMMAND)
        self.limits = _structure("Limits", stored_limits(), ranges.LIMITS)
        address, time = ctypes.c_void_p, ctypes.c_int64
        self.sample = library.smad_sv_sample
        self.sample.argtypes, self.sample.restype = [address, address, address, time], None
        self.on_setpoint = library.smad_sv_on_setpoint
        self.on_setpoint.argtypes = [address, address, address, time]
        self.on_setpoint.restype = ctypes.c_uint8


class CompiledSupervisor(Supervisor):
    """A supervisor whose samples and setpoints a library decides."""

    def __init__(self, library: Library, limits: Limits | None = None) -> None:
        self._library = library
        super().__init__(limits)
        self._measured = self.measurements
        self._addresses = tuple(
            ctypes.addressof(cast(Any, record))
            for record in (self.memory, self._measured, self._command, self._stored)
        )

    def _records(self) -> tuple[Memory, Measurements, Command]:
        made, self._stored = self._library, self._library.limits()
        return (
            _filled(made.memory, Memory(LINE_COUNT)),
            _filled(made.measurements, Measurements()),
            _filled(made.command, Command()),
        )

    def set_limits(self, limits: Limits) -> None:
        """Put limits in force. With one that no board can have, Python decides."""
        super().set_limits(limits)
        self._as_compiled = all(
            span.low <= getattr(limits, name) <= span.high for name, span in ranges.LIMITS.items()
        )
        if self._as_compiled:
            for name, _ in stored_limits():
                setattr(self._stored, name, getattr(limits, name))

    def _decide_sample(self, m: Measurements, now_us: int) -> None:
        if not self._as_compiled:
            super()._decide_sample(m, now_us)
            return
        if m is not self._measured:
            _fill(self._measured, m)
        memory, measured, _, limits = self._addresses
        self._library.sample(memory, measured, limits, now_us)

    def _decide_setpoint(self, c: Command, now_us: int) -> int:
        if not self._as_compiled:
            return super()._decide_setpoint(c, now_us)
        memory, _, command, limits = self._addresses
        return int(self._library.on_setpoint(memory, limits, command, now_us))


def _shipped() -> Library | None:
    try:
        return Library(LIBRARY, text_digest())
    except OSError:
        return None


_LIBRARY = _shipped()


def fastest_supervisor(limits: Limits | None = None) -> Supervisor:
    """The fastest supervisor that is here."""
    return Supervisor(limits) if _LIBRARY is None else CompiledSupervisor(_LIBRARY, limits)


if __name__ == "__main__":
    if not build_library():
        print("no C compiler here: simulated boards have the supervisor in Python")
