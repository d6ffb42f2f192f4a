"""Random interleavings of everything that arms and stops, on virtual time, against an oracle.

python -m tests.smad.daemon.interleavings [--count 20000] [--seed 0] [--jobs 2]

Each trial draws clients that arm (all axes or one, with or without a lease), drive, stop and fall
silent; frames lost at a moment of the handshake, all along, or late; faults, cables that are
pulled, daemons that are killed; both policies. The oracle is the man in the middle of each line
(`tap`): it sees what the boards send and knows nothing of the daemon. It holds that

- at any time after the reply to a stop, the refusal of an arming or a lapse, no board sends that it
  is armed, or that current flows, for longer than 25 ms;
- in a trial in which nothing is broken no board goes into FAULT.
"""

from __future__ import annotations

import argparse
import asyncio
import random
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from campaign.virtual import Refused, VirtualLoop, result_of
from firmware_protocol import messages as wire
from firmware_protocol.enums import BoardState
from sim_device.faults import injection
from smad.config import AxisConfig, RecorderConfig, TelemetryConfig
from tests.smad.daemon.axes import lines
from tests.smad.daemon.rig import Rig, config_in
from tests.smad.daemon.tap import Tap, nothing, tapped

NAMES = ("pitch", "yaw")
MOST_US = 25_000
"""For so long a board may be armed after it was told to be off."""
WATCHDOG_US = 750_000
"""After so long the boards of a daemon that was killed have stopped by themselves."""
LEASE_US = 500_000
"""The shortest."""
SILENT = 0.15
"""Share of the trials with a lease in which it lapses."""
LEAK_LATER_US = 80_000
LEAK_US = 70_000
"""A little longer than it takes to trip."""
NOTICED_US = 45_000
"""In which a lapse is noticed and the boards have answered."""
LONGEST_SAMPLES = 2_000
CHUNK = 100

KINDS = (wire.ArmRequest, wire.ArmConfirm, wire.Disarm, wire.Setpoint, wire.Hello)
ANSWERS = (wire.ArmToken, wire.Done, wire.State, wire.FaultReport, wire.Error)


class Violation(AssertionError):
    """A board that heats and should not."""


@dataclass(eq=False)
class Grant:
    """An arming that somebody asked for and that nothing has ended."""

    names: Sequence[str]
    sent_us: int


@dataclass
class Oracle:
    """When each axis may be armed, by what was asked and replied."""

    grants: list[Grant] = field(default_factory=list)
    spans: dict[str, list[list[float]]] = field(default_factory=lambda: {n: [] for n in NAMES})
    """Of each axis: from when until when."""

    def granted(self, names: Sequence[str], now_us: int) -> Grant:
        """Somebody asks to arm these axes."""
        grant = Grant(names, now_us)
        self.grants.append(grant)
        self._follow(now_us)
        return grant

    def ended(self, grants: Sequence[Grant], now_us: int) -> None:
        """These are over: a refusal, or a stop of all."""
        self.grants = [grant for grant in self.grants if grant not in grants]
        self._follow(now_us)

    def _follow(self, now_us: int) -> None:
        for name, spans in self.spans.items():
            may = any(name in grant.names for grant in self.grants)
            is_open = bool(spans) and spans[-1][1] == float("inf")
            if may and not is_open:
                spans.append([now_us, float("inf")])
            elif is_open and not may:
                spans[-1][1] = now_us

    def check(self, name: str, heating_us: Sequence[int]) -> None:
        """Raise Violation when the board sent that it heats outside of its spans."""
        for at_us in heating_us:
            if not any(begin <= at_us <= end + MOST_US for begin, end in self.spans[name]):
                allowed = ", ".join(f"{b:.0f} to {e:.0f}" for b, e in self.spans[name])
                raise Violation(f"{name} heats at {at_us}; it may from {allowed or 'never'}")


@dataclass
class Chunk:
    """Trials one after the other on one bench, all drawn from a seed."""

    seed: str
    own: bool
    folder: Path
    counts: Counter[str] = field(default_factory=Counter)
    log: list[str] = field(default_factory=list)

    async def run(self, trials: int) -> None:
        """Run so many trials. Raises Violation with the seed, the trial and what happened in it."""
        self.rng = random.Random(self.seed)
        self.boards = {name: tapped(line) for name, line in lines(NAMES).items()}
        self.boots = 0
        await self._start()
        try:
            for number in range(trials):
                self.log.clear()
                try:
                    await self._trial()
                except Violation as violation:
                    happened = "\n  ".join([*self.log, str(violation)])
                    raise Violation(f"seed {self.seed!r}, trial {number}:\n  {happened}") from None
        finally:
            await self.rig.close()

    async def _start(self) -> None:
        axes = tuple(AxisConfig(name=n, fault_holds="own" if self.own else "all") for n in NAMES)
        self.boots += 1
        nonce = self.rng.getrandbits(32)
        # What is told to others takes time, and arms nothing.
        config = config_in(
            self.folder,
            axes=axes,
            recorder=RecorderConfig(automatic=False, black_box_s=0),
            telemetry=TelemetryConfig(enabled=False),
        )
        self.rig = Rig(config, self.boards, nonce)
        self.rig.daemon.start(without_missing=True)

    async def _trial(self) -> None:
        rng = self.rng
        self.oracle = Oracle()
        self.waiting: list[asyncio.Future[bytes]] = []
        self.later: list[tuple[int, Callable[[], None]]] = []
        self.lease: dict[str, str] = {}
        self.heard_us = self.dry_us = 0
        self.broken = False
        for line in self.boards.values():
            line.tap = Tap()
        self._spoil()
        samples = rng.randrange(20, 64) if self.broken else rng.randrange(8, 28)
        moments = sorted(rng.randrange(samples) for _ in range(rng.randrange(2, 6)))
        self.counts["trials"] += 1
        for sample in range(samples):
            while moments and moments[0] <= sample:
                moments.pop(0)
                await self._something()
            await self._sample()
        await self._end()

    async def _sample(self) -> None:
        await self.rig.sample()
        now_us = self.rig.now_us()
        due = [entry for entry in self.later if entry[0] <= now_us]
        self.later = [entry for entry in self.later if entry[0] > now_us]
        for _, work in due:
            work()

    # What happens

    def _spoil(self) -> None:
        """Draw what the lines lose in this trial."""
        rng = self.rng
        drawn = rng.random()
        if drawn < 0.6:
            return
        self.broken = True
        now_us = self.rig.now_us()
        for name in rng.sample(NAMES, rng.randrange(1, 3)):
            tap = self.boards[name].tap
            if drawn < 0.75:
                kind, answer = rng.choice(KINDS), rng.choice(ANSWERS)
                copies, first = rng.choice((1, 2, 3, 1000)), rng.random() < 0.5
                self.log.append(f"{name} loses {copies} {(kind if first else answer).__name__}")
                if first:
                    tap.to_board = _losing(kind, copies)
                else:
                    tap.to_host = _losing(answer, copies)
            elif drawn < 0.9:
                share = rng.choice((0.3, 0.5, 0.7))
                self.log.append(f"{name} loses {share:.0%}")
                tap.to_board = tap.to_host = lambda _, share=share: rng.random() < share
            else:
                tap.late_until_us = now_us + rng.randrange(20_000, 900_000)
                self.log.append(f"{name} hears late, by {(tap.late_until_us - now_us) / 1e6:.2f} s")

    async def _something(self) -> None:
        rng = self.rng
        # Replies that were sent are noted before anything else is asked.
        await asyncio.sleep(0)
        drawn = rng.random()
        if drawn < 0.42:
            self._arm()
        elif drawn < 0.60:
            self._stop()
        elif drawn < 0.72:
            self._ask("current", rng.choice(("ada", "bob")), rng.choice(NAMES), i_x_A=0.2)
        elif drawn < 0.82:
            self._take_control()
        elif drawn < 0.92:
            self._break(rng.choice(NAMES))
        elif drawn < 0.95:
            self._pull_the_plug(rng.choice(NAMES))
        elif drawn < 0.965:
            await self._kill()
        else:
            self._ask("motion", "bob")

    def _arm(self) -> None:
        rng = self.rng
        names = rng.choice((NAMES, NAMES[:1], NAMES[1:]))
        client = rng.choice(("ada", "bob"))
        grant = self.oracle.granted(names, self.rig.now_us())
        reply = self._ask("arm", client, list(names))
        rig = self.rig

        def told(future: asyncio.Future[bytes]) -> None:
            if rig is not self.rig or future.cancelled():
                return
            try:
                result_of(future.result())
            except Refused as refused:
                self.counts[f"arm: {refused.reason}"] += 1
                self.log.append(f"{rig.now_us()}: arm refused: {refused}")
                self.oracle.ended([grant], rig.now_us())
            else:
                self.counts["arm: armed"] += 1
                self.log.append(f"{rig.now_us()}: armed")

        reply.add_done_callback(told)

    def _stop(self, client: str = "bob") -> asyncio.Future[bytes]:
        reply = self._ask("disarm", client)
        rig = self.rig

        def told(future: asyncio.Future[bytes]) -> None:
            if rig is not self.rig or future.cancelled():
                return
            try:
                armed = result_of(future.result())["armed"]
            except Refused as refused:
                self.counts[f"stop: {refused.reason}"] += 1
                self.log.append(f"{rig.now_us()}: stop: {refused}")
                if refused.reason == "no_reply":
                    # It says itself that a board has not confirmed.
                    return
            else:
                self.counts["stop: stopped"] += 1
                self.log.append(f"{rig.now_us()}: stopped")
                if armed:
                    raise Violation("the reply to a stop says armed")
            self.oracle.ended(self.oracle.grants, rig.now_us())

        reply.add_done_callback(told)
        return reply

    def _take_control(self) -> None:
        reply = self._ask("control.take", "ada", name="Ada", lease_s=LEASE_US * 1e-6)

        def told(future: asyncio.Future[bytes]) -> None:
            if not future.cancelled() and b"result" in future.result():
                self.lease = {"lease": result_of(future.result())["lease"]}
                self._heard()

        reply.add_done_callback(told)

    def _heard(self) -> None:
        self.heard_us = self.rig.now_us()
        slack_us = 1_000_000 if self.broken else NOTICED_US
        heard_us, lease = self.heard_us, self.lease

        def lapsed() -> None:
            if self.heard_us == heard_us and self.lease == lease and lease:
                self.counts["lapses"] += 1
                self.log.append(f"{self.rig.now_us()}: Ada's lease has lapsed")
                self.lease = {}
                before_us = heard_us + LEASE_US
                over = [grant for grant in self.oracle.grants if grant.sent_us <= before_us]
                self.oracle.ended(over, self.rig.now_us())

        self.later.append((heard_us + LEASE_US + slack_us, lapsed))

    def _break(self, name: str) -> None:
        self.broken = True
        bench = self.boards[name].bench
        at_s = bench.now_us * 1e-6 + self.rng.randrange(LEAK_LATER_US) * 1e-6
        self.counts["faults"] += 1
        self.log.append(f"{self.rig.now_us()}: {name} gets a leak at {at_s:.3f} s of its board")
        bench.faults.add(injection("leak", at_s, lasts=LEAK_US * 1e-6))
        self.dry_us = max(self.dry_us, self.rig.now_us() + LEAK_LATER_US + LEAK_US)

    def _pull_the_plug(self, name: str) -> None:
        self.broken = True
        self.counts["cables pulled"] += 1
        self.log.append(f"{self.rig.now_us()}: {name} is pulled")
        line = self.boards[name]
        line.pull_the_plug()
        self.later.append((self.rig.now_us() + self.rng.randrange(300_000), line.plug_in))

    async def _kill(self) -> None:
        self.broken = True
        self.counts["daemons killed"] += 1
        self.log.append(f"{self.rig.now_us()}: the daemon is killed")
        before, now_us = list(self.oracle.grants), self.rig.now_us()
        rig, self.rig = self.rig, None  # type: ignore[assignment]
        await rig.close()
        self.lease = {}
        await self._start()
        self.later.append((now_us + WATCHDOG_US, lambda: self._over(before)))

    def _over(self, grants: Sequence[Grant]) -> None:
        self.oracle.ended(grants, self.rig.now_us())

    def _ask(
        self, method: str, client: str, axis: str | list[str] | None = None, **params: Any
    ) -> asyncio.Future[bytes]:
        members: dict[str, Any] = {} if axis is None else {"axis": axis}
        if client == "ada" and self.lease:
            members |= self.lease
            self._heard()
        self.log.append(f"{self.rig.now_us()}: {client} asks {method} {axis or ''}")
        reply = self.rig.begin(method, client.encode(), members=members, **params)
        self.waiting.append(reply)
        return reply

    # Its end

    async def _end(self) -> None:
        """Let what waits end, stop all, check, and make the bench ready for the next trial."""
        nuisance = not self.broken and any(
            line.bench.board.state is BoardState.FAULT for line in self.boards.values()
        )
        await self._until(lambda: all(reply.done() for reply in self.waiting))
        if self.rng.random() < SILENT:
            await self._until(lambda: not self.lease)
        for line in self.boards.values():
            line.tap.to_board = line.tap.to_host = nothing
            line.plug_in()
        while True:
            reply = self._stop("eve")
            await self._until(reply.done)
            if b"result" in reply.result():
                break
        for _ in range(8):
            await self._sample()
        await self._until(lambda: self.rig.now_us() > self.dry_us)
        for name, line in self.boards.items():
            self.oracle.check(name, line.tap.heating_us)
        if nuisance:
            raise Violation("a board is in FAULT, and nothing was broken")
        if self.lease:
            self._ask("control.release", "ada")
        await self._until(self._ready)
        for line in self.boards.values():
            # Nothing is any more, and what is whole needs less time.
            line.bench.hardware.broken = False
        # What was asked of an earlier trial says nothing of the next.
        self.later.clear()
        self.lease = {}

    def _ready(self) -> bool:
        axes = self.rig.daemon.axes.values()
        if any(axis.watch.fault is not None for axis in axes) and not self._clearing():
            self.waiting.append(self.rig.begin("clear", b"eve"))
        return all(
            axis.watch.mode is BoardState.SAFE
            and axis.watch.parameters.agree
            and axis.session.clock is not None
            and axis.session.clock.locked
            and axis.stop.off
            for axis in axes
        ) and (self.rig.daemon.service._lease.holder(self.rig.now_us()) is None)

    def _clearing(self) -> bool:
        return not self.waiting[-1].done()

    async def _until(self, reached: Callable[[], bool]) -> None:
        for _ in range(LONGEST_SAMPLES):
            if reached():
                return
            await self._sample()
        where = {
            name: (axis.stop.phase, axis.watch.mode, axis.watch.fault, axis.watch.parameters.agree)
            for name, axis in self.rig.daemon.axes.items()
        }
        raise Violation(f"it never came to an end: {where}")


def _losing(kind: type[wire.Message], copies: int) -> Callable[[wire.Message], bool]:
    left = iter(range(copies))
    return lambda message: isinstance(message, kind) and next(left, None) is not None


def run_chunk(seed: str, trials: int, *, own: bool) -> Counter[str]:
    """Run trials drawn from a seed; return how often what happened. Raises Violation."""
    with tempfile.TemporaryDirectory() as folder:
        chunk = Chunk(seed, own, Path(folder))
        with asyncio.Runner(loop_factory=VirtualLoop) as runner:
            runner.run(chunk.run(trials))
    return chunk.counts


def chunks_of(count: int, seed: int) -> Iterator[tuple[str, int, bool]]:
    """Yield the seed, the number of trials and the policy of each chunk of a campaign."""
    for number in range(0, count, CHUNK):
        yield f"{seed} {number // CHUNK}", min(CHUNK, count - number), number // CHUNK % 2 == 1


def _one_of_many(chunk: tuple[str, int, bool]) -> Counter[str] | str:
    seed, trials, own = chunk
    try:
        return run_chunk(seed, trials, own=own)
    except Violation as violation:
        return str(violation)


def main() -> int:
    """Run a campaign; print its seeds, what happened how often, and every violation."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=20_000, help="trials")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    asked = parser.parse_args()
    chunks = list(chunks_of(asked.count, asked.seed))
    counts: Counter[str] = Counter()
    violations = []
    print(f"seeds {chunks[0][0]!r} to {chunks[-1][0]!r}, {CHUNK} trials each")
    with ProcessPoolExecutor(asked.jobs) as pool:
        for found in pool.map(_one_of_many, chunks):
            if isinstance(found, str):
                violations.append(found)
                print(found, flush=True)
            else:
                counts += found
    for what, how_often in sorted(counts.items()):
        print(f"{how_often:7} {what}")
    print(f"{len(violations)} violations")
    return 1 if violations else 0


if __name__ == "__main__":
    raise SystemExit(main())
