"""What the lockstep campaign injects: each row of the device's table, and faults of the host.

A row here adds to a row of `sim_device.faults` what its parameters are drawn from, where it must
show, and what must follow. Expected faults and heat budgets are those of the device's table.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from campaign.faults.oracle import Then
from campaign.faults.scenes import SCENES
from campaign.faults.trace import WatchedBench
from firmware_protocol.enums import Fault
from sim_device.faults import FAULT_KINDS, Breakable, FaultKind, Injection

Draw = Callable[[random.Random], float]
ALL = frozenset(SCENES)
HOLD_BUDGET_J = FAULT_KINDS["stall"].budget_J
RESTART_BUDGET_J = FAULT_KINDS["reboot"].budget_J


def between(low: float, high: float) -> Draw:
    """Drawn evenly."""
    return lambda rng: rng.uniform(low, high)


def whole(low: int, high: int) -> Draw:
    """A whole number, both ends included."""
    return lambda rng: float(rng.randint(low, high))


def decades(low: float, high: float) -> Draw:
    """Drawn evenly in the logarithm."""
    return lambda rng: math.exp(rng.uniform(math.log(low), math.log(high)))


def one_of(*values: float) -> Draw:
    """One of the values, or of the ends of the range, at random."""
    return lambda rng: rng.choice(values)


def either(*draws: Draw) -> Draw:
    """One of several ways to draw."""
    return lambda rng: rng.choice(draws)(rng)


@dataclass(frozen=True)
class Row:
    """One fault of the campaign. In `must` scenes it has to end as `then`, elsewhere it may."""

    name: str
    kind: FaultKind
    then: Then
    draws: Mapping[str, Draw] = field(default_factory=dict)
    must: frozenset[str] = ALL
    lasts_s: Draw | None = None
    observe_s: float = 5.0
    """How long to watch if nothing stops, after it ended."""
    expects: tuple[Fault, ...] | None = None
    budget_J: float | None = None
    scenes: frozenset[str] = ALL
    onset_s: tuple[float, float] | None = None
    """When it begins, s after arming; None: whenever faults begin in the scene."""
    tightened: bool = False
    """Whether the board's limits are those of a bench that is known well."""

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the faults that tell the cause."""
        return tuple(f.name for f in (self.kind.expects if self.expects is None else self.expects))

    @property
    def stop_budget_J(self) -> float:
        """Heat that may go in until it stops; infinite for what needs not stop."""
        return self.kind.budget_J if self.budget_J is None else self.budget_J

    def then_in(self, scene: str) -> Then:
        """What must follow in a scene."""
        if self.then is Then.STOPS and scene not in self.must:
            return Then.MAY_STOP
        return self.then

    def drawn(self, rng: random.Random, at_us: int) -> Injection:
        """The injection at a time, its parameters drawn from `rng`."""
        parameters = {**self.kind.parameters}
        parameters.update({name: draw(rng) for name, draw in self.draws.items()})
        lasts_s = math.inf if self.lasts_s is None else self.lasts_s(rng)
        return Injection(self.kind, at_us, parameters, lasts_s)


def _stall_host(bench: Breakable, p: Mapping[str, float]) -> None:
    assert isinstance(bench, WatchedBench)
    bench.host.stall(p["seconds"])


def _jump_clock(bench: Breakable, p: Mapping[str, float]) -> None:
    assert isinstance(bench, WatchedBench)
    bench.host.jump_wall_clock(p["seconds"])


HOST_STALL = FaultKind(
    "host_stall",
    "host",
    "the host does not run for so many seconds",
    _stall_host,
    None,
    {"seconds": 0.3},
)
WALL_JUMP = FaultKind(
    "wall_clock_jump",
    "host",
    "the host's wall clock jumps by so many seconds",
    _jump_clock,
    None,
    {"seconds": 3600.0},
)

_RTD = {"channel": whole(0, 3)}
_X = {"channel": one_of(0.0)}
_SIDE = {"channel": whole(0, 1)}
_WAY = {"way": whole(0, 2)}
_TO_BOARD, _TO_HOST = {"way": one_of(0.0, 2.0)}, {"way": one_of(1.0)}
_LOST = (Fault.SETPOINT_LOST,)
_SHORT, _LONG = between(0.05, 0.4), either(between(0.8, 2.0), one_of(10.0))
_HEATS_HARD = frozenset({"heating"})
_NOISY = between(1.0, 4.0)


def _of(name: str, then: Then, draws: Mapping[str, Draw] | None = None, **more: object) -> Row:
    alias = str(more.pop("alias", name))
    return Row(alias, FAULT_KINDS[name], then, draws or {}, **more)  # type: ignore[arg-type]


def _restart(name: str, draws: Mapping[str, Draw] | None = None, observe_s: float = 5.0) -> Row:
    return _of(name, Then.RESTARTS, draws, budget_J=RESTART_BUDGET_J, observe_s=observe_s)


# A host that hears nothing says HELLO again after half a second; if the board hears that, the new
# session disarms it just before it would have given up on setpoints itself: hence *_to_host.
_ROWS: tuple[Row, ...] = (
    _of("sensor_open", Then.STOPS, _RTD),
    _of("sensor_short", Then.STOPS, _RTD),
    _of("sensor_invalid", Then.STOPS, _RTD),
    _of("sensor_stuck", Then.STOPS, _X, must=_HEATS_HARD, observe_s=25.0),
    # Warming up at full power it shows, if the board's limit is that of its bench; a spring that is
    # held, or whose current is folded back already, gives it nothing to lag behind.
    _of("sensor_detached", Then.STOPS, {**_X, "value": between(9.0, 20.0)}, observe_s=25.0,
        scenes=_HEATS_HARD, onset_s=(0.0, 5.0), tightened=True),
    _of("sensor_detached", Then.STOPS, {**_X, "value": between(9.0, 20.0)}, must=frozenset(),
        observe_s=25.0, alias="detached_late"),
    # Slower than the host calls broken, which would stop it first.
    _of("sensor_detached", Then.STOPS,
        {**_X, "value": between(9.0, 20.0), "swing": between(1.0, 10.0),
         "period": decades(1.0, 10.0)},
        observe_s=40.0, scenes=_HEATS_HARD, onset_s=(0.0, 5.0), tightened=True,
        alias="detached_swings"),
    # Plugs change places between two runs. Later, the jump makes the host end the motion.
    _of("sensors_swapped", Then.STOPS, must=_HEATS_HARD, observe_s=25.0, onset_s=(0.0, 0.3)),
    _of("sensors_swapped", Then.STOPS, observe_s=25.0, alias="swapped_late"),
    _of("sensor_spikes", Then.STOPS,
        {**_RTD, "value": either(between(10.0, 60.0), between(-40.0, -10.0)),
         "every": whole(5, 40)}),
    _of("sensor_offset", Then.STOPS, {**_RTD, "value": between(-12.0, -6.0)}, must=frozenset(),
        observe_s=20.0, budget_J=15.0),
    _of("encoder_slip", Then.GOES_ON, {"counts": whole(200, 5000)}),
    _of("encoder_lost", Then.STOPS),
    _of("force_saturated", Then.STOPS),
    _of("driver_short", Then.STOPS, _SIDE),
    _of("driver_open", Then.STOPS, _X, must=frozenset({"heating", "water", "air"})),
    _of("wire_cut", Then.STOPS, _X, must=frozenset({"heating", "water", "air"})),
    _of("driver_gain", Then.STOPS,
        {**_X, "gain": either(between(0.5, 0.75), between(1.3, 1.6))},
        must=frozenset({"water", "air"}),
        # At 4 A a gain above 1.2 is more than any setpoint may ask for, and that trips sooner.
        expects=(Fault.CURRENT_LOW, Fault.CURRENT_HIGH, Fault.OVER_CURRENT)),
    _of("supply_sag", Then.STOPS, {"volts": between(5.0, 7.2)}),
    _of("pump_dry", Then.STOPS, _X, must=frozenset({"water"}), observe_s=20.0),
    _of("pump_stalled", Then.STOPS, _X, must=frozenset({"water"}), observe_s=20.0),
    _of("pump_stuck_on", Then.STOPS, _SIDE, must=frozenset({"heating", "air"}), observe_s=20.0),
    # Only a spring without current tells whether its water cools it.
    _of("pump_no_flow", Then.STOPS, _X, observe_s=45.0, scenes=frozenset({"flushing"})),
    _of("pump_no_flow", Then.STOPS, _X, must=frozenset(), observe_s=45.0, alias="no_flow_heating"),
    _of("leak", Then.STOPS),
    _restart("reboot"),
    _restart("power_cycle"),
    _of("hang", Then.STOPS, {"seconds": between(0.06, 0.095)}),
    _of("hang", Then.RESTARTS, {"seconds": between(0.12, 0.5)}, alias="hang_watchdog",
        budget_J=4.0),
    _of("slow_loop", Then.STOPS, {"times": whole(6, 12)}),
    _of("clock_drift", Then.GOES_ON, {"ppm": between(-200.0, 200.0)}, observe_s=10.0),
    _restart("clock_wrap", {"seconds": between(0.5, 5.0)}, observe_s=8.0),
    _restart("schema_older"),
    _restart("schema_newer"),
    _restart("major_other"),
    _of("corrupt_parameters", Then.STOPS, {"byte": whole(0, 300)}),
    _of("lying_sp_seq", Then.GOES_ON, {"by": whole(1, 255)}),
    _of("flip_bits", Then.GOES_ON, {**_WAY, "rate": decades(1e-5, 1e-3)}, lasts_s=_NOISY),
    _of("bursts", Then.GOES_ON, {**_WAY, "rate": decades(1e-5, 5e-4)}, lasts_s=_NOISY),
    _of("drop_bytes", Then.GOES_ON, {**_WAY, "rate": decades(1e-5, 1e-3)}, lasts_s=_NOISY),
    _of("insert_bytes", Then.GOES_ON, {**_WAY, "rate": decades(1e-5, 1e-3)}, lasts_s=_NOISY),
    _of("duplicate_frames", Then.GOES_ON, {**_WAY, "rate": between(0.02, 0.5)}, lasts_s=_NOISY),
    _of("swap_frames", Then.GOES_ON, {**_WAY, "rate": between(0.02, 0.5)}, lasts_s=_NOISY),
    _of("split_frames", Then.GOES_ON, {**_WAY, "bytes": whole(100, 150)}, lasts_s=_NOISY),
    _of("junk", Then.GOES_ON, {**_WAY, "bytes": decades(100, 1e6)}),
    _of("modem_probe", Then.GOES_ON),
    _of("wrong_baud", Then.GOES_ON, _WAY, lasts_s=_SHORT, alias="wrong_baud_short"),
    _of("wrong_baud", Then.STOPS, _TO_BOARD, lasts_s=_LONG),
    _of("wrong_baud", Then.ENDS_OFF, _TO_HOST, lasts_s=_LONG, alias="wrong_baud_to_host"),
    _of("echo", Then.GOES_ON, lasts_s=_NOISY),
    _of("stall", Then.GOES_ON, _WAY, lasts_s=_SHORT, alias="stall_short"),
    _of("stall", Then.STOPS, _TO_BOARD, lasts_s=_LONG),
    _of("stall", Then.ENDS_OFF, _TO_HOST, lasts_s=_LONG, alias="stall_to_host"),
    _of("lost_way", Then.GOES_ON, _WAY, lasts_s=_SHORT, alias="lost_way_short"),
    _of("lost_way", Then.STOPS, _TO_BOARD, lasts_s=_LONG),
    _of("lost_way", Then.ENDS_OFF, _TO_HOST, lasts_s=_LONG, alias="lost_way_to_host"),
    _of("delay", Then.GOES_ON, {**_WAY, "us": between(1000.0, 15_000.0)}, lasts_s=_NOISY),
    _of("delay", Then.STOPS, {**_WAY, "us": between(70_000.0, 300_000.0)}, alias="delay_long",
        expects=_LOST, budget_J=HOLD_BUDGET_J),
    _of("unplug", Then.ENDS_OFF, {"seconds": between(0.05, 0.4), "renamed": whole(0, 1)},
        alias="unplug_short"),
    _of("unplug", Then.STOPS, {"seconds": between(0.8, 3.0), "renamed": whole(0, 1)}),
    Row("host_stall", HOST_STALL, Then.GOES_ON, {"seconds": between(0.05, 0.45)}),
    Row("host_stall_long", HOST_STALL, Then.STOPS, {"seconds": between(0.8, 3.0)},
        expects=_LOST, budget_J=HOLD_BUDGET_J),
    Row("wall_clock_jump", WALL_JUMP, Then.GOES_ON, {"seconds": between(-7200.0, 7200.0)}),
)  # fmt: skip

ROWS: dict[str, Row] = {row.name: row for row in _ROWS}
