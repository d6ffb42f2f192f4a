"""Plans on a bench, through the daemon that runs it."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import asdict

from firmware_protocol.enums import Fault
from smad import api
from smad.client import NotInControl, NotReady, Refused
from smad.client.arming import arm_when_allowed
from smad.config import parse_config
from smad.control.commands import (
    DriveCurrent,
    Follow,
    FollowInputs,
    HoldTemperature,
    Idle,
    ModeCommand,
    MoveStage,
    Tune,
)
from smad.control.inforce import tune_of
from smad.control.plan import Cooling, Do, Fixture, Mark, Pause, Plan, UntilDone
from smad.errors import CommandError, ComputerError
from smad.experiments.driver import PARTS, Mounting, log_name
from smad.experiments.errors import (
    BenchLacksError,
    EndedEarlyError,
    ExperimentError,
    StoppedError,
    TrippedError,
)
from smad.experiments.logs import recording_of
from smad.experiments.recording import Recording
from smad.experiments.virtual import MARK
from smad.progress import Say, silent
from smad.runlog.one_axis import extract
from smad.runlog.paths import part_path
from smad.runlog.reader import read_run
from smad.runlog.schema import CUT

if TYPE_CHECKING:
    from smad.client import Client

POLL_S = 0.02
REST_K = 1.0
"""At rest means: both springs within this of the water (or the room)."""
STEADY_S, STEADY_K = 20.0, 0.1
"""Or they get no colder: by less than this in so long, with water on."""
LONGEST_REST_S = 600.0
RETURN_MM_PER_S = 5.0
RESET_DEGC = 65.0
"""Above A_F of an unloaded spring by a wide margin."""
_COOLING_S = 600.0
_TOKEN_S = 0.2
"""Enough for a second try."""


@dataclass(eq=False)
class LiveDriver:
    """A running daemon. The springs are mounted as the user says: `fixture` and `cooling`.

    With `lease_s` each run is under exclusive control of `who`, and ends disarmed: between two runs
    a program may compute for longer than a lease lasts. A program that is killed in a run is
    silent, and the daemon disarms after `lease_s`. Without, the driver arms when needed, and leaves
    the bench armed.

    Before each run it waits until the springs are at rest, and it records each run by itself.
    `sleep` and `clock_s` are those of the wall. `log` is where the last run was recorded, also one
    that ended early.
    """

    client: Client
    _: KW_ONLY
    who: str = "smad run"
    lease_s: float | None = None
    fixture: Fixture = "antagonistic"
    cooling: Cooling = "water"
    progress: Say = silent
    sleep: Callable[[float], None] = time.sleep
    clock_s: Callable[[], float] = time.monotonic
    log: Path | None = field(default=None, init=False)
    _generation: int = field(default=0, init=False)
    _disarmed: bool = field(default=False, init=False)

    def parts(self) -> frozenset[str]:
        status = self.client.status()
        sample = status.sample
        if sample is None or status.board is None:
            raise ExperimentError(
                "the daemon has no sample of the bench yet",
                action="see `smad status` for the link",
            )
        staged = self.fixture != "antagonistic"
        return frozenset(
            part
            for part in PARTS
            if (part == "drain" and self.cooling == "water" and part in status.board.capabilities)
            or (part == "stage" and staged)
            or getattr(sample, part, None) is not None
        )

    def mounting(self) -> Mounting | None:
        return Mounting(self.fixture, self.cooling)

    def run(self, plan: Plan) -> Recording:
        """See `Driver`. Raises NotInControl while somebody else has control."""
        if self.lease_s is None:
            return self._run(plan)
        with self.client.in_control(self.who, self.lease_s):
            ours = True
            try:
                self._arm_when_cold(plan)
                return self._run(plan)
            except NotInControl:
                # The lease has lapsed, and the daemon disarmed: somebody else may use the bench.
                ours = False
                raise
            finally:
                if ours:
                    self.client.disarm()
                    self._disarmed = True

    def _arm_when_cold(self, plan: Plan) -> None:
        if self.client.motion().armed:
            return
        # After our own disarm the springs are still cooling; before the first run only an arming
        # token may have expired, on a busy computer.
        timeout_s = _COOLING_S if self._disarmed else _TOKEN_S
        arm_when_allowed(
            self.client,
            timeout_s,
            lambda: self._say_waiting(plan),
            sleep=self.sleep,
            clock_s=self.clock_s,
        )

    def _say_waiting(self, plan: Plan) -> None:
        if self._disarmed:
            self.progress(f"{plan.name}: waiting until the springs are cold enough to arm")

    def _run(self, plan: Plan) -> Recording:
        if Mounting(plan.fixture, plan.cooling) != self.mounting():
            raise BenchLacksError(
                f"run {plan.name} needs springs mounted for {plan.fixture}, in {plan.cooling}",
                value=str(self.mounting()),
                action="nothing was moved; mount them that way and give --fixture and --air",
            )
        client = self.client
        motion = client.motion()
        if not motion.armed:
            motion = client.arm()
        self._generation = motion.generation
        before = parse_config(client.config()).control
        try:
            self.rest(plan)
            if client.status().recorder.recording:
                client.stop_recording()
            client.start_recording(log_name(plan), plan.repeats)
            cut = ""
            try:
                self._carry_out_armed(plan)
            except BaseException as error:
                cut = _cut_by(error)
                raise
            finally:
                recorder = self._recorded(cut)
            if part_path(Path(recorder.path), 2).exists():
                raise ExperimentError(
                    f"run {plan.name} fills more than one file, and only the first would be read",
                    value=recorder.path,
                    action="make recorder.max_file_min or max_file_MB larger, and run it again",
                )
            if recorder.error:
                raise ComputerError(
                    f"run {plan.name} could not be recorded whole: {recorder.error}",
                    value=recorder.path,
                    action="make room on the disk, and run it again",
                )
        finally:
            self._tune_back(tune_of(before))
        assert self.log is not None
        return recording_of(read_run(self.log))

    def _recorded(self, cut: str) -> api.RecorderStatus:
        """End motion and run log; a signal that comes meanwhile ends the program once that is done.

        A terminal that is closed sends two, one right after the other.
        """
        try:
            return self._end_recording(cut)
        except (KeyboardInterrupt, SystemExit) as error:
            with contextlib.suppress(Refused):
                self._end_recording(cut or _cut_by(error))
            raise

    def _end_recording(self, cut: str) -> api.RecorderStatus:
        client = self.client
        client.idle()
        if cut:
            client.note(f"{CUT}{cut}"[:500])
        recorder = client.stop_recording()
        # A log that a disk cut is not split; the run ends with what the recorder says.
        axis = "" if recorder.error else client.name
        self.log = extract(recorder.path, axis)
        return recorder

    def _carry_out_armed(self, plan: Plan) -> None:
        client = self.client
        try:
            self._carry_out(plan)
        except NotReady:
            # A stop came before what was sent; a fault is reported by its name.
            self._require_armed(plan, client.motion())
            raise
        except CommandError:
            # Inputs that a reading ended take none that are queued behind them.
            _require_whole(plan, client.motion())
            raise
        self._require_armed(plan, client.motion())

    def _carry_out(self, plan: Plan) -> None:
        client = self.client
        for action in plan.actions:
            match action:
                case Do(command):
                    self._send(command)
                case Mark(name):
                    client.note(f"{MARK}{name}")
                case Pause(seconds):
                    self.pause(plan, seconds)
                case UntilDone(timeout_s):
                    self.until_done(plan, "the commanded motion did not end in time", timeout_s)

    def _send(self, command: ModeCommand) -> None:
        client = self.client
        match command:
            case Follow():
                client.move(*command.trajectories, queue=command.queue)
            case HoldTemperature():
                client.heat(**asdict(command))
            case DriveCurrent():
                client.current(command)
            case FollowInputs():
                client.follow_inputs(command)
            case MoveStage():
                client.stage(command.stage_mm, command.rate_mm_per_s)
            case Tune():
                client.tune(command)
            case Idle():
                client.idle()

    def pause(self, plan: Plan, seconds: float) -> None:
        """Let so many seconds of board time pass."""
        self._wait(plan, seconds, lambda motion: False)

    def until_done(self, plan: Plan, otherwise: str, timeout_s: float) -> None:
        """Wait for the end of what was commanded. Raises ExperimentError, `otherwise` its cause."""
        if not self._wait(plan, timeout_s, lambda motion: motion.done):
            raise ExperimentError(
                f"run {plan.name}: {otherwise}",
                limit=f"{timeout_s:g} s",
                action="the bench may be too weak, too warm, or not what the experiment expects",
            )

    def _wait(self, plan: Plan, seconds: float, over: Callable[[api.Motion], bool]) -> bool:
        """Wait until `over` or for so many seconds of board time; whether it was over."""
        client = self.client
        motion = client.motion()
        began_s = motion.board_time_s
        while True:
            # A stopped bench is idle, and so done: whether it was stopped comes first.
            self._require_armed(plan, motion)
            if over(motion):
                break
            if motion.board_time_s - began_s >= seconds:
                return False
            passed_s = motion.board_time_s - began_s
            self.progress(f"{plan.name}: {passed_s:.0f} of at most {seconds:.0f} s of this step")
            self.sleep(POLL_S)
            motion = client.motion()
        _require_whole(plan, motion)
        return True

    def _require_armed(self, plan: Plan, motion: api.Motion) -> None:
        if motion.armed and motion.generation == self._generation:
            return
        fault = "no fault" if motion.fault is None else motion.fault.name
        # The emergency stop is latched as a fault, and is a person's stop all the same.
        by_person = motion.fault is None or motion.fault.name == Fault.ESTOP_PRESSED.name
        kind = StoppedError if by_person else TrippedError
        raise kind(
            f"run {plan.name}: the board left ARMED"
            + (f", {motion.ended}" if motion.ended else ""),
            value=f"{motion.mode}, {fault}",
            action="see `smad status` and `smad faults explain`",
        )

    def _tune_back(self, before: Tune) -> None:
        """Tune as it was, also after a stop, which else refuses what was not asked for since."""
        try:
            self.client.tune(before)
        except NotReady:
            generation = self.client.as_of(None)
            try:
                self.client.tune(before)
            finally:
                self.client.as_of(generation)

    def rest(self, plan: Plan) -> None:
        """Bring the springs to where a plan begins: cold, the stage back, no detwinned martensite.

        A single spring that was stretched keeps its length; heating it without load takes that out.
        """
        client = self.client
        if plan.fixture != "antagonistic":
            client.stage(0.0, RETURN_MM_PER_S)
            self.until_done(plan, "the stage does not come back", LONGEST_REST_S)
            client.heat("x", RESET_DEGC, duration_s=3.0, use_water=False)
            self.until_done(plan, "the spring does not warm up", LONGEST_REST_S)
        self.cool(plan, REST_K)

    def cool(self, plan: Plan, within_K: float) -> None:
        """Water on, until both springs are so close to it (or to the room), or get no colder.

        A sensor with an offset never shows the water's temperature. Then idle.
        """
        client = self.client
        duty = 1.0 if self.cooling == "water" else 0.0
        client.current(DriveCurrent(pump_x_duty=duty, pump_y_duty=duty))

        since_s, was_degC = client.motion().board_time_s, math.inf

        def cold(motion: api.Motion) -> bool:
            nonlocal since_s, was_degC
            row = client.status().sample
            if row is None or row.rtd_x_degC is None:
                return False
            around = row.rtd_inlet_degC if self.cooling == "water" else row.rtd_ambient_degC
            springs = [t for t in (row.rtd_x_degC, row.rtd_y_degC) if t is not None]
            if around is None or max(springs) - around < within_K:
                return True
            if motion.board_time_s - since_s < STEADY_S:
                return False
            steady = was_degC - max(springs) < STEADY_K
            since_s, was_degC = motion.board_time_s, max(springs)
            return steady

        if not self._wait(plan, LONGEST_REST_S, cold):
            raise ExperimentError(
                f"run {plan.name}: the springs do not come to rest",
                limit=f"within {within_K:g} K of the water in {LONGEST_REST_S:g} s",
                action="check the pumps and the temperature sensors",
            )
        client.idle()


def _require_whole(plan: Plan, motion: api.Motion) -> None:
    if motion.ended:
        raise EndedEarlyError(
            f"run {plan.name} was ended: {motion.ended}",
            action="what was recorded until then is kept",
        )


def _cut_by(error: BaseException) -> str:
    """What cut a run; empty for an error that leaves what was recorded until then good."""
    if isinstance(error, StoppedError):
        return error.cause
    return "" if isinstance(error, Exception) else "the program was ended"
