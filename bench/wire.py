"""What frames cost in Python: `python -m bench.wire`."""

from __future__ import annotations

import random
import sys
import timeit
from collections.abc import Callable

import msgspec

from firmware_protocol import messages as m
from firmware_protocol.board import BoardSession
from firmware_protocol.codec import CODEC
from firmware_protocol.framing import FrameDecoder
from firmware_protocol.generate.vectors import random_message
from firmware_protocol.host import HostSession

Row = tuple[str, float, str]

ROUNDS = 7
CALLS = 5000


def rows() -> list[Row]:
    """Return (name, value, unit) of each measurement: the best of several rounds."""
    rng = random.Random(1)
    state: m.State = random_message(m.State, rng)
    setpoint: m.Setpoint = random_message(m.Setpoint, rng)
    sample = CODEC.frame(state, 1, 1)
    decoder = FrameDecoder()

    def decode() -> m.Message:
        [frame] = decoder.feed(sample)
        return CODEC.unpack(frame.type, frame.payload)

    return [
        ("encode a SETPOINT frame", _cost(lambda: CODEC.frame(setpoint, 1, 1)), "us"),
        ("decode a STATE frame", _cost(decode), "us"),
        ("encode a STATE frame", _cost(lambda: CODEC.frame(state, 1, 1)), "us"),
        ("host session: STATE in, SETPOINT out", _session_cost(state, setpoint), "us"),
    ]


def _cost(call: Callable[[], object]) -> float:
    best = min(timeit.repeat(call, number=CALLS, repeat=ROUNDS))
    return best / CALLS * 1e6


def _session_cost(state: m.State, setpoint: m.Setpoint) -> float:
    """Return the host's share of one control step, board and line left out, in µs."""
    return min(_replay(state, setpoint) for _ in range(ROUNDS)) / CALLS * 1e6


def _replay(state: m.State, setpoint: m.Setpoint) -> float:
    """Return the seconds that a host takes for `CALLS` samples, each answered by a setpoint."""
    host = HostSession(nonce=1)
    ident = msgspec.structs.replace(
        random_message(m.Ident, random.Random(2)), major=m.PROTOCOL_MAJOR, axes=1
    )
    board = BoardSession(ident=ident)
    host.connect(0)
    board.receive(host.data_to_send(), 0)
    host.receive(board.data_to_send(), 0)
    frames = []
    for index in range(CALLS):
        board.send_state(
            msgspec.structs.replace(state, axis=0, t_us=index * 2000, tick=index, valid=0)
        )
        frames.append(board.data_to_send())
    begin_s = timeit.default_timer()
    for index, frame in enumerate(frames):
        host.receive(frame, index * 2000)
        host.send_setpoint(setpoint)
        host.data_to_send()
    elapsed_s = timeit.default_timer() - begin_s
    if host.stats.states != CALLS or host.stats.setpoints_sent != CALLS:
        raise RuntimeError(f"the session took {host.stats.states} of {CALLS} samples")
    return elapsed_s


def main() -> int:
    """Print the table."""
    for name, value, unit in rows():
        sys.stdout.write(f"{name:40} {value:8.2f} {unit}\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
