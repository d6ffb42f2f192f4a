"""The supervisor as its C, compiled: what a board runs, and six times as fast as the Python.

python -m firmware_protocol.supervisor.compiled     compile it, where a C compiler is

`fastest_supervisor` gives it where there is a library of the present text, else the Python: both
decide the same, to the last bit (tests/firmware_protocol/supervisor). Its records are structures of
C with the fields of `memory`, which hold what `ranges` says and no more. Samples and setpoints go
to the library; Python carries out the other commands, which are rare, in the same memory.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from firmware_protocol.shared_library import compile_library, digest_of, open_library
from firmware_protocol.supervisor import ranges
from firmware_protocol.supervisor.limits import Limits
from firmware_protocol.supervisor.memory import Command, Measurements, Memory, members_of
from firmware_protocol.supervisor.ranges import Range, stored_limits
from firmware_protocol.supervisor.supervisor import Supervisor
from firmware_protocol.supervisor.table import LINE_COUNT

SOURCES = Path(__file__).resolve().parent
LIBRARY = SOURCES.parent / "c" / "supervisor.so"


def text_digest() -> str:
    """A name for the present text of what the C is made from."""
    return digest_of([*SOURCES.glob("*.py"), SOURCES.parent / "enums.py"])


def build_library(target: Path = LIBRARY) -> bool:
    """Translate and compile the present text to `target`; see `shared_library.compile_library`."""
    from firmware_protocol.supervisor import c_source

    files = {
        "smad_protocol.h": c_source.wire_enums(),
        "smad_supervisor.h": c_source.header(),
        "smad_supervisor.c": c_source.source(),
    }
    return compile_library(target, files, text_digest(), ("-O2",))


def _structure(name: str, members: Sequence[tuple[str, object]], spans: Mapping[str, Range]) -> Any:
    """The type of a record's structure, in the layout of `smad_supervisor.h`."""
    layout = [
        (member, _type(stored, value)) for member, value, stored in ranges.in_order(members, spans)
    ]
    return type(f"C{name}", (ctypes.Structure,), {"_fields_": layout})


def _type(stored: str, value: object) -> Any:
    kind = getattr(ctypes, f"c_{stored.removesuffix('_t')}")
    return kind * len(value) if isinstance(value, list) else kind


def _filled(structure: Any, record: Any) -> Any:
    """The structure, with the values of a record."""
    for name, value in members_of(record):
        setattr(structure, name, tuple(value) if isinstance(value, list) else value)
    return structure


class Library:
    """A library of the text with the digest `text`. Raises OSError for any other."""

    def __init__(self, path: Path, text: str) -> None:
        # The interpreter stays locked: a sample takes a microsecond.
        library = open_library(path, text, ctypes.PyDLL)
        memory = members_of(Memory(LINE_COUNT))
        self.memory_type = _structure("Memory", memory, ranges.MEMORY)
        measured = members_of(Measurements())
        self.measurements_type = _structure("Measurements", measured, ranges.MEASUREMENTS)
        self.command_type = _structure("Command", members_of(Command()), ranges.COMMAND)
        self.limits_type = _structure("Limits", stored_limits(), ranges.LIMITS)
        address, time = ctypes.c_void_p, ctypes.c_int64
        self.sample = library.smad_sv_sample
        self.sample.argtypes, self.sample.restype = [address, address, address, time], None
        self.on_setpoint = library.smad_sv_on_setpoint
        self.on_setpoint.argtypes = [address, address, address, time]
        self.on_setpoint.restype = ctypes.c_uint8


class CompiledSupervisor(Supervisor):
    """A supervisor whose samples and setpoints a library decides.

    What it is given must lie in `ranges`. Limits that do not are Python's to decide by, and must
    fit the memory all the same. They count from `set_limits` on, not when they are edited.
    """

    def __init__(self, library: Library, limits: Limits | None = None) -> None:
        self._library = library
        super().__init__(limits)
        # Kept, since the library is told where they lie.
        self._structures = (self.memory, self.measurements, self._command, self._stored)
        self._addresses = tuple(ctypes.addressof(cast(Any, record)) for record in self._structures)

    def _records(self) -> tuple[Memory, Measurements, Command]:
        made, self._stored = self._library, self._library.limits_type()
        return (
            _filled(made.memory_type(), Memory(LINE_COUNT)),
            _filled(made.measurements_type(), Measurements()),
            _filled(made.command_type(), Command()),
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
        _, measurements, *_ = self._structures
        if m is not measurements:
            _filled(measurements, m)
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
    """The compiled one where there is a library of the present text, else the one in Python."""
    return Supervisor(limits) if _LIBRARY is None else CompiledSupervisor(_LIBRARY, limits)


if __name__ == "__main__":
    if not build_library():
        print("no C compiler here: simulated boards have the supervisor in Python")
