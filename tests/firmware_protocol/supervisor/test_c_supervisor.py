"""The C code that is generated from the tables does the same as the Python, to the last bit."""

import random
from array import array
from collections.abc import Callable
from pathlib import Path

import pytest

from firmware_protocol.enums import BoardState
from firmware_protocol.supervisor import Measurements, Supervisor, machine
from firmware_protocol.supervisor.memory import UNKNOWN, Command, RTD_INVALID_cC

from . import c_peer

pytestmark = pytest.mark.skipif(c_peer.COMPILER is None, reason="no C compiler")

RUNS = 50
STEPS = 2400


class Walk:
    """Random but plausible operations: mostly good samples, now and then something breaks."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.sv = Supervisor()
        self.m = Measurements(rtd_cC=[2700, 2710, 2680, 2690])
        self.now_us = self.rng.randrange(1 << 34)
        self.period_us = self.rng.choice((2000, 4000, 10_000))
        self.temperature = [27.0, 27.1]
        self.wanted = (0, 0)
        self.duty = (0, 0)
        self.broken: dict[str, int] = {}
        self.rows = array("q")
        self.answers: list[list[int]] = []
        self.states = {BoardState.BOOT}
        self.samples = 0

    def go(self, steps: int) -> None:
        if self.rng.random() < 0.1:
            # 0 and 255 are no faults; another firmware's memory may hold them.
            self.command(8, Command(fault=self.rng.randrange(256)))
        self.command(1, Command(passed=int(self.rng.random() < 0.95)))
        for _ in range(steps):
            self.sample()
            if self.rng.random() < 0.97:
                self.setpoint()
            if self.rng.random() < 0.02:
                self.request()

    def command(self, what: int, c: Command) -> int:
        s, m, lim = self.sv.memory, self.m, self.sv.limits
        actions = (
            lambda: machine.on_self_test(s, lim, c),
            lambda: machine.on_arm_request(s, m, lim, c, self.now_us),
            lambda: machine.on_arm_confirm(s, m, lim, c, self.now_us),
            lambda: machine.on_setpoint(s, lim, c, self.now_us),
            lambda: machine.on_disarm(s, lim),
            lambda: machine.on_estop(s, lim),
            lambda: machine.on_clear_fault(s, lim, c),
            lambda: machine.on_restart(s, c),
        )
        self.rows.extend(c_peer.row(what, self.now_us, c))
        code = int(actions[what - 1]())
        self.note(code)
        return code

    def note(self, code: int) -> None:
        count = len(self.answers) + 1
        self.answers.append(c_peer.answer(code, self.sv.memory, count))
        self.states.add(self.sv.state)

    def request(self) -> None:
        rng = self.rng
        state = self.sv.state
        if state is BoardState.SAFE:
            link = 15 if rng.random() < 0.9 else rng.randrange(16)
            token = rng.randrange(1 << 32)
            self.command(2, Command(link=link, token=token))
            guess = rng.choice((token + 1, rng.randrange(1 << 40), -rng.randrange(1 << 40)))
            self.command(3, Command(link=link, token=guess if rng.random() < 0.1 else token))
        elif state is BoardState.FAULT:
            named = self.sv.memory.first_fault if rng.random() < 0.8 else rng.randrange(1, 32)
            self.broken.clear()
            self.temperature = [min(t, 40.0) for t in self.temperature]
            self.command(7, Command(fault=named))
        elif rng.random() < 0.1:
            self.command(5, Command())
        elif rng.random() < 0.01:
            self.command(6, Command())

    def setpoint(self) -> None:
        rng = self.rng
        if rng.random() < 0.02:
            self.wanted = (rng.randrange(4200), rng.choice((0, 0, rng.randrange(4200))))
            self.duty = (rng.choice((0, 255)), rng.choice((0, 128, 255)))
        age_us = rng.randrange(3000) if rng.random() < 0.98 else rng.randrange(-5, 80_000)
        ttl_us = rng.choice((100_000, 100_000, 30_000, 500_000))
        c = Command(i_mA=list(self.wanted), duty=list(self.duty), age_us=age_us, ttl_us=ttl_us)
        if rng.random() < 0.01:
            c.stage_um = rng.choice((-1, 200_000, 200_001, rng.randrange(-(1 << 31), 1 << 31)))
        self.command(4, c)

    def sample(self) -> None:
        rng, s, m = self.rng, self.sv.memory, self.m
        stall = rng.random() < 0.002
        dt_us = self.period_us + (rng.randrange(900_000) if stall else rng.randrange(3))
        self.now_us += dt_us
        for k in (0, 1):
            m.applied_mA[k], m.duty[k] = s.applied_mA[k], s.duty[k]
            m.i_mA[k] = s.applied_mA[k] * s.gate + rng.randrange(-6, 7)
            m.v_mV[k] = m.i_mA[k] * 76 // 100 + rng.randrange(-3, 4)
            watts = m.i_mA[k] * m.v_mV[k] * 1e-6
            loss = (0.02 + 0.55 * m.duty[k] / 255) * (self.temperature[k] - 27)
            self.temperature[k] += (watts - loss) * dt_us * 1e-6 / 3.1
            m.rtd_cC[k] = round(self.temperature[k] * 100) + rng.randrange(-4, 5)
            m.pump_rpm[k] = 6000 * m.duty[k] // 255
        m.rtd_cC[2], m.rtd_cC[3] = 2680 + rng.randrange(3), 2690 + rng.randrange(3)
        m.vbus_mV = 11_900
        m.leak = m.encoder_invalid = m.force_invalid = 0
        m.parameters_ok = 1
        self.spoil()
        self.rows.extend(c_peer.row(c_peer.SAMPLE, self.now_us, m))
        self.sv.sample(m, self.now_us)
        self.samples += 1
        self.note(0)

    def spoil(self) -> None:
        rng, m = self.rng, self.m
        if rng.random() < 0.004:
            self.broken = {rng.choice(list(SPOILERS)): rng.randrange(2)}
        if rng.random() < 0.01:
            self.broken.clear()
        for name, k in self.broken.items():
            SPOILERS[name](m, k, rng)


def _put(field: str, value: int) -> Callable[[Measurements, int, random.Random], None]:
    def act(m: Measurements, k: int, rng: random.Random) -> None:
        target = getattr(m, field)
        if isinstance(target, list):
            target[k] = value
        else:
            setattr(m, field, value)

    return act


def _swap(m: Measurements, k: int, rng: random.Random) -> None:
    m.rtd_cC[0], m.rtd_cC[1] = m.rtd_cC[1], m.rtd_cC[0]


def _spike(m: Measurements, k: int, rng: random.Random) -> None:
    m.rtd_cC[k] += rng.choice((0, 0, 0, 2500))


def _gain(m: Measurements, k: int, rng: random.Random) -> None:
    m.i_mA[k] = m.i_mA[k] * 75 // 100


def _extreme(m: Measurements, k: int, rng: random.Random) -> None:
    m.i_mA[k] = rng.choice((-32_768, 32_767))
    m.v_mV[k] = rng.choice((-65_535, 65_535))
    m.rtd_cC[k] = rng.choice((-32_768, 32_767, 19_999, -3999))


SPOILERS = {
    "invalid": _put("rtd_cC", RTD_INVALID_cC),
    "open": _put("rtd_cC", 32_767),
    "short": _put("rtd_cC", -24_200),
    "stuck": _put("rtd_cC", 3111),
    "hot": _put("rtd_cC", 9900),
    "swap": _swap,
    "spike": _spike,
    "gain": _gain,
    "no current": _put("i_mA", 0),
    "full current": _put("i_mA", 9000),
    "voltage": _put("v_mV", 11_500),
    "rpm": _put("pump_rpm", 5000),
    "no rpm": _put("pump_rpm", 0),
    "unknown rpm": _put("pump_rpm", UNKNOWN),
    "supply": _put("vbus_mV", 6000),
    "leak": _put("leak", 1),
    "encoder": _put("encoder_invalid", 1),
    "force": _put("force_invalid", 1),
    "parameters": _put("parameters_ok", 0),
    "extreme": _extreme,
}


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return c_peer.build(tmp_path_factory.mktemp("supervisor"))


def check(program: Path, walk: Walk) -> None:
    """Run the walk's operations through the C program and compare every answer."""
    python = array("q", (number for numbers in walk.answers for number in numbers))
    c = c_peer.run(program, walk.rows)
    assert len(c) == len(python)
    if c != python:
        at = next(n for n, pair in enumerate(zip(c, python, strict=True)) if pair[0] != pair[1])
        pytest.fail(f"{c_peer.names_at(at, walk.answers)}: C has {c[at]}, Python {python[at]}")


def test_c_and_python_agree_over_random_sequences(program: Path) -> None:
    states: set[BoardState] = set()
    first_faults: set[int] = set()
    samples = 0
    for seed in range(RUNS):
        walk = Walk(seed)
        walk.go(STEPS)
        check(program, walk)
        states |= walk.states
        first_faults.add(walk.sv.memory.first_fault)
        samples += walk.samples
    assert samples >= 100_000
    assert states == set(BoardState)
    assert len(first_faults) >= 8, "the sequences are too tame to tell anything"


def test_c_and_python_agree_from_the_first_moment_on(program: Path) -> None:
    walk = Walk(1)
    walk.go(2 * c_peer.FULL_EVERY)
    check(program, walk)


def test_a_check_that_differs_is_noticed(program: Path) -> None:
    walk = Walk(2)
    walk.go(20)
    walk.answers[-1][1] += 1
    with pytest.raises(pytest.fail.Exception, match="state after operation"):
        check(program, walk)
