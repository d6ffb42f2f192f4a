"""Random events for two boards: a host that mostly behaves, a bench that breaks, a bad line."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from firmware.twin import Build, Twins
from firmware_protocol import messages as wire
from firmware_protocol.codec import CODEC
from firmware_protocol.enums import BoardState, Fault, ResetCause
from firmware_protocol.parameters import BY_NAME, PARAMETERS
from firmware_protocol.schema import own_crc

CALM_TICKS = 40
"""Between disturbances, so that armed states last."""
STATE_RATE = BY_NAME["state_rate_hz"].number
RTD_MODES = ("open", "short", "invalid", "stuck", "detached", "offset", "spikes")
DRIVER_MODES = ("short", "open", "cut", "gain")
PUMP_MODES = ("dry", "stalled", "stuck_on", "blocked")


@dataclass
class Stimulus:
    """Makes one event after another; `counts` says how many of which kind."""

    twins: Twins
    rng: random.Random

    def __post_init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._request_seq = 0
        self._setpoint_seq = 0
        self._nonce = 0
        self._last: Build | None = None
        self._wanted = [0, 0]
        self._duty = [0, 0]
        self._mend: list[tuple[int, Callable[[], None]]] = []
        self._tick = 0
        self._estop_at = 0

    # Events

    def begin(self) -> None:
        """Say HELLO, as after a power cycle."""
        self._nonce += 1
        self._request_seq = 0
        self._estop_at = 0
        hello = wire.Hello(wire.PROTOCOL_MAJOR, wire.PROTOCOL_MINOR, own_crc(), self._nonce)
        self._deliver("hello", lambda session, token: CODEC.frame(hello, 0, 0))

    def tick(self) -> None:
        """Do what happens between two samples, then take the sample."""
        twins, rng = self.twins, self.rng
        self._tick += 1
        self._mend_due()
        state = twins.python.state
        if state in (BoardState.ARMED, BoardState.HOLD):
            self._while_armed()
        elif state is BoardState.SAFE and rng.random() < 0.2:
            self._arm()
        elif state is BoardState.FAULT and rng.random() < 0.1:
            self._clear()
        elif state is BoardState.ESTOP:
            self._estop_at = self._estop_at or self._tick
            if self._tick - self._estop_at > CALM_TICKS:
                self._reset(ResetCause.POWER_ON)
        if state in (BoardState.FAULT, BoardState.ESTOP) and rng.random() < 0.02:
            self._reset(rng.choice((ResetCause.PIN, ResetCause.WATCHDOG)))
        if rng.random() < 0.12:
            self._ask()
        if rng.random() < 0.05:
            self._spoil_line()
        if rng.random() < 1.0 / CALM_TICKS / 3:
            self._break_part()
        missed = rng.randrange(1, 8) if rng.random() < 0.002 else 0
        if missed:
            self.counts["hang"] += 1
        twins.sample(missed=missed)

    def _while_armed(self) -> None:
        rng = self.rng
        if rng.random() < 0.01:
            self._wanted = [rng.choice((0, 300, 1500, 4000, 6000)) for _ in range(2)]
            self._duty = [rng.choice((0, 0, 90, 255)) for _ in range(2)]
        if rng.random() < 0.003:
            self._request("disarm", wire.Disarm(0))
        elif rng.random() < 0.002:
            # A host that stalls: sometimes for less than HOLD lasts, sometimes for more.
            for _ in range(rng.choice((5, 15, 30, 80))):
                self.twins.sample()
            self.counts["silence"] += 1
        elif rng.random() < 0.9:
            self._setpoint()

    def _setpoint(self) -> None:
        rng = self.rng
        self._setpoint_seq = (self._setpoint_seq + 1) & 0xFF
        age_us = rng.choice((0, 0, 0, 0, 10_000, 60_000, -5))
        message = wire.Setpoint(
            axis=1 if rng.random() < 0.002 else 0,
            t_ref_us=(self.twins.now_us - age_us) % (1 << 32),
            i_mA=(self._wanted[0], self._wanted[1]),
            pump_duty=(self._duty[0], self._duty[1]),
            flags=rng.choice((0, 0, 0, 1, 2, 4)),
            ttl_ms=rng.choice((100, 100, 20, 1000)),
            stage_um=rng.choice((0, 0, 50_000, 300_000, -1)),
        )
        seq = self._setpoint_seq
        self._deliver("setpoint", lambda session, token: CODEC.frame(message, seq, session))

    def _arm(self) -> None:
        twins = self.twins
        crc = twins.python.parameters.crc
        wrong = self.rng.random() < 0.05
        self._request("arm request", wire.ArmRequest(0, crc ^ int(wrong)))
        forged = int(self.rng.random() < 0.1)
        self._request("arm confirm", lambda token: wire.ArmConfirm(0, (token + forged) % (1 << 32)))

    def _clear(self) -> None:
        s = self.twins.python.outputs
        right = self.rng.random() < 0.8
        fault = Fault(s.first_fault) if right else self.rng.choice(list(Fault))
        self._request("clear fault", wire.ClearFault(0, fault))

    def _ask(self) -> None:
        rng = self.rng
        least = 0 if self.twins.rates else STATE_RATE + 1
        row = rng.choice([row for row in PARAMETERS if row.number >= least])
        value = rng.choice(
            (row.default, row.minimum, row.maximum, rng.randrange(row.minimum, row.maximum + 1))
        )
        value += rng.choice((0, 0, 0, 1, -1))
        number = row.number if rng.random() < 0.95 else rng.randrange(least, 70)
        axis = int(rng.random() < 0.02)
        choices: list[tuple[str, wire.Message, float]] = [
            ("param get", wire.ParamGet(axis, number), 3),
            ("param set", wire.ParamSet(axis, number, value), 0.2 if number == STATE_RATE else 2),
            ("param save", wire.ParamSave(), 0.3),
            ("fault get", wire.FaultGet(axis, rng.randrange(0, 4)), 2),
            ("describe", wire.Describe(rng.randrange(0, 3000)), 1),
            ("time", wire.TimeRequest(rng.randrange(1 << 32)), 3),
            ("estop", wire.Estop(), 0.05),
        ]
        name, message, _ = rng.choices(choices, [weight for *_, weight in choices])[0]
        if name == "time":
            self._deliver(name, lambda session, token: CODEC.frame(message, 9, session))
        else:
            self._request(name, message)
            saves = name == "param save"
            # A request that meets an unfinished write is dropped by one board only.
            self.twins.saving = saves and self.twins.python.state is BoardState.SAFE

    def _spoil_line(self) -> None:
        self._wait_for_store()
        rng = self.rng
        kind = rng.randrange(5)
        if kind == 0:
            junk = rng.randbytes(rng.randrange(1, self.twins.most_junk)) + b"\x00"
            self._deliver("junk", lambda session, token: junk)
        elif kind == 1 and self._last is not None:
            self._deliver("repeat", self._last, keep=False)
        elif kind == 2 and self._last is not None:
            build, place, bit = self._last, rng.random(), 1 << rng.randrange(8)

            def flipped(session: int, token: int) -> bytes:
                # Of no session: which check finds the flip depends on the bytes, and each board
                # has a session and a token of its own.
                data = bytearray(build(0, 0))
                data[int(place * len(data))] ^= bit
                return bytes(data) + b"\x00"

            self._deliver("flip", flipped, keep=False)
        elif kind == 3:
            message = wire.Disarm(0)
            self._deliver(
                "old session", lambda session, token: CODEC.frame(message, 1, session ^ 0x55)
            )
        elif rng.random() < 0.1:
            self.begin()

    def _request(self, name: str, message: wire.Message | Callable[[int], wire.Message]) -> None:
        self._wait_for_store()
        self._request_seq = (self._request_seq + 1) & 0xFF
        seq = self._request_seq

        def build(session: int, token: int) -> bytes:
            made = message(token) if callable(message) else message
            return CODEC.frame(made, seq, session)

        self._deliver(name, build)

    def _wait_for_store(self) -> None:
        while self.twins.saving:
            self.twins.sample()

    def _deliver(self, name: str, build: Build, *, keep: bool = True) -> None:
        self.counts[name] += 1
        twins = self.twins
        at_us = twins.now_us + self.rng.randrange(0, twins.period_us)
        at_us = max(at_us, twins.c.clock_us)
        if keep:
            self._last = build
        twins.deliver(build, at_us)

    # The bench

    def _reset(self, cause: ResetCause) -> None:
        self._wait_for_store()
        self.counts["power cycle" if cause is ResetCause.POWER_ON else "reset"] += 1
        self.twins.power_up(cause)
        self.begin()

    def _break_part(self) -> None:
        rng, hardware = self.rng, self.twins.hardware
        self.counts["broken part"] += 1
        kind, k, j = rng.randrange(7), rng.randrange(2), rng.randrange(4)
        if kind <= 1:
            rtd = hardware.rtds[j]
            rtd.mode = rng.choice(RTD_MODES)
            rtd.value = rng.choice((12.0, 30.0, -10.0))
            rtd.value = abs(rtd.value) if rtd.mode == "detached" else rtd.value
            self._later(lambda: setattr(rtd, "mode", "ok"))
        elif kind == 2:
            driver = hardware.drivers[k]
            mode = rng.choice(DRIVER_MODES)
            driver.mode = "ok" if mode == "gain" else mode
            driver.gain = 0.8 if mode == "gain" else 1.0
            self._later(lambda: _repair(driver))
        elif kind == 3:
            pump = hardware.pumps[k]
            pump.mode = rng.choice(PUMP_MODES)
            self._later(lambda: setattr(pump, "mode", "ok"))
        else:
            name, value, good = rng.choice(
                (
                    ("supply_V", 6.5, None),
                    ("leak", True, False),
                    ("encoder_lost", True, False),
                    ("force_saturated", True, False),
                    ("rtds_swapped", True, False),
                )
            )
            setattr(hardware, name, value)
            self._later(lambda: setattr(hardware, name, good))

    def _later(self, mend: Callable[[], None]) -> None:
        self._mend.append((self._tick + self.rng.choice((2, 30, 700)), mend))

    def _mend_due(self) -> None:
        due = [mend for tick, mend in self._mend if tick <= self._tick]
        self._mend = [entry for entry in self._mend if entry[0] > self._tick]
        for mend in due:
            mend()


def _repair(driver: object) -> None:
    driver.mode, driver.gain = "ok", 1.0  # type: ignore[attr-defined]
