"""The lockstep campaign: the daemon's control task and the board, over bytes, on virtual time.

What the daemon does around its control task is repeated here in the few rules that concern
faults: a restart or a lost link ends the motion, a reconnection only watches, a board found armed
is told to disarm, and so is one whose motion a limit of the host has ended. The daemon itself is
tried by `smad.faults.process`.
"""

from __future__ import annotations

import functools
import math
import random
from dataclasses import dataclass, replace

from firmware_protocol import messages as wire
from firmware_protocol.enums import BoardState
from firmware_protocol.events import (
    BoardRestarted,
    Connected,
    FaultReported,
    HostEvent,
    HostState,
    LinkLost,
    RequestDone,
)
from firmware_protocol.host import HostSession
from sim_device.faults import Injection
from sim_device.plant import load_parameters
from smad.config import ControlConfig, LimitsConfig, LinkConfig
from smad.control.commands import Idle
from smad.control.controller import Controller
from smad.daemon.control import ControlTask, Outlets
from smad.daemon.hoststop import HostStop
from smad.daemon.means import Clocks
from smad.errors import SmadError
from smad.faults.catalogue import ROWS, Row
from smad.faults.oracle import Expectation, Outcome, Then
from smad.faults.scenes import SCENES, Scene
from smad.faults.trace import HOT, Trace, WatchedBench

AFTER_STOP_S = 2.0
BENCHES = 4
TIGHTENED_UNHEATED_mJ = {"A": 20_000, "B": 8_000}
"""`unheated_energy_mJ` by parameter set: half more than its harshest legitimate motion needs."""

_TTL_MS = 100
_REOPEN_US = 200_000
_ARM_PATIENCE_SAMPLES = 500
_TWIN_SLACK_J = 12.0
_TWIN_SLACK = 1.25
_NOISE_GROUPS = ("bytes", "link", "host")


class Host:
    """The host's end: session, controller and control task of the daemon, without its loop."""

    def __init__(self, bench: WatchedBench, nonce: int) -> None:
        self.bench = bench
        bench.host = self
        bench.on_unplug = self._unplugged
        bench.on_plug = self._plugged_in
        self.session = HostSession(nonce=nonce)
        self.controller = Controller(ControlConfig(), LimitsConfig())
        self.told_fault = ""
        self.stopped_by_itself = ""
        """Name under which a limit of the host ended the motion, if one did first."""
        self.connected = False
        self.done: list[wire.Message] = []
        self._plugged = True
        self._reopen_us: int | None = None
        self.stalled_until_us = 0
        self._waiting = bytearray()
        self._wall_offset_s = 0.0
        self._mode_known = False
        self._stop = HostStop(self.controller)
        self.control = ControlTask(
            self.session,
            self.controller,
            LinkConfig(setpoint_ttl_ms=_TTL_MS),
            Outlets(self._write, self._on_event, lambda: None),
            Clocks(
                lambda: bench.now_us,
                lambda: 1.7e9 + bench.now_us * 1e-6 + self._wall_offset_s,
                lambda: bench.now_us * 1000,
            ),
        )
        self.control.opened()

    def sample(self) -> None:
        """Let the bench take one sample, and answer it unless stalled."""
        data = self.bench.step()
        now_us = self.bench.now_us
        if self._plugged:
            self._waiting += data
        if now_us < self.stalled_until_us:
            return
        if self._reopen_us is not None and now_us >= self._reopen_us:
            self._reopen_us = None
            self._plugged = True
            self.control.opened()
        if self._waiting:
            data = bytes(self._waiting)
            self._waiting.clear()
            self.control.receive(data)
        self._look_at_samples()
        self._look_at_limits()
        self.control.tick()

    def arm(self) -> None:
        """Connect and arm. Raises SmadError when the healthy bench does not let itself be armed."""
        for _ in range(_ARM_PATIENCE_SAMPLES):
            last = self.control.last
            if self.connected and last is not None and last.state.mode is BoardState.SAFE:
                break
            self.sample()
        crc = self.bench.board.parameters.crc
        token = self._ask(wire.ArmRequest(0, crc))
        assert isinstance(token, wire.ArmToken)
        self._ask(wire.ArmConfirm(0, token.token))
        for _ in range(_ARM_PATIENCE_SAMPLES):
            if self.control.armed:
                return
            self.sample()
        raise SmadError("the simulated bench did not arm", action="this is a mistake in smad")

    def stall(self, seconds: float) -> None:
        """Stop running for a while; bytes wait meanwhile."""
        self.stalled_until_us = self.bench.now_us + round(seconds * 1e6)

    def jump_wall_clock(self, seconds: float) -> None:
        """Set the wall clock forward or back."""
        self._wall_offset_s += seconds

    def _ask(self, message: wire.Message) -> wire.Message:
        self.done.clear()
        self.session.request(message, self.bench.now_us)
        self.control.flush()
        for _ in range(_ARM_PATIENCE_SAMPLES):
            if self.done:
                return self.done[-1]
            self.sample()
        raise SmadError(
            "the simulated bench did not answer", value=type(message).__name__,
            action="this is a mistake in smad",
        )  # fmt: skip

    def _write(self, data: bytes) -> bool:
        if not self._plugged:
            return False
        self.bench.receive(data)
        return True

    def _on_event(self, event: HostEvent) -> None:
        match event:
            case Connected():
                self.connected = True
                self._mode_known = False
            case BoardRestarted() | LinkLost():
                self._end_motion()
            case FaultReported(report):
                self.told_fault = self.told_fault or report.fault.name
            case RequestDone(_, _, reply):
                self.done.append(reply)
            case _:
                pass

    def _look_at_samples(self) -> None:
        finished = self.control.finished
        while finished:
            state = finished.popleft().state
            if not self._mode_known and self.connected:
                self._mode_known = True
                if state.mode in HOT:
                    self.session.request(wire.Disarm(0), self.bench.now_us)

    def _look_at_limits(self) -> None:
        fault = self._stop.news()
        if fault is None:
            return
        if not self.told_fault:
            self.told_fault = self.stopped_by_itself = fault.name
        if self.session.state is HostState.RUNNING:
            self.session.request(wire.Disarm(0), self.bench.now_us)
            self.control.flush()

    def _end_motion(self) -> None:
        self.connected = False
        self.controller.command(Idle())

    def _unplugged(self, renamed: bool) -> None:
        self._plugged = False
        self._waiting.clear()
        self.control.lost()
        self._end_motion()

    def _plugged_in(self) -> None:
        self._reopen_us = self.bench.now_us + _REOPEN_US


@dataclass(frozen=True)
class Case:
    """One run of the campaign: a scene, a bench, and what breaks when (s after arming)."""

    row_names: tuple[str, ...]
    scene_name: str
    bench_seed: int
    seed: str
    onsets_s: tuple[float, ...]

    @property
    def rows(self) -> tuple[Row, ...]:
        """What breaks, as rows of the catalogue (which cannot be handed to another process)."""
        return tuple(ROWS[name] for name in self.row_names)

    @property
    def scene(self) -> Scene:
        """What the bench is doing."""
        return SCENES[self.scene_name]

    @property
    def apart_s(self) -> float:
        """Time from the first onset to the last."""
        return max(self.onsets_s) - min(self.onsets_s)

    @property
    def observe_s(self) -> float:
        """How long to watch after the last onset if nothing stops."""
        return max(row.observe_s for row in self.rows)


def drawn_case(seed: int, number: int, rows: tuple[Row, ...]) -> Case:
    """The case of a number: its scene, bench, onsets drawn from the seed."""
    key = f"{seed} {number} {' '.join(row.name for row in rows)}"
    rng = random.Random(key)
    scene = SCENES[rng.choice(sorted(frozenset.intersection(*(row.scenes for row in rows))))]
    first_s = rng.uniform(*(rows[0].onset_s or scene.onset_s))
    onsets_s = [first_s] + [first_s + rng.uniform(0.0, 2.0) for _ in rows[1:]]
    names = tuple(row.name for row in rows)
    return Case(names, scene.name, rng.randrange(BENCHES), key, tuple(onsets_s))


def run_case(case: Case) -> Outcome:
    """Run a case and return what came of it."""
    host = _armed(case.scene, case.bench_seed)
    bench = host.bench
    if any(row.tightened for row in case.rows):
        _tighten(bench, case.bench_seed)
    start_us = bench.now_us
    rng = random.Random(f"{case.seed} parameters")
    injections = [
        row.drawn(rng, start_us + round(onset_s * 1e6))
        for row, onset_s in zip(case.rows, case.onsets_s, strict=True)
    ]
    for one in injections:
        bench.faults.add(one)
    lasts_s = max((one.lasts_s for one in injections if math.isfinite(one.lasts_s)), default=0.0)
    end_us = start_us + round((max(case.onsets_s) + lasts_s + case.observe_s) * 1e6)
    _run(host, case.scene, start_us, end_us, stop_after=len(injections))
    return _outcome(case, host, start_us, injections)


def _armed(scene: Scene, bench_seed: int) -> Host:
    bench = WatchedBench(
        parameters=load_parameters("AB"[bench_seed % 2]), seed=bench_seed, cooling=scene.cooling
    )
    host = Host(bench, nonce=1000 + bench_seed)
    host.arm()
    return host


def _tighten(bench: WatchedBench, bench_seed: int) -> None:
    supervisor = bench.board.supervisor
    energy_mJ = TIGHTENED_UNHEATED_mJ["AB"[bench_seed % 2]]
    supervisor.set_limits(replace(supervisor.limits, unheated_energy_mJ=energy_mJ))


def _run(host: Host, scene: Scene, start_us: int, end_us: int, stop_after: int = 0) -> None:
    """Carry out the script until the end, or until some time after the bench stopped."""
    bench = host.bench
    waiting = list(scene.script)
    while bench.now_us < end_us:
        passed_s = (bench.now_us - start_us) * 1e-6
        # The daemon's service refuses motions while not armed.
        if waiting and passed_s >= waiting[0][0] and host.session.state is HostState.RUNNING:
            host.controller.command(waiting.pop(0)[1])
        host.sample()
        begun = len(bench.faults.begun) >= stop_after
        if stop_after and begun and bench.board.state not in HOT:
            # What ends (a stall that is flushed, a host that wakes) has to be seen to end.
            last_us = max(bench.now_us, host.stalled_until_us, _mended_us(bench))
            end_us = min(end_us, last_us + round(AFTER_STOP_S * 1e6))
            stop_after = 0


def _mended_us(bench: WatchedBench) -> int:
    """When the last of what ends by itself has ended, of what has begun."""
    ends_us = [0]
    for _, _, one in bench.faults.begun:
        lasts_s = one.lasts_s if math.isfinite(one.lasts_s) else one.parameters.get("seconds", 0.0)
        ends_us.append(one.at_us + round(lasts_s * 1e6))
    return max(ends_us)


@functools.lru_cache(maxsize=32)
def _healthy(scene_name: str, bench_seed: int, tens_of_s: int) -> tuple[int, Trace]:
    """Start and trace of the same scene with nothing broken."""
    host = _armed(SCENES[scene_name], bench_seed)
    start_us = host.bench.now_us
    _run(host, SCENES[scene_name], start_us, start_us + tens_of_s * 10_000_000)
    if host.bench.board.state not in HOT:
        raise SmadError(
            "the healthy bench stopped by itself", value=f"{scene_name}, bench {bench_seed}",
            action="this is a nuisance trip; run the scene alone to see why",
        )  # fmt: skip
    return start_us, host.bench.trace


def healthy_J(scene: Scene, bench_seed: int, from_s: float, to_s: float) -> float:
    """Heat of the same bench with nothing broken, between two times after arming, in J."""
    start_us, trace = _healthy(scene.name, bench_seed, max(3, math.ceil(to_s / 10.0)))
    return trace.heat_at(start_us + round(to_s * 1e6)) - trace.heat_at(
        start_us + round(from_s * 1e6)
    )


def _outcome(case: Case, host: Host, start_us: int, injections: list[Injection]) -> Outcome:
    bench, trace = host.bench, host.bench.trace
    onset_us = bench.faults.begun[0][0]
    # A second fault may come when the first has stopped the bench already.
    safe_us = trace.safe_at(onset_us)
    heat_at_onset_J = bench.faults.begun[0][1]
    until_us = bench.now_us if safe_us is None else safe_us
    energy_J = trace.heat_at(until_us) - heat_at_onset_J
    off = safe_us is not None
    latched = bench.board.supervisor.first_fault
    return Outcome(
        name=" + ".join(case.row_names),
        group="pair" if len(case.rows) > 1 else case.rows[0].kind.group,
        scene=case.scene.name,
        injected=" + ".join(described(one, start_us) for one in injections),
        expected=expectation(
            case,
            (onset_us - start_us) * 1e-6,
            (until_us - start_us) * 1e-6,
        ),
        first_fault=host.stopped_by_itself or ("" if latched is None else latched.fault.name),
        told_fault=host.told_fault,
        safe_after_s=None if safe_us is None else (safe_us - onset_us) * 1e-6,
        energy_J=energy_J,
        energy_after_safe_J=trace.heat_J[-1] - trace.heat_at(until_us),
        hottest_degC=trace.hottest_since(onset_us),
        states=states_after(trace, onset_us),
        gate_open_later=off and gate_open_after(trace, until_us),
        host_running_later=off and host.session.state is HostState.RUNNING,
    )


def states_after(trace: Trace, onset_us: int) -> tuple[tuple[float, str], ...]:
    """The state at the onset, at 0, and those that followed, with their times in s."""
    found: list[tuple[float, str]] = []
    for t_us, state, _ in trace.changes:
        if t_us <= onset_us:
            found = [(0.0, state.name)]
        elif not found or found[-1][1] != state.name:
            found.append(((t_us - onset_us) * 1e-6, state.name))
    return tuple(found)


def gate_open_after(trace: Trace, t_us: int) -> bool:
    """Whether the gate was open at any time after `t_us`."""
    return any(gate for at_us, _, gate in trace.changes if at_us > t_us)


def described(one: Injection, start_us: int) -> str:
    """An injection in one line, its time in s after arming."""
    parameters = ",".join(f"{name}={value:.4g}" for name, value in one.parameters.items())
    lasts = f",lasts={one.lasts_s:.3g}" if math.isfinite(one.lasts_s) else ""
    return f"{one.kind.name}@{(one.at_us - start_us) * 1e-6:.2f}:{parameters}{lasts}"


def expectation(case: Case, onset_s: float, until_s: float) -> Expectation:
    """What must follow a case, given when it was safe (or the watching ended), s after arming."""
    healthy = healthy_J(case.scene, case.bench_seed, onset_s, until_s)
    allowed_J = healthy * _TWIN_SLACK + _TWIN_SLACK_J
    if len(case.rows) == 1:
        row = case.rows[0]
        then = row.then_in(case.scene.name)
        stop_J = row.stop_budget_J
        bounded = then not in (Then.GOES_ON, Then.MAY_STOP)
        budget_J = stop_J if bounded else allowed_J + (stop_J if math.isfinite(stop_J) else 0.0)
        told = then is Then.STOPS and row.kind.group in ("sensor", "actuator")
        return Expectation(then, row.faults, budget_J, told)
    between_J = healthy_J(case.scene, case.bench_seed, onset_s, onset_s + case.apart_s)
    return _pair_expectation(case, allowed_J, between_J * _TWIN_SLACK)


def _pair_expectation(case: Case, allowed_J: float, between_J: float) -> Expectation:
    """Of two faults: each may use its budget, and until the second the first may be harmless."""
    thens = {row.then_in(case.scene.name) for row in case.rows}
    faults = {name for row in case.rows for name in row.faults}
    noise = all(row.kind.group in _NOISE_GROUPS for row in case.rows)
    if noise:
        # Two disturbances of the line, each harmless, may together cost enough setpoints.
        faults.add("SETPOINT_LOST")
    budgets = [row.stop_budget_J for row in case.rows]
    stop_J = sum(budget for budget in budgets if math.isfinite(budget))
    if thens & {Then.RESTARTS, Then.ENDS_OFF} or (noise and Then.STOPS in thens):
        return Expectation(Then.ENDS_OFF, tuple(sorted(faults)), between_J + stop_J)
    if Then.STOPS in thens:
        return Expectation(Then.STOPS, tuple(sorted(faults)), between_J + stop_J)
    then = Then.MAY_STOP if faults else Then.GOES_ON
    return Expectation(then, tuple(sorted(faults)), allowed_J + stop_J)
