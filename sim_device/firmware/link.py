"""The two records of the lockstep link, as firmware/sim/link.h has them."""

from __future__ import annotations

import socket
import struct
from typing import NamedTuple

from sim_device.errors import BenchError
from sim_device.firmware.frontend import Codes

MOST_BYTES = 4096
PATIENCE_S = 60.0
_IN = struct.Struct("<II8H4Hii2IBBH")
_OUT = struct.Struct("<Q2H2BBBHHI4I4I")


class LinkError(BenchError):
    """The firmware's process ended, or does not answer."""


class Outputs(NamedTuple):
    """What the pins do after a step, the chip's time, and the bytes it sent."""

    t_us: int
    current_mA: tuple[int, int]
    pump: tuple[int, int]
    gate: int
    drain: int
    resets: int
    sample_cycles: int
    watched: tuple[int, ...]
    noinit: tuple[int, ...]
    data: bytes


def pack(
    codes: Codes, dt_us: int, data: bytes = b"", stall_us: int = 0, *, deaf: bool = False
) -> bytes:
    """Return the message that lets the firmware run for `dt_us`."""
    head = _IN.pack(
        dt_us,
        stall_us,
        *codes.analog,
        0,
        0,
        0,
        *codes.rtd,
        codes.bridge,
        codes.encoder,
        *codes.tacho_us,
        codes.inputs,
        deaf,
        len(data),
    )
    return head + data


def unpack(message: memoryview) -> tuple[Outputs, memoryview]:
    """Return the answer at the beginning of some bytes, and the bytes after it."""
    t_us, i_x, i_y, pump_x, pump_y, gate, drain, resets, size, cycles, *words = _OUT.unpack_from(
        message
    )
    end = _OUT.size + size
    out = Outputs(
        t_us,
        (i_x, i_y),
        (pump_x, pump_y),
        gate,
        drain,
        resets,
        cycles,
        tuple(words[:4]),
        tuple(words[4:]),
        bytes(message[_OUT.size : end]),
    )
    return out, message[end:]


def exchange(
    end: socket.socket,
    codes: Codes,
    dt_us: int,
    data: bytes = b"",
    stall_us: int = 0,
    *,
    deaf: bool = False,
) -> Outputs:
    """Let the firmware run for `dt_us`; `data` (at most `MOST_BYTES`) arrives at the end of it.

    Its loop hangs for `stall_us` first; with `deaf` an emulated chip's interrupts do, too.
    Raises LinkError.
    """
    try:
        end.send(pack(codes, dt_us, data, stall_us, deaf=deaf))
        message = end.recv(_OUT.size + MOST_BYTES)
    except OSError as error:
        raise LinkError(f"the firmware does not answer ({error}); start it again") from error
    if len(message) < _OUT.size:
        raise LinkError("the firmware's process ended; its last words are on standard error")
    return unpack(memoryview(message))[0]
