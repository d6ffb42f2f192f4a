"""The process campaign: two of its faults, whole, and that its table fits the daemon."""

import importlib

from smad.faults.oracle import judge
from smad.faults.process import HOST_FAULTS, run_host_fault
from smad.faults.victim import DAEMON_PARTS


def test_a_daemon_killed_while_armed_leaves_a_safe_bench_and_a_readable_log() -> None:
    outcome = run_host_fault(HOST_FAULTS["sigkill"], seed=1)
    assert judge(outcome) == []
    assert outcome.first_fault == "SETPOINT_LOST"
    assert outcome.log is not None
    assert outcome.log.rows >= outcome.log.flushed > 0


def test_a_daemon_whose_controller_dies_disarms_and_says_so() -> None:
    outcome = run_host_fault(HOST_FAULTS["dies_controller"], seed=1)
    assert judge(outcome) == []
    assert outcome.ending is not None
    assert "the control task died (RuntimeError: injected)" in outcome.ending.line


def test_every_part_that_is_to_break_exists() -> None:
    for place in DAEMON_PARTS.values():
        module, _, path = place.partition(":")
        owner, _, method = path.partition(".")
        assert callable(getattr(getattr(importlib.import_module(module), owner), method))
