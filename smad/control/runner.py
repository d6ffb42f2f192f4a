"""A plan in virtual time: board, controller and plant in lockstep, as fast as they compute.

The controller and the board are those of a real run; what is left out is the serial line and the
daemon around them. Nothing here reads a clock, so the same bench, controller and plan give the same
run to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from firmware_protocol.enums import BoardState, faults_in
from firmware_protocol.messages import Setpoint, State
from firmware_protocol.timesync import Unwrapper
from smad.control.controller import Controller
from smad.control.errors import BenchStoppedError, PlanError
from smad.control.limits import Trip
from smad.control.plan import Do, Mark, Pause, Plan, UntilDone
from smad.control.sample import BoardTime, Sample, Scales, sample_of
from smad.control.setpoint import setpoint_of

if TYPE_CHECKING:
    from sim_device.bench import SimulatedBench

Recorder = Callable[[Sample, State, Setpoint, float, float], None]
"""Called with each sample, the STATE behind it, the SETPOINT that answers it, the displacement
reference in m and the temperature reference in °C (nan where there is none)."""

Progress = Callable[[float], None]
"""Called about once a second of board time with that time, s."""


@dataclass
class VirtualRun:
    """What a run in virtual time leaves: the marks of the plan, and how long it took."""

    marks: dict[str, float] = field(default_factory=dict)
    board_time_s: float = 0.0
    samples: int = 0


def run_virtual(
    bench: SimulatedBench,
    controller: Controller,
    plan: Plan,
    *,
    recorder: Recorder | None = None,
    progress: Progress | None = None,
) -> VirtualRun:
    """Arm the bench, whose board has default parameters, and carry out the plan.

    `recorder` gets every sample. Raises CommandError for a command that the controller refuses, and
    PlanError when the board leaves ARMED, a limit of the host ends the motion, or a wait takes too
    long.
    """
    bench.arm()
    run, scales, unwrap, time = VirtualRun(), Scales({}), Unwrapper(), BoardTime()
    setpoint: Setpoint | None = None

    def step() -> Sample:
        """The next sample, answered by the setpoint that the board gets with the one after it."""
        nonlocal setpoint
        state = bench.step_typed(setpoint)
        sample = sample_of(state, time.since_first(unwrap(state.t_us, time.now_us)), scales)
        setpoint = setpoint_of(controller.step(sample), t_ref_us=state.t_us)
        before_s, run.board_time_s = run.board_time_s, sample.t_us * 1e-6
        run.samples += 1
        if recorder is not None:
            recorder(sample, state, setpoint, controller.reference_m, controller.target_degC)
        if progress is not None and int(run.board_time_s) > int(before_s):
            progress(run.board_time_s)
        if not sample.armed:
            raise _stopped(state, run.board_time_s)
        if controller.trip is not None:
            raise _tripped(controller.trip, run.board_time_s)
        return sample

    sample = step()
    for action in plan.actions:
        match action:
            case Do(command):
                controller.command(command)
            case Mark(name):
                run.marks[name] = run.board_time_s
            case Pause(seconds):
                until_us = sample.t_us + round(seconds * 1e6)
                while sample.t_us < until_us:
                    sample = step()
            case UntilDone(timeout_s):
                until_us = sample.t_us + round(timeout_s * 1e6)
                sample = step()
                while not controller.done:
                    if sample.t_us >= until_us:
                        raise PlanError(
                            f"plan {plan.name}: the commanded motion did not end in time",
                            value=f"mode {controller.mode} after {timeout_s:g} s",
                            limit=f"{timeout_s:g} s",
                            action="the bench may be too weak, too warm, or not what the "
                            "experiment expects",
                        )
                    sample = step()
    return run


def _tripped(trip: Trip, board_time_s: float) -> BenchStoppedError:
    return BenchStoppedError(
        f"a limit of the host ended the motion after {board_time_s:.2f} s",
        value=f"{str(trip.limit.name).lower()}, {trip.measured:.4g}",
        limit=f"{trip.allowed:g}",
        action="see [limits] in smad docs guide/configuration",
    )


def _stopped(state: State, board_time_s: float) -> BenchStoppedError:
    faults = ", ".join(fault.name for fault in faults_in(state.faults)) or "no fault"
    return BenchStoppedError(
        f"the board left ARMED after {board_time_s:.2f} s",
        value=f"{BoardState(state.mode).name}, {faults}",
        action="see `smad faults explain` for what it means",
    )
