"""The lockstep campaign: the daemon and a simulated board, over bytes, on virtual time."""

from __future__ import annotations

import asyncio
import math
import random
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace

import msgspec

from campaign.faults.catalogue import ROWS, Row
from campaign.faults.oracle import Expectation, Outcome, Then
from campaign.faults.scenes import SCENES, Scene
from campaign.faults.trace import HOT, Trace, WatchedBench
from campaign.virtual import Refused, Rig, VirtualLoop, result_of
from firmware_protocol.events import HostState
from sim_device.faults import Injection
from sim_device.plant import load_parameters
from smad.api import BY_PARAMS, Reason
from smad.config import Config, RecorderConfig
from smad.control.commands import ModeCommand
from smad.errors import SmadError

AFTER_STOP_S = 2.0
BENCHES = 4
TIGHTENED_UNHEATED_mJ = {"A": 20_000, "B": 8_000}
"""`unheated_energy_mJ` by parameter set: half more than its harshest legitimate motion needs."""

_CONFIG = Config(recorder=RecorderConfig(automatic=False, black_box_s=0.0))
_NOT_NOW = (Reason.NOT_CONNECTED, Reason.NOT_ARMED, Reason.FAULTED, Reason.STOPPED)
"""A script's command that is refused for these is asked for again."""
_SHORTEST_TWIN_S = 20.0
_TWIN_SLACK_J = 12.0
_TWIN_SLACK = 1.25
_NOISE_GROUPS = ("bytes", "link", "host")


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


@dataclass(frozen=True)
class _Ran:
    """A run that is over: its bench, and where its host stood."""

    bench: WatchedBench
    start_us: int
    reported: str
    """The first fault that clients were told of, of the board or the host; empty if none was."""
    by_host: bool
    """Whether that was a limit of the host."""
    running: bool


def run_case(case: Case) -> Outcome:
    """Run a case and return what came of it."""
    rng = random.Random(f"{case.seed} parameters")
    injections: list[Injection] = []

    async def broken(rig: Rig, bench: WatchedBench) -> None:
        if any(row.tightened for row in case.rows):
            _tighten(bench, case.bench_seed)
        start_us = bench.now_us
        injections.extend(
            row.drawn(rng, start_us + round(onset_s * 1e6))
            for row, onset_s in zip(case.rows, case.onsets_s, strict=True)
        )
        for injected in injections:
            bench.faults.add(injected)
        lasts_s = max((_lasts_s(injected) for injected in injections), default=0.0)
        end_us = start_us + round((max(case.onsets_s) + lasts_s + case.observe_s) * 1e6)
        await _carry_out(rig, bench, case.scene, end_us, stop_after=len(injections))

    return _outcome(case, _run(case.scene, case.bench_seed, broken), injections)


def _run(
    scene: Scene, bench_seed: int, work: Callable[[Rig, WatchedBench], Awaitable[None]]
) -> _Ran:
    """Arm a bench with a daemon, let `work` do with both what it does, and end them."""

    async def armed() -> _Ran:
        bench = WatchedBench(
            parameters=load_parameters("AB"[bench_seed % 2]), seed=bench_seed, cooling=scene.cooling
        )
        bench.host = rig = Rig(_CONFIG, bench, nonce=1000 + bench_seed)
        try:
            rig.daemon.start()
            await rig.arm()
            start_us = bench.now_us
            await work(rig, bench)
            fault_events = [event.data for event in rig.events if event.kind == "fault"]
            first = next((data for data in fault_events if "name" in data), {})
            return _Ran(
                bench=bench,
                start_us=start_us,
                reported=first.get("name", ""),
                by_host=first.get("by") == "host",
                running=rig.axis.session.state is HostState.RUNNING,
            )
        finally:
            await rig.close()

    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(armed())


def _tighten(bench: WatchedBench, bench_seed: int) -> None:
    supervisor = bench.board.supervisor
    energy_mJ = TIGHTENED_UNHEATED_mJ["AB"[bench_seed % 2]]
    supervisor.set_limits(replace(supervisor.limits, unheated_energy_mJ=energy_mJ))


async def _carry_out(
    rig: Rig, bench: WatchedBench, scene: Scene, end_us: int, stop_after: int = 0
) -> None:
    """Carry out the script until the end, or until some time after the bench stopped."""
    start_us = bench.now_us
    waiting = list(scene.script)
    while bench.now_us < end_us:
        passed_s = (bench.now_us - start_us) * 1e-6
        running = rig.axis.session.state is HostState.RUNNING
        if waiting and passed_s >= waiting[0][0] and running and _commanded(rig, waiting[0][1]):
            waiting.pop(0)
        await rig.sample()
        begun = len(bench.faults.begun) >= stop_after
        if stop_after and begun and bench.board.state not in HOT:
            # What ends (a stall that is flushed, a host that wakes) has to be seen to end.
            last_us = max(bench.now_us, rig.stalled_until_us, _mended_us(bench))
            end_us = min(end_us, last_us + round(AFTER_STOP_S * 1e6))
            stop_after = 0


def _commanded(rig: Rig, command: ModeCommand) -> bool:
    """Ask for a motion; return whether the daemon took it, and did not refuse it for its state."""
    params = {name: value for name, value in msgspec.to_builtins(command).items() if name != "mode"}
    try:
        result_of(rig.begin(BY_PARAMS[type(command)].name, **params).result())
    except Refused as refused:
        if refused.reason in _NOT_NOW:
            return False
        raise
    return True


def _lasts_s(injected: Injection) -> float:
    """How long a fault lasts that ends by itself; 0 for one that stays."""
    return injected.lasts_s if math.isfinite(injected.lasts_s) else 0.0


def _mended_us(bench: WatchedBench) -> int:
    """When the last of what ends by itself has ended, of what has begun."""
    ends_us = [0]
    for _, _, injected in bench.faults.begun:
        lasts_s = (
            injected.lasts_s
            if math.isfinite(injected.lasts_s)
            else injected.parameters.get("seconds", 0.0)
        )
        ends_us.append(injected.at_us + round(lasts_s * 1e6))
    return max(ends_us)


_TWINS: dict[tuple[str, int], tuple[float, int, Trace]] = {}
"""Of healthy benches, by scene and bench: for how long (s after arming), start in us, trace."""


def _healthy(scene: Scene, bench_seed: int, to_s: float) -> tuple[int, Trace]:
    """Start and trace, until `to_s` after arming at least, of a scene with nothing broken."""
    known_s, start_us, trace = _TWINS.get((scene.name, bench_seed), (0.0, 0, Trace()))
    if known_s >= to_s:
        return start_us, trace
    until_s = max(_SHORTEST_TWIN_S, 2.0 * known_s, to_s)

    async def whole(rig: Rig, bench: WatchedBench) -> None:
        await _carry_out(rig, bench, scene, bench.now_us + round(until_s * 1e6))

    ran = _run(scene, bench_seed, whole)
    if ran.bench.board.state not in HOT:
        raise SmadError(
            "the healthy bench stopped by itself",
            value=f"{scene.name}, bench {bench_seed}",
            action="this is a nuisance trip; run the scene alone to see why",
        )
    _TWINS[scene.name, bench_seed] = until_s, ran.start_us, ran.bench.trace
    return ran.start_us, ran.bench.trace


def healthy_J(scene: Scene, bench_seed: int, from_s: float, to_s: float) -> float:
    """Heat of the same bench with nothing broken, between two times after arming, in J."""
    start_us, trace = _healthy(scene, bench_seed, to_s)
    return trace.heat_at(start_us + round(to_s * 1e6)) - trace.heat_at(
        start_us + round(from_s * 1e6)
    )


def _outcome(case: Case, ran: _Ran, injections: list[Injection]) -> Outcome:
    bench, trace, start_us = ran.bench, ran.bench.trace, ran.start_us
    onset_us = bench.faults.begun[0][0]
    # A second fault may come when the first has stopped the bench already.
    safe_us = trace.safe_at(onset_us)
    heat_at_onset_J = bench.faults.begun[0][1]
    until_us = bench.now_us if safe_us is None else safe_us
    energy_J = trace.heat_at(until_us) - heat_at_onset_J
    off = safe_us is not None
    latched = bench.board.supervisor.first_fault
    by_board = "" if latched is None else latched.fault.name
    return Outcome(
        name=" + ".join(case.row_names),
        group="pair" if len(case.rows) > 1 else case.rows[0].kind.group,
        scene=case.scene.name,
        injected=" + ".join(described(injected, start_us) for injected in injections),
        expected=expectation(
            case,
            (onset_us - start_us) * 1e-6,
            (until_us - start_us) * 1e-6,
        ),
        first_fault=ran.reported if ran.by_host else by_board,
        told_fault=ran.reported,
        safe_after_s=None if safe_us is None else (safe_us - onset_us) * 1e-6,
        energy_J=energy_J,
        energy_after_safe_J=trace.heat_J[-1] - trace.heat_at(until_us),
        hottest_degC=trace.hottest_since(onset_us),
        states=states_after(trace, onset_us),
        gate_open_later=off and gate_open_after(trace, until_us),
        host_running_later=off and ran.running,
    )


def states_after(trace: Trace, onset_us: int) -> tuple[tuple[float, str], ...]:
    """The state at the onset, at 0, and those that followed, with their times in s."""
    visited: list[tuple[float, str]] = []
    for t_us, state, _ in trace.changes:
        if t_us <= onset_us:
            visited = [(0.0, state.name)]
        elif not visited or visited[-1][1] != state.name:
            visited.append(((t_us - onset_us) * 1e-6, state.name))
    return tuple(visited)


def gate_open_after(trace: Trace, t_us: int) -> bool:
    """Whether the gate was open at any time after `t_us`."""
    return any(gate for at_us, _, gate in trace.changes if at_us > t_us)


def described(injected: Injection, start_us: int) -> str:
    """An injection in one line, its time in s after arming."""
    parameters = ",".join(f"{name}={value:.4g}" for name, value in injected.parameters.items())
    lasts = f",lasts={injected.lasts_s:.3g}" if math.isfinite(injected.lasts_s) else ""
    return f"{injected.kind.name}@{(injected.at_us - start_us) * 1e-6:.2f}:{parameters}{lasts}"


def expectation(case: Case, onset_s: float, until_s: float) -> Expectation:
    """What must follow a case, given when it was safe (or the watching ended), s after arming."""

    def twin_J(to_s: float) -> float:
        return healthy_J(case.scene, case.bench_seed, onset_s, to_s) * _TWIN_SLACK

    if len(case.rows) > 1:
        return _pair_expectation(case, twin_J, onset_s, until_s)
    row = case.rows[0]
    then = row.then_in(case.scene.name)
    stop_J = row.stop_budget_J
    if then in (Then.GOES_ON, Then.MAY_STOP):
        more_J = stop_J if math.isfinite(stop_J) else 0.0
        budget_J = twin_J(until_s) + _TWIN_SLACK_J + more_J
        return Expectation(then, row.faults, budget_J, host_is_told=True)
    return Expectation(then, row.faults, stop_J, host_is_told=True)


def _pair_expectation(
    case: Case, twin_J: Callable[[float], float], onset_s: float, until_s: float
) -> Expectation:
    """Of two faults: each may use its budget, and until the second the first may be harmless."""
    thens = {row.then_in(case.scene.name) for row in case.rows}
    faults = {name for row in case.rows for name in row.faults}
    noise = all(row.kind.group in _NOISE_GROUPS for row in case.rows)
    if noise:
        # Two disturbances of the line, each harmless, may together cost enough setpoints.
        faults.add("SETPOINT_LOST")
    budgets = [row.stop_budget_J for row in case.rows]
    stop_J = sum(budget for budget in budgets if math.isfinite(budget))
    off = thens & {Then.RESTARTS, Then.ENDS_OFF} or (noise and Then.STOPS in thens)
    if off or Then.STOPS in thens:
        then = Then.ENDS_OFF if off else Then.STOPS
        return Expectation(then, tuple(sorted(faults)), twin_J(onset_s + case.apart_s) + stop_J)
    then = Then.MAY_STOP if faults else Then.GOES_ON
    return Expectation(then, tuple(sorted(faults)), twin_J(until_s) + _TWIN_SLACK_J + stop_J)
