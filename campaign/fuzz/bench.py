"""The whole simulated bench, plant and all, on every fixture: whatever a host says, it goes on.

As `board`, but what the board applies moves the plant, and the plant gives the readings: numbers
that only the plant cannot bear are found here.
"""

from __future__ import annotations

from campaign.fuzz.board import FIXTURES, BoardHarness
from campaign.fuzz.program import Program
from firmware_protocol import messages as m
from sim_device.bench import SimulatedBench
from sim_device.board import Board


def run(data: bytes) -> None:
    """The input is the fixture, then a program: frames, a host's requests, time."""
    program = Program(data)
    BenchHarness(FIXTURES[program.u8() % len(FIXTURES)]).play(program)


class BenchHarness(BoardHarness):
    """A bench in the place of the board. Its readings are the plant's, whatever the input says."""

    def power_up(self, fixture: str) -> None:
        self.bench = SimulatedBench(fixture=fixture, seed=3)

    @property
    def board(self) -> Board:
        return self.bench.board

    def deliver(self, data: bytes) -> None:
        self.bench.receive(data)

    def sample(self) -> m.State | None:
        return self.bench.advance()
