"""Times in the telemetry: even, rising, and with the host's clock again after any stall."""

import itertools
import random
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from firmware_protocol.messages import TimeReply
from firmware_protocol.timesync import WRAP, TimeExchanges
from sim_device.bench import SimulatedBench
from sim_device.faults import injection
from smad.daemon.telemetry.stamps import (
    AHEAD_FOR_S,
    GAP_S,
    MOST_AHEAD_S,
    MOST_RATE,
    SETTLING_S,
    Stamps,
)
from tests.smad.daemon.rig import rig_in

STEP_US = 10_000
UNIX_S = 1_700_000_000.0
SECOND_US = 1_000_000


@dataclass
class StalledLine:
    """A board, a host and the line between them on virtual time, with a machine that stalls.

    While it stalls nothing runs: the simulated board takes no samples and does not make up for
    them, so its clock falls behind; `lost_us` says by how much. Answers of the clock are late then.
    """

    seed: int = 1
    ppm: float = 40.0
    now_us: int = 5 * SECOND_US
    lost_us: int = 0
    times: TimeExchanges = field(default_factory=TimeExchanges)
    stamps: Stamps = field(default_factory=Stamps)
    published: list[tuple[float, float]] = field(default_factory=list)
    """(stamp, true Unix time at which the sample was taken) of each sample."""

    def __post_init__(self) -> None:
        self._rng = random.Random(self.seed)
        self._answer: tuple[int, TimeReply] | None = None
        self.times.begin(self.now_us)

    def board_us(self, host_us: float) -> int:
        return 3_000_000_000 + round((host_us - self.lost_us) * (1 + self.ppm * 1e-6))

    def run(self, seconds: float, *, stalls: bool = False) -> None:
        end_us = self.now_us + round(seconds * SECOND_US)
        while self.now_us < end_us:
            if stalls and self._rng.random() < 1 / 1500:
                self.stall(self._rng.randrange(20_000, 120_000))
            self.step(late=stalls and self._rng.random() < 0.3)

    def stall(self, away_us: int) -> None:
        self.now_us += away_us
        self.lost_us += away_us

    def step(self, *, late: bool) -> None:
        self.now_us += STEP_US
        if self._answer is not None and self._answer[0] <= self.now_us:
            arrived_us, reply = self._answer
            self._answer = None
            self.times.answer(reply, arrived_us)
        if self.now_us >= self.times.due_us:
            self._ask(late=late)
        self._sample(late=late)

    def _ask(self, *, late: bool) -> None:
        question = self.times.ask(self.now_us)
        most_us = 400_000 if late else 600
        there_us, back_us = (self._rng.randrange(100, most_us) for _ in range(2))
        stamp = self.board_us(self.now_us + there_us) % WRAP
        self._answer = (
            self.now_us + there_us + back_us,
            TimeReply(question.t1_us, stamp, stamp),
        )

    def _sample(self, *, late: bool) -> None:
        board_us = self.board_us(self.now_us)
        arrived_us = self.now_us + self._rng.randrange(200, 200_000 if late else 2_000)
        taken_us = self.times.host_us(board_us % WRAP, arrived_us)
        stamp_s = self.stamps.stamp(
            board_us * 1e-6,
            UNIX_S + arrived_us * 1e-6,
            None if taken_us is None else UNIX_S + taken_us * 1e-6,
        )
        self.published.append((stamp_s, UNIX_S + self.now_us * 1e-6))

    @property
    def errors_s(self) -> list[float]:
        return [stamp_s - true_s for stamp_s, true_s in self.published]


@pytest.mark.parametrize("seed", range(4))
def test_eleven_minutes_of_stalls_leave_no_trace_in_the_times(seed: int) -> None:
    line = StalledLine(seed)
    line.run(30)
    line.run(11 * 60, stalls=True)
    assert line.lost_us > 2 * SECOND_US
    # What is lost while the clocks are compared once a second, and a little.
    assert max(map(abs, line.errors_s)) < 0.5
    line.run(60)
    assert max(map(abs, line.errors_s[-1000:])) < 0.002
    stamps = [stamp_s for stamp_s, _ in line.published]
    assert all(a < b for a, b in itertools.pairwise(stamps))


async def test_the_telemetry_follows_the_host_when_the_board_lost_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    published: list[tuple[float, float]] = []
    async with rig_in(tmp_path) as rig:

        def publish(row: Any, timestamp: float, axis: str) -> None:
            published.append((timestamp, row.host_time_s))

        monkeypatch.setattr(rig.daemon.publisher, "publish", publish)
        await rig.run_for(2.0)
        for _ in range(10):
            rig.lost_us += 300_000
            await rig.run_for(0.5)
        await rig.run_for(20.0)
    assert rig.lost_us == 3_000_000
    stamp_s, host_s = published[-1]
    # The rig answers with the next sample: half of that round trip cannot be known.
    assert stamp_s == pytest.approx(host_s, abs=0.006)
    assert max(abs(stamp - host) for stamp, host in published) < 1.0
    assert all(a[0] < b[0] for a, b in itertools.pairwise(published))


async def test_a_board_that_restarts_late_makes_no_leap_in_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its clock goes back by more than half of what 32 bits hold, which looks like a step ahead."""
    bench = SimulatedBench(seed=1, clock_start_us=3_000_000_000, faults=[injection("reboot", 3.0)])
    rows: list[tuple[float, float, float]] = []
    async with rig_in(tmp_path, bench) as rig:

        def publish(row: Any, timestamp: float, axis: str) -> None:
            rows.append((row.t_s, timestamp, row.host_time_s))

        monkeypatch.setattr(rig.daemon.publisher, "publish", publish)
        await rig.run_for(8.0)
        assert "restarted" in rig.said
    assert rows[-1][0] - rows[0][0] == pytest.approx(8.0, abs=0.5)
    assert max(abs(stamp_s - host_s) for _, stamp_s, host_s in rows) < 0.2


def test_without_the_clocks_fit_stamps_are_as_even_as_board_time() -> None:
    stamps = Stamps()
    rng = random.Random(3)
    made = [stamps.stamp(n * 0.01, UNIX_S + n * 0.01 + rng.random(), None) for n in range(500)]
    assert made == pytest.approx([made[0] + n * 0.01 for n in range(500)], abs=1e-6)


def test_a_small_error_is_spread_so_thin_that_steps_stay_even() -> None:
    stamps = Stamps()
    error_s = 0.002
    made = [stamps.stamp(n * 0.01, UNIX_S + error_s, UNIX_S + n * 0.01) for n in range(6000)]
    steps = [b - a for a, b in itertools.pairwise(made)]
    assert steps == pytest.approx([0.01] * len(steps), abs=0.01 * error_s / SETTLING_S + 1e-6)
    assert made[-1] == pytest.approx(UNIX_S + 59.99, abs=1e-4)


def test_stamps_that_are_ahead_slow_down_and_never_go_back() -> None:
    stamps = Stamps()
    ahead_s = 2.0
    made = [stamps.stamp(n * 0.01, UNIX_S + ahead_s, UNIX_S + n * 0.01) for n in range(10_000)]
    steps = [b - a for a, b in itertools.pairwise(made)]
    assert min(steps) == pytest.approx(0.01 * (1 - MOST_RATE), abs=1e-6)
    assert made[-1] == pytest.approx(UNIX_S + 99.99, abs=0.01)


def test_stamps_jump_over_a_gap_and_not_over_what_is_less() -> None:
    stamps = Stamps()
    assert stamps.stamp(0.0, UNIX_S, UNIX_S) == UNIX_S
    less = stamps.stamp(0.01, 0.0, UNIX_S + 0.01 + 0.9 * GAP_S)
    assert less == pytest.approx(UNIX_S + 0.01, abs=0.001)
    assert stamps.stamp(0.02, 0.0, UNIX_S + 0.5) == UNIX_S + 0.5


def test_stamps_rise_over_a_reopened_port_and_a_board_that_begins_anew() -> None:
    stamps = Stamps()
    first = stamps.stamp(50.0, UNIX_S, None)
    assert stamps.stamp(20.0, UNIX_S + 1.0, None) == first
    stamps.restart()
    assert stamps.stamp(0.0, UNIX_S - 5.0, None) == first
    stamps.restart()
    assert stamps.stamp(0.0, UNIX_S + 5.0, None) == UNIX_S + 5.0


YEARS_S = 3e8


def leaping(leap_s: float, lasts_s: float, *, n: int = 2000) -> tuple[list[float], list[float]]:
    """Stamps and true times of 20 s at 100 Hz; from 5 s on the host's clock is off for a while."""
    stamps = Stamps()
    made, true = [], []
    for k in range(n):
        t_s = 0.01 * k
        now_s = UNIX_S + t_s + (leap_s if 5.0 <= t_s < 5.0 + lasts_s else 0.0)
        made.append(stamps.stamp(t_s, now_s, now_s))
        true.append(UNIX_S + t_s)
    return made, true


def test_stamps_come_back_from_a_leap_of_the_clock_into_the_future() -> None:
    made, true = leaping(YEARS_S, 3.0)
    assert made[600] == pytest.approx(true[600] + YEARS_S)
    back = [b - a for a, b in itertools.pairwise(made) if b < a]
    assert back == pytest.approx([-YEARS_S], abs=2.0)
    settled = round(100 * (5.0 + 3.0 + AHEAD_FOR_S)) + 2
    assert made[settled:] == pytest.approx(true[settled:], abs=1e-6)


@pytest.mark.parametrize("leap_s", [0.9 * MOST_AHEAD_S, -YEARS_S])
def test_a_short_leap_into_the_past_or_a_small_one_ahead_never_turns_stamps_back(
    leap_s: float,
) -> None:
    made, true = leaping(leap_s, 0.9 * AHEAD_FOR_S)
    assert all(a < b for a, b in itertools.pairwise(made))
    assert made[-1] - true[-1] < MOST_AHEAD_S


def test_a_port_that_is_reopened_after_the_leap_begins_with_the_clock_again() -> None:
    stamps = Stamps()
    stamps.stamp(0.0, UNIX_S + YEARS_S, None)
    stamps.restart()
    assert stamps.stamp(0.01, UNIX_S, None) == UNIX_S
    assert stamps.returned_s == YEARS_S


async def test_the_daemon_says_that_its_telemetry_came_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    published: list[tuple[float, float]] = []
    async with rig_in(tmp_path) as rig:

        def publish(row: Any, timestamp: float, axis: str) -> None:
            published.append((timestamp, row.host_time_s))

        monkeypatch.setattr(rig.daemon.publisher, "publish", publish)
        await rig.run_for(2.0)
        rig.wall_off_s = YEARS_S
        await rig.run_for(2.0)
        assert published[-1][0] - UNIX_S > 0.5 * YEARS_S
        rig.wall_off_s = 0.0
        await rig.run_for(3.0)
        assert "timestamps of telemetry went back by" in rig.said
    stamp_s, host_s = published[-1]
    assert stamp_s == pytest.approx(host_s, abs=0.05)
