"""A supervisor whose samples a library decides decides the same as the one in Python."""

from dataclasses import fields, replace
from pathlib import Path

import pytest

from firmware_protocol.enums import BoardState
from firmware_protocol.supervisor import (
    ArmConfirmed,
    ArmRequested,
    Link,
    Measurements,
    Memory,
    SelfTest,
    Supervisor,
    compiled_limits,
)
from firmware_protocol.supervisor import compiled as room
from firmware_protocol.supervisor.compiled import (
    LIBRARY,
    CompiledSupervisor,
    Library,
    build_library,
    text_digest,
)
from firmware_protocol.supervisor.memory import Command

from . import c_peer
from .test_c_supervisor import Walk

pytestmark = pytest.mark.skipif(c_peer.COMPILER is None, reason="no C compiler")

SETPOINT = 4
STEPS = 2400
WHOLE_EVERY = 20


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """Compiled anew: the one of the installation may be of an earlier text."""
    path = tmp_path_factory.mktemp("library") / LIBRARY.name
    assert build_library(path)
    return Library(path, text_digest())


def numbers(s: Memory) -> list[int]:
    values = [getattr(s, field.name) for field in fields(Memory)]
    return [int(n) for v in values for n in ([v] if isinstance(v, int) else v)]


class ThroughTheSupervisor(Walk):
    """A walk of samples and commands, all of them by way of the given supervisor."""

    def __init__(self, seed: int, supervisor: Supervisor) -> None:
        super().__init__(seed)
        self.sv = supervisor

    def command(self, what: int, c: Command) -> int:
        if what != SETPOINT:
            return super().command(what, c)
        ages = (c.age_us, c.ttl_us, self.now_us)
        code = self.sv.setpoint(c.i_mA, c.duty, *ages, stage_um=c.stage_um)
        self.note(code)
        return code

    def note(self, code: int) -> None:
        s = self.sv.memory
        whole = numbers(s) if len(self.answers) % WHOLE_EVERY == 0 else []
        self.answers.append([code, s.state, s.faults, *s.applied_mA, *s.duty, *whole])
        self.states.add(self.sv.state)


def test_both_remember_the_same_along_random_walks(library: Library) -> None:
    seen: set[BoardState] = set()
    for seed in range(10):
        walks = [
            ThroughTheSupervisor(seed, one) for one in (Supervisor(), CompiledSupervisor(library))
        ]
        for walk in walks:
            walk.go(STEPS)
        assert walks[0].answers == walks[1].answers
        seen |= walks[0].states
    assert seen == set(BoardState)


def armed(supervisor: Supervisor) -> Supervisor:
    supervisor.event(SelfTest(passed=True), 0)
    supervisor.sample(Measurements(rtd_cC=[2700, 2710, 2680, 2690]), 10_000)
    assert supervisor.event(ArmRequested(Link(), 7), 20_000).accepted
    assert supervisor.event(ArmConfirmed(Link(), 7), 20_000).accepted
    return supervisor


@pytest.mark.parametrize(
    "changed",
    [
        pytest.param({"wire_open_mV": 5000}, id="one that no parameter changes"),
        pytest.param({"cold_cC": 40_000}, id="one beyond what a parameter can be"),
    ],
)
def test_a_limit_that_the_library_does_not_know_is_in_force_all_the_same(
    library: Library, changed: dict[str, int]
) -> None:
    limits = replace(compiled_limits(), **changed)
    both = [armed(Supervisor(limits)), armed(CompiledSupervisor(library, limits))]
    hot = Measurements(i_mA=[700, 0], v_mV=[5500, 0], rtd_cC=[2900, 2710, 2680, 2690])
    for n in range(300):
        now_us = 30_000 + n * 10_000
        for one in both:
            one.setpoint((700, 0), (0, 0), 0, 100_000, now_us)
            hot.applied_mA[:] = one.memory.applied_mA[:]
            one.sample(hot, now_us)
    assert numbers(both[0].memory) == numbers(both[1].memory)
    assert both[0].first_fault == both[1].first_fault
    assert both[0].first_fault is not None


def test_limits_of_the_library_are_in_force_again_once_they_are_put_back(library: Library) -> None:
    supervisor = CompiledSupervisor(library, replace(compiled_limits(), wire_open_mV=1))
    supervisor.set_limits(replace(compiled_limits(), current_limit_mA=1000))
    armed(supervisor)
    supervisor.setpoint((2000, 0), (0, 0), 0, 100_000, 30_000)
    supervisor.sample(Measurements(rtd_cC=[2700, 2710, 2680, 2690]), 30_000)
    assert supervisor.memory.ceiling_mA[0] == 1000
    assert supervisor.first_fault is None


def test_a_library_of_another_text_is_refused(tmp_path: Path, library: Library) -> None:
    path = tmp_path / LIBRARY.name
    assert build_library(path)
    with pytest.raises(OSError, match="another text"):
        Library(path, "0123456789abcdef")


def test_without_a_library_the_supervisor_is_the_one_in_python(
    monkeypatch: pytest.MonkeyPatch, library: Library
) -> None:
    monkeypatch.setattr(room, "_LIBRARY", None)
    assert type(room.fastest_supervisor()) is Supervisor
    monkeypatch.setattr(room, "_LIBRARY", library)
    assert type(room.fastest_supervisor()) is CompiledSupervisor
