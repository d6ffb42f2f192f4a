"""Plans in virtual time, on the simulated bench with its board."""

from __future__ import annotations

import pytest

from firmware_protocol.enums import BoardState
from firmware_protocol.messages import Setpoint, State
from sim_device.bench import SimulatedBench
from sim_device.faults import injection
from smad.config import ControlConfig, CoolingConfig, LimitsConfig
from smad.control.commands import DriveCurrent, Follow, HoldTemperature, Ramp, Sine, Step
from smad.control.controller import Controller
from smad.control.errors import PlanError
from smad.control.metrics import tracking_r2
from smad.control.plan import Action, Do, Mark, Pause, Plan, UntilDone
from smad.control.runner import run_virtual
from smad.control.sample import Sample
from smad.errors import CommandError

PROPORTIONAL = ControlConfig(cooling=CoolingConfig(mode="proportional"))
Recorded = list[tuple[Sample, State, Setpoint, float]]


def carry_out(
    *actions: Action, seed: int = 0, limits: LimitsConfig | None = None
) -> tuple[dict[str, float], Recorded]:
    recorded: Recorded = []
    done = run_virtual(
        SimulatedBench(seed=seed),
        Controller(PROPORTIONAL, limits),
        Plan("test", actions),
        recorder=lambda sample, state, setpoint, ref, _: recorded.append(
            (sample, state, setpoint, ref)
        ),
    )
    assert done.samples == len(recorded)
    return done.marks, recorded


RAMP = Follow(trajectories=(Ramp(displacement_mm=3.0, rate_mm_per_s=1.0),))


def test_the_same_seed_gives_the_same_run_to_the_last_bit() -> None:
    def run(seed: int) -> list[tuple[State, Setpoint]]:
        _, recorded = carry_out(Do(RAMP), UntilDone(10.0), seed=seed)
        return [(state, setpoint) for _, state, setpoint, _ in recorded]

    assert run(5) == run(5)
    assert run(5) != run(6)


def test_a_plan_moves_the_pair_and_marks_its_moments() -> None:
    marks, recorded = carry_out(Mark("begin"), Do(RAMP), UntilDone(10.0), Mark("end"), Pause(1.0))
    assert marks["end"] - marks["begin"] == pytest.approx(3.0, abs=0.03)
    assert recorded[-1][0].t_us * 1e-6 - marks["end"] == pytest.approx(1.0, abs=0.011)
    assert recorded[-1][0].displacement_m == pytest.approx(0.003, abs=2e-4)


def test_the_board_stays_armed_and_applies_what_was_asked() -> None:
    _, recorded = carry_out(Do(DriveCurrent(i_x_A=1.0, duration_s=2.0)), UntilDone(5.0))
    assert {state.mode for _, state, _, _ in recorded} == {BoardState.ARMED}
    assert max(state.i_applied_mA[0] for _, state, _, _ in recorded) == 1000


def test_a_wait_that_takes_too_long_ends_the_plan() -> None:
    with pytest.raises(PlanError, match=r"did not end in time.*temperature after 2 s"):
        carry_out(Do(HoldTemperature(spring="x", temperature_degC=40.0)), UntilDone(2.0))


def test_a_fault_of_the_board_ends_the_plan_with_its_name() -> None:
    bench = SimulatedBench(faults=[injection("sensor_open", 1.0)])
    with pytest.raises(PlanError, match=r"left ARMED.*SENSOR_OPEN"):
        run_virtual(bench, Controller(PROPORTIONAL), Plan("test", (Do(RAMP), UntilDone(10.0))))


def test_a_refused_command_ends_the_plan() -> None:
    with pytest.raises(CommandError, match="displacement of the step"):
        carry_out(Do(Follow(trajectories=(Step(displacement_mm=16.0, duration_s=1.0),))))


def test_a_sinusoid_is_followed_better_than_on_the_bench_of_the_paper() -> None:
    sine = Sine(amplitude_mm=2.0, period_s=7.0, cycles=4)
    _, recorded = carry_out(Do(Follow(trajectories=(sine,))), UntilDone(40.0))
    later = recorded[710:]
    r2 = tracking_r2(
        [reference for *_, reference in later], [sample.displacement_m for sample, *_ in later]
    )
    assert r2 > 0.9927
