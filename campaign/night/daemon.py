"""`python -m campaign.night.daemon start --config FILE …`: a daemon whose board is in its process.

What paces a simulated night is the hand-over of each sample between two processes: on a busy
machine each waits for a turn of the scheduler. Here board and daemon share one event loop and talk
over a socket pair, so that board time passes as quickly as the processor allows. Lines that are
written to the FIFO beside the configuration are faults to inject. The board ends with the daemon.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import socket
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from sim_device.bench import SimulatedBench
from sim_device.board import WRAP
from sim_device.faults import parse_injection
from sim_device.pty import HEATING
from smad.config import load_config
from smad.daemon.lifecycle import run
from smad.daemon.link.port import SocketTransport, Transport
from smad.daemon.process import Options
from smad.errors import PortError

FIFO = "faults"
PATIENCE = 6
"""The daemon waits so many times as long for the board as on a bench."""
SILENT_S = 0.5
"""So long a board waits for an answer; after that it goes on by itself until the host speaks."""
_LATE_S = 0.05


class BoardInLoop:
    """A simulated board that takes its next sample when the host has answered the last one."""

    def __init__(self, bench: SimulatedBench, speed: float) -> None:
        self.bench = bench
        self._speed = speed
        self._plugged = True
        self._end: socket.socket | None = None
        self._due_s = 0.0
        self._answering = False
        self._timer: asyncio.Handle | None = None
        bench.on_unplug = lambda _: self._unplug()
        bench.on_plug = self._plug

    def open(self) -> Transport:
        """Open the port, as the daemon does. Raises PortError while it is unplugged."""
        if not self._plugged:
            raise PortError("there is no such port")
        self._hang_up()
        ours, end = socket.socketpair()
        end.setblocking(False)
        self._end = end
        asyncio.get_running_loop().add_reader(end.fileno(), self._hear)
        if self._timer is None:
            self._due_s = time.monotonic()
            self._step()
        return SocketTransport(ours, "the board in this process")

    def inject(self, text: str) -> None:
        """Break something with the next sample."""
        self.bench.faults.add(replace(parse_injection(text), at_us=self.bench.now_us))

    @property
    def period_s(self) -> float:
        """Wall time from sample to sample: on a bench's clock while an arming can be confirmed."""
        supervisor = self.bench.board.supervisor
        offered_us = self.bench.board.now_us - supervisor.memory.token_us
        offered = supervisor.memory.token_valid and offered_us <= supervisor.limits.token_us
        return self.bench.period_us * 1e-6 / (1.0 if offered else self._speed)

    @property
    def wants_setpoint(self) -> bool:
        """Whether it heats and its last sample has no answer yet."""
        board = self.bench.board
        heats = board.last_mode in HEATING and board.state in HEATING
        return heats and (board.now_us - board.sp_ref_us) % WRAP != 0

    def _step(self) -> None:
        self._send(self.bench.step())
        now_s = time.monotonic()
        self._due_s += self.period_s
        if now_s - self._due_s > _LATE_S:
            self._due_s = now_s + self.period_s
        loop = asyncio.get_running_loop()
        waits = self._end is not None and self._answering
        self._answering = False
        self._timer = loop.call_later(
            SILENT_S if waits else max(0.0, self._due_s - now_s), self._step
        )

    def _hear(self) -> None:
        end = self._end
        if end is None:
            return
        try:
            data = end.recv(65_536)
        except OSError:
            data = b""
        if not data:
            self._hang_up()
            return
        self.bench.receive(data, self.bench.now_us)
        self._send(self.bench.data_to_send())
        if not self.wants_setpoint and not self._answering:
            self._answering = True
            if self._timer is not None:
                self._timer.cancel()
            loop, wait_s = asyncio.get_running_loop(), self._due_s - time.monotonic()
            self._timer = (
                loop.call_later(wait_s, self._step) if wait_s > 0.0 else loop.call_soon(self._step)
            )

    def _send(self, data: bytes) -> None:
        if self._end is not None and data:
            with contextlib.suppress(OSError):
                self._end.send(data)

    def _hang_up(self) -> None:
        if self._end is not None:
            asyncio.get_running_loop().remove_reader(self._end.fileno())
            self._end.close()
        self._end = None

    def _unplug(self) -> None:
        self._plugged = False
        self._hang_up()

    def _plug(self) -> None:
        self._plugged = True


def listen(path: Path, board: BoardInLoop) -> None:
    """Inject each line that somebody writes to the FIFO at `path`."""
    if not path.exists():
        os.mkfifo(path)
    fifo = os.open(path, os.O_RDWR | os.O_NONBLOCK)

    def read() -> None:
        for line in os.read(fifo, 4096).decode().splitlines():
            board.inject(line)

    asyncio.get_running_loop().add_reader(fifo, read)


def main(arguments: Sequence[str]) -> int:
    """Be a daemon until a signal."""
    parser = argparse.ArgumentParser()
    parser.add_argument("start")
    parser.add_argument("--bench")
    parser.add_argument("--config", type=Path, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--speed", type=float, required=True)
    options = parser.parse_args(arguments)
    config = load_config(options.config)
    bench = SimulatedBench(rate_hz=config.link.rate_hz, seed=options.seed)
    board = BoardInLoop(bench, options.speed)
    listening = False

    def opener() -> Transport:
        nonlocal listening
        if not listening:
            listen(options.config.with_name(FIFO), board)
            listening = True
        return board.open()

    # Compiled before anybody waits for it.
    SimulatedBench(rate_hz=config.link.rate_hz, seed=0).step()
    ended = run(config, {"": opener}, Options(parameter_text="", patience=PATIENCE))
    print(f"smad: {ended.line}", file=sys.stderr)
    return ended.status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
