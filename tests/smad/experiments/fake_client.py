"""The client's methods over a simulated bench in this process: no sockets, no clocks."""

from __future__ import annotations

import math
from pathlib import Path

from firmware_protocol.timesync import Unwrapper
from sim_device.bench import SimulatedBench
from sim_device.faults import injection
from smad import api
from smad.client import NotReady
from smad.config import Config, ControlConfig, CoolingConfig, config_to_toml
from smad.control.commands import (
    DriveCurrent,
    Follow,
    FollowInputs,
    HoldTemperature,
    Idle,
    MoveStage,
    Tune,
)
from smad.control.controller import Controller
from smad.control.pieces import rows_in_pieces
from smad.control.sample import BoardTime, Sample, Scales, sample_of
from smad.control.setpoint import setpoint_of
from smad.runlog.header import RunHeader
from smad.runlog.rows import row_of
from smad.runlog.schema import Event, Row
from smad.runlog.writer import write_run


class _Recorder:
    def __init__(self, path: str, recording: bool) -> None:
        self.path = path
        self.recording = recording
        self.error = ""


class _Board:
    def __init__(self, capabilities: tuple[str, ...]) -> None:
        self.capabilities = capabilities
        self.uid = ""


class _Status:
    def __init__(
        self, sample: Row | None, recorder: _Recorder, capabilities: tuple[str, ...]
    ) -> None:
        self.sample = sample
        self.board = _Board(capabilities)
        self.recorder = recorder


class FakeClient:
    """Answers as `smad.Client` does; time passes only in `let_pass`."""

    name = ""

    def __init__(
        self,
        folder: Path,
        *,
        fails_at_s: float | None = None,
        fixture: str = "antagonistic",
        seed: int = 3,
        capabilities: tuple[str, ...] = ("drain",),
    ) -> None:
        self._capabilities = capabilities
        faults = [] if fails_at_s is None else [injection("sensor_open", fails_at_s)]
        self._config = Config(control=ControlConfig(cooling=CoolingConfig(mode="proportional")))
        self._bench = SimulatedBench(seed=seed, faults=faults, fixture=fixture)
        self._controller = Controller(self._config.control)
        self._folder = folder
        self._scales = Scales({})
        self._unwrap = Unwrapper()
        self._time = BoardTime()
        self._setpoint = None
        self._row: Row | None = None
        self._sample: Sample | None = None
        self._records: list[Row | Event] = []
        self._path = ""
        self._header = RunHeader()
        self._logs = 0
        self._since_armed = False
        self.recording = False
        self.tunes: list[Tune] = []
        self._step()

    def let_pass(self, seconds: float) -> None:
        """Let board time pass."""
        for _ in range(max(1, round(seconds * 100))):
            self._step()

    def _step(self) -> None:
        state = self._bench.step_typed(self._setpoint)
        board_us = self._unwrap(state.t_us, self._time.now_us)
        self._sample = sample_of(state, self._time.since_first(board_us), self._scales)
        output = self._controller.step(self._sample)
        self._setpoint = setpoint_of(output, t_ref_us=state.t_us)
        self._row = row_of(
            self._sample,
            state,
            self._setpoint,
            host_time_s=math.nan,
            reference_m=self._controller.reference_m,
            reference_degC=self._controller.target_degC,
            pump_starts=(0, 0),
        )
        if self.recording:
            self._records.append(self._row)

    def arm(self) -> api.Motion:
        self._since_armed = True
        self._bench.arm()
        self._step()
        return self.motion()

    def motion(self) -> api.Motion:
        assert self._sample is not None
        departure = self._controller.departure
        return api.Motion(
            running=self._controller.mode,
            done=self._controller.done,
            armed=self._sample.armed,
            mode="ARMED" if self._sample.armed else "FAULT",
            reference_mm=None,
            displacement_mm=self._sample.displacement_m * 1e3,
            board_time_s=self._sample.t_us * 1e-6,
            ended="" if departure is None else departure.in_words(),
            fault=None if self._sample.armed else api.Fault(number=1, name="sensor_open"),
        )

    def status(self) -> _Status:
        return _Status(self._row, _Recorder(self._path, self.recording), self._capabilities)

    def config(self) -> str:
        return config_to_toml(self._config)

    def start_recording(self, name: str = "", repeats: str = "") -> _Recorder:
        self.recording, self._records = True, []
        self._logs += 1
        self._header = RunHeader(name=name, repeats=repeats)
        self._path = str(self._folder / f"{self._logs}-{name}.mcap")
        return _Recorder(self._path, True)

    def stop_recording(self) -> _Recorder:
        self.recording = False
        write_run(self._path, self._header, self._records)
        return _Recorder(self._path, False)

    def note(self, text: str) -> None:
        assert self._sample is not None
        self._records.append(Event(t_s=self._sample.t_us * 1e-6, kind="note", text=text))

    def move(self, *trajectories: object, queue: bool = False) -> None:
        self._controller.command(Follow(trajectories=trajectories, queue=queue))

    def heat(self, spring: str, temperature_degC: float, **rest: object) -> None:
        self._controller.command(
            HoldTemperature(spring=spring, temperature_degC=temperature_degC, **rest)
        )

    def current(self, command: DriveCurrent) -> None:
        self._controller.command(command)

    def follow_inputs(self, command: FollowInputs) -> None:
        for piece in rows_in_pieces(command):
            self._controller.command(piece)

    def stage(self, stage_mm: float, rate_mm_per_s: float) -> None:
        self._controller.command(MoveStage(stage_mm=stage_mm, rate_mm_per_s=rate_mm_per_s))

    def as_of(self, generation: int | None) -> None:
        """Ask for what follows as of this generation; None: whatever has stopped since."""
        self._since_armed = generation is not None

    def require_no_stop(self) -> None:
        """Refuse, as the daemon does, what is asked for as of an arming that has ended."""
        if self._since_armed and not self.motion().armed:
            raise NotReady("the bench was stopped after this command was issued")

    def tune(self, command: Tune) -> None:
        self.require_no_stop()
        self.tunes.append(command)
        self._controller.command(command)

    def idle(self) -> None:
        self._controller.command(Idle())
        self._step()
