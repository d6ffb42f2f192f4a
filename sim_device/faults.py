"""What can go wrong on the device's side, as scripted injections on the bench's time.

FAULT_KINDS is the table: where each acts, its parameters, what the board must name as the first
fault (empty: it must go on, or say nothing), and how much heat may still go into the springs after
the onset. An injection is a row with a time: `parse_injection("sensor_open@12:channel=1")`.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from firmware_protocol.enums import Fault, ResetCause
from firmware_protocol.nearest import instead
from sim_device import foreign
from sim_device.board import WRAP, Board
from sim_device.errors import FaultSpecError
from sim_device.hardware import Hardware
from sim_device.line import PROBE, Line
from sim_device.written import numbers_by_name

NEVER = 1 << 62

Parameters = Mapping[str, float]


class Breakable(Protocol):
    """What an injection may read and break of a bench, in the words of `SimulatedBench`."""

    now_us: int
    rng: random.Random
    hardware: Hardware
    board: Board
    uplink: Line
    downlink: Line
    echo: bool
    clock_ppm: int
    period_scale: int
    make: dict[str, Any]

    @property
    def heater_J(self) -> float: ...
    def receive(self, data: bytes) -> None: ...
    def junk_to_host(self, data: bytes) -> None: ...
    def reboot(self, cause: ResetCause, *, start_us: int = 0) -> None: ...
    def hang(self, seconds: float) -> None: ...
    def unplug(self, seconds: float, *, renamed: bool = False) -> None: ...


Action = Callable[[Breakable, Parameters], None]


@dataclass(frozen=True)
class FaultKind:
    """One row of the table. `begin` breaks something; `end` mends it after `lasts` seconds."""

    name: str
    group: str
    text: str
    begin: Action
    end: Action | None = None
    parameters: Parameters = field(default_factory=dict)
    expects: tuple[Fault, ...] = ()
    """Any of these may be the first fault, if heating shows the effect at all."""
    budget_J: float = math.inf
    """Heat into both springs after the onset at a full 4 A, in J, until the gate is off."""


@dataclass(frozen=True)
class Injection:
    """One row at one time. `lasts_s` is infinite for what stays broken."""

    kind: FaultKind
    at_us: int
    parameters: Parameters
    lasts_s: float = math.inf


class Scheduler:
    """Begins and ends injections when their time comes."""

    def __init__(self, bench: Breakable, injections: Sequence[Injection]) -> None:
        self._bench = bench
        self._waiting: list[tuple[int, int, str, Action, Injection]] = []
        self.begun: list[tuple[int, float, Injection]] = []
        """(time in us, heater energy in J, injection) of each that has begun."""
        for injection in injections:
            self.add(injection)

    @property
    def due_us(self) -> int:
        """When the next thing happens."""
        return self._waiting[0][0] if self._waiting else NEVER

    def add(self, injection: Injection) -> None:
        """Schedule one more; one whose time has passed begins at the next sample."""
        self._put(injection.at_us, "begin", injection.kind.begin, injection)

    def run(self) -> None:
        """Do all that is due at the bench's time."""
        while self._waiting and self._waiting[0][0] <= self._bench.now_us:
            at_us, _, phase, action, injection = self._waiting.pop(0)
            if phase == "begin":
                self.begun.append((self._bench.now_us, self._bench.heater_J, injection))
                end = injection.kind.end
                if end is not None and math.isfinite(injection.lasts_s):
                    self._put(at_us + round(injection.lasts_s * 1e6), "end", end, injection)
            action(self._bench, injection.parameters)

    def _put(self, at_us: int, phase: str, action: Action, injection: Injection) -> None:
        self._waiting.append((at_us, len(self._waiting), phase, action, injection))
        self._waiting.sort(key=lambda entry: entry[:2])


def _touch(bench: Breakable) -> None:
    bench.hardware.broken = True


def _rtd(mode: str) -> Action:
    def begin(bench: Breakable, p: Parameters) -> None:
        rtd = bench.hardware.rtds[int(p["channel"])]
        rtd.mode = mode
        rtd.value = p.get("value", 0.0)
        rtd.every = int(p.get("every", 1))
        rtd.swing_K = p.get("swing", 0.0)
        rtd.period_s = p.get("period", 2.0)
        _touch(bench)

    return begin


def _rtd_ok(bench: Breakable, p: Parameters) -> None:
    bench.hardware.rtds[int(p["channel"])].mode = "ok"


def _driver(mode: str) -> Action:
    def begin(bench: Breakable, p: Parameters) -> None:
        driver = bench.hardware.drivers[int(p["channel"])]
        driver.mode = mode
        driver.gain = p.get("gain", 1.0)
        _touch(bench)

    return begin


def _pump(mode: str) -> Action:
    def begin(bench: Breakable, p: Parameters) -> None:
        bench.hardware.pumps[int(p["channel"])].mode = mode
        _touch(bench)

    return begin


def _part(**broken: object) -> Action:
    """Set fields of the hardware; a value that is a str names a parameter."""

    def begin(bench: Breakable, p: Parameters) -> None:
        for name, value in broken.items():
            setattr(bench.hardware, name, p[value] if isinstance(value, str) else value)
        _touch(bench)

    return begin


def _slip(bench: Breakable, p: Parameters) -> None:
    bench.hardware.encoder_slip_counts += int(p["counts"])
    _touch(bench)


def _restart(cause: ResetCause) -> Action:
    return lambda bench, p: bench.reboot(cause)


def _hang(bench: Breakable, p: Parameters) -> None:
    bench.hang(p["seconds"])


def _slow(bench: Breakable, p: Parameters) -> None:
    bench.period_scale = int(p["times"])


def _not_slow(bench: Breakable, p: Parameters) -> None:
    bench.period_scale = 1


def _drift(bench: Breakable, p: Parameters) -> None:
    bench.clock_ppm = int(p["ppm"])


def _wrap(bench: Breakable, p: Parameters) -> None:
    bench.reboot(ResetCause.PIN, start_us=-round(p["seconds"] * 1e6) % WRAP)


def _another(**changes: object) -> Action:
    def begin(bench: Breakable, p: Parameters) -> None:
        bench.make = bench.make | changes
        bench.reboot(ResetCause.SOFTWARE)

    return begin


def _corrupt(bench: Breakable, p: Parameters) -> None:
    image = bytearray(bench.board.parameters.image())
    image[int(p["byte"]) % len(image)] ^= 0x10
    bench.board.image = bytes(image)
    bench.reboot(ResetCause.PIN)


def _lie(bench: Breakable, p: Parameters) -> None:
    bench.board.lying_sp_seq = int(p["by"])


def _lines(bench: Breakable, p: Parameters) -> list[Line]:
    return [[bench.uplink], [bench.downlink], [bench.uplink, bench.downlink]][int(p["way"])]


def _line(**fields: str | float) -> Action:
    """Set fields of the line(s); a value that is a str names a parameter."""

    def begin(bench: Breakable, p: Parameters) -> None:
        for line in _lines(bench, p):
            # Parameters are floats; a number of bytes has to be whole again.
            line.spoil(
                **{
                    name: type(getattr(line, name))(p[value] if isinstance(value, str) else value)
                    for name, value in fields.items()
                }
            )

    return begin


def _junk(bench: Breakable, p: Parameters) -> None:
    junk = bytes(bench.rng.randrange(1, 256) for _ in range(int(p["bytes"])))
    if p["way"] != 1:
        bench.receive(junk)
    if p["way"] != 0:
        bench.junk_to_host(junk)


def _probe(bench: Breakable, p: Parameters) -> None:
    bench.receive(PROBE)


def _echo(on: bool) -> Action:
    def begin(bench: Breakable, p: Parameters) -> None:
        bench.echo = on

    return begin


def _unplug(bench: Breakable, p: Parameters) -> None:
    bench.unplug(p["seconds"], renamed=bool(p["renamed"]))


_X = {"channel": 0.0}
_HOT_OR_NOT = (
    Fault.NOT_HEATING,
    Fault.MODEL_RESIDUAL,
    Fault.RESISTANCE_RTD_DISAGREE,
    Fault.HEATING_WHILE_OFF,
)
_TOO_MUCH = (Fault.OVER_CURRENT, Fault.UNCOMMANDED_CURRENT, Fault.CURRENT_HIGH)
_HALF_S_J = 8.0
"""HOLD after 100 ms of a full 12.2 W, then nothing; with slack for one hung second sample."""
_BOTH = {"way": 2.0}

_ROWS: tuple[FaultKind, ...] = (
    # Sensors
    FaultKind("sensor_open", "sensor", "an RTD's wire breaks", _rtd("open"), _rtd_ok,
              _X, (Fault.SENSOR_OPEN,), 2.0),
    FaultKind("sensor_short", "sensor", "an RTD's wires touch", _rtd("short"), _rtd_ok,
              _X, (Fault.SENSOR_SHORT,), 2.0),
    FaultKind("sensor_invalid", "sensor", "an RTD's converter gives no value", _rtd("invalid"),
              _rtd_ok, _X, (Fault.SENSOR_INVALID,), 2.0),
    FaultKind("sensor_stuck", "sensor", "an RTD's converter hangs", _rtd("stuck"), _rtd_ok,
              _X, (Fault.SENSOR_STUCK, Fault.NOT_HEATING), 80.0),
    FaultKind("sensor_detached", "sensor",
              "an RTD comes off: lag value s, and the reading swings by so many K in period s",
              _rtd("detached"), _rtd_ok, {**_X, "value": 12.0, "swing": 0.0, "period": 2.0},
              _HOT_OR_NOT, 60.0),
    FaultKind("sensors_swapped", "sensor", "the springs' RTDs change places",
              _part(rtds_swapped=True), _part(rtds_swapped=False), {},
              (Fault.SENSORS_SWAPPED, Fault.SENSOR_IMPLAUSIBLE, *_HOT_OR_NOT), 60.0),
    FaultKind("sensor_spikes", "sensor", "an RTD jumps by value K every so many samples",
              _rtd("spikes"), _rtd_ok, {**_X, "value": 30.0, "every": 20.0},
              (Fault.SENSOR_IMPLAUSIBLE,), 15.0),
    FaultKind("sensor_offset", "sensor", "an RTD reads value K wrong; shows when cold",
              _rtd("offset"), _rtd_ok, {**_X, "value": -10.0}, (Fault.SENSOR_IMPLAUSIBLE,)),
    FaultKind("encoder_slip", "sensor", "the encoder loses counts", _slip, None,
              {"counts": 2000.0}),
    FaultKind("encoder_lost", "sensor", "the encoder gives no signal", _part(encoder_lost=True),
              _part(encoder_lost=False), {}, (Fault.SENSOR_INVALID,), 2.0),
    FaultKind("force_saturated", "sensor", "the load cell is at its end",
              _part(force_saturated=True), _part(force_saturated=False), {},
              (Fault.SENSOR_INVALID,), 2.0),
    # Actuators
    FaultKind("driver_short", "actuator", "a FET fails short", _driver("short"), None, _X,
              _TOO_MUCH, 8.0),
    FaultKind("driver_open", "actuator", "a FET fails open", _driver("open"), None, _X,
              (Fault.DRIVER_OPEN,), 2.0),
    FaultKind("wire_cut", "actuator", "a spring's wire breaks", _driver("cut"), None, _X,
              (Fault.WIRE_OPEN,), 2.0),
    FaultKind("driver_gain", "actuator", "a driver's gain is wrong", _driver("ok"), None,
              {**_X, "gain": 0.8}, (Fault.CURRENT_LOW, Fault.CURRENT_HIGH), 3.0),
    FaultKind("supply_sag", "actuator", "the supply falls to so many volts",
              _part(supply_V="volts"), _part(supply_V=None), {"volts": 6.5},
              (Fault.BROWN_OUT,), 2.0),
    FaultKind("pump_dry", "actuator", "a pump runs without water", _pump("dry"), _pump("ok"), _X,
              (Fault.PUMP_DRY,), 40.0),
    FaultKind("pump_stalled", "actuator", "a pump is blocked", _pump("stalled"), _pump("ok"), _X,
              (Fault.PUMP_STALLED,), 25.0),
    FaultKind("pump_stuck_on", "actuator", "a pump's driver fails short", _pump("stuck_on"),
              _pump("ok"), _X, (Fault.PUMP_STUCK_ON,), 40.0),
    FaultKind("pump_no_flow", "actuator", "a pump turns and moves no water", _pump("blocked"),
              _pump("ok"), _X, (Fault.NO_COOLING,), 250.0),
    FaultKind("leak", "actuator", "the leak sensor gets wet", _part(leak=True), _part(leak=False),
              {}, (Fault.LEAK,), 3.0),
    # Board
    FaultKind("reboot", "board", "the board restarts", _restart(ResetCause.PIN), None, {}, (),
              0.5),
    FaultKind("power_cycle", "board", "the board is without power for a moment",
              _restart(ResetCause.POWER_ON), None, {}, (), 0.5),
    FaultKind("hang", "board", "the loop hangs; the watchdog restarts it after 120 ms", _hang,
              None, {"seconds": 0.07}, (Fault.LOOP_OVERRUN,), 4.0),
    FaultKind("slow_loop", "board", "each sample takes so many periods", _slow, _not_slow,
              {"times": 8.0}, (Fault.LOOP_OVERRUN,), 4.0),
    FaultKind("clock_drift", "board", "the board's clock runs fast", _drift, None, {"ppm": 200.0}),
    FaultKind("clock_wrap", "board", "the board restarts so many seconds before its clock wraps",
              _wrap, None, {"seconds": 5.0}),
    FaultKind("schema_older", "board", "the board restarts with an older message table",
              _another(codec=foreign.OLDER)),
    FaultKind("schema_newer", "board", "the board restarts with a newer message table",
              _another(codec=foreign.NEWER)),
    FaultKind("major_other", "board", "the board restarts with another protocol",
              _another(major=99)),
    FaultKind("corrupt_parameters", "board", "a stored parameter changes by one bit; restart",
              _corrupt, None, {"byte": 5.0}, (Fault.PARAM_CRC,), 0.5),
    FaultKind("lying_sp_seq", "board", "STATE acknowledges setpoints never sent", _lie, None,
              {"by": 77.0}),
    # Bytes; way 0 is to the board, 1 to the host, 2 both
    FaultKind("flip_bits", "bytes", "one to five bits of a byte flip", _line(flip="rate"),
              _line(flip=0.0), {**_BOTH, "rate": 1e-3}),
    FaultKind("bursts", "bytes", "runs of bytes are noise", _line(burst="rate"), _line(burst=0.0),
              {**_BOTH, "rate": 5e-4}),
    FaultKind("drop_bytes", "bytes", "bytes vanish", _line(drop="rate"), _line(drop=0.0),
              {**_BOTH, "rate": 1e-3}),
    FaultKind("insert_bytes", "bytes", "bytes appear", _line(insert="rate"), _line(insert=0.0),
              {**_BOTH, "rate": 1e-3}),
    FaultKind("duplicate_frames", "bytes", "frames arrive twice", _line(duplicate="rate"),
              _line(duplicate=0.0), {**_BOTH, "rate": 0.1}),
    FaultKind("swap_frames", "bytes", "frames change places", _line(swap="rate"), _line(swap=0.0),
              {**_BOTH, "rate": 0.2}),
    FaultKind("split_frames", "bytes", "so many bytes a sample", _line(split="bytes"),
              _line(split=0), {**_BOTH, "bytes": 100.0}),
    FaultKind("junk", "bytes", "so many bytes without a delimiter", _junk, None,
              {**_BOTH, "bytes": 1e6}),
    FaultKind("modem_probe", "bytes", "a modem manager tries the port", _probe),
    FaultKind("wrong_baud", "bytes", "every byte is another one", _line(garbled=True),
              _line(garbled=False), _BOTH, (Fault.SETPOINT_LOST,), _HALF_S_J),
    FaultKind("echo", "bytes", "the host hears itself", _echo(True), _echo(False)),
    # Link
    FaultKind("stall", "link", "nothing passes, then all at once", _line(stalled=True),
              _line(stalled=False), _BOTH, (Fault.SETPOINT_LOST,), _HALF_S_J),
    FaultKind("lost_way", "link", "one way is dead", _line(lost=True), _line(lost=False),
              {"way": 0.0}, (Fault.SETPOINT_LOST,), _HALF_S_J),
    FaultKind("delay", "link", "everything is late by so many us", _line(delay_us="us"),
              _line(delay_us=0), {**_BOTH, "us": 30_000.0}),
    FaultKind("unplug", "link", "the port goes away for so many seconds, and may be renamed",
              _unplug, None, {"seconds": 1.0, "renamed": 0.0}, (Fault.SETPOINT_LOST,), _HALF_S_J),
)  # fmt: skip

FAULT_KINDS: dict[str, FaultKind] = {row.name: row for row in _ROWS}


def fault_rows() -> list[tuple[str, str, str, str]]:
    """Return name, group, what happens, and the parameters with their defaults, of each fault."""
    return [
        (
            kind.name,
            kind.group,
            kind.text,
            ",".join(f"{name}={value:g}" for name, value in kind.parameters.items()),
        )
        for kind in FAULT_KINDS.values()
    ]


def _no_such(name: str) -> FaultSpecError:
    suggestion = instead(name, FAULT_KINDS, "smad sim --fault list shows them")
    return FaultSpecError(f"no fault is named {name!r}; {suggestion}")


def injection(name: str, at_s: float, **parameters: float) -> Injection:
    """Return the injection of row `name` at `at_s`; `lasts` (s) is how long, by default for ever.

    Raises FaultSpecError for a name, parameter or time that does not exist.
    """
    kind = FAULT_KINDS.get(name)
    if kind is None:
        raise _no_such(name)
    lasts_s = parameters.pop("lasts", math.inf)
    unknown = set(parameters) - set(kind.parameters)
    if unknown:
        other = min(unknown)
        raise FaultSpecError(
            f"{name} has no parameter {other}; {instead(other, (*kind.parameters, 'lasts'))}"
        )
    if not 0 <= at_s < math.inf or not lasts_s > 0:
        raise FaultSpecError(
            f"{name} at {at_s} s for {lasts_s} s: the time must be 0 or later and finite, "
            "and it must last longer than 0 s"
        )
    if not all(map(math.isfinite, parameters.values())):
        raise FaultSpecError(f"{name}: its parameters must be finite; got {parameters}")
    merged = {**kind.parameters, **parameters}
    if not 0 <= merged.get("channel", 0.0) < (4 if kind.group == "sensor" else 2):
        raise FaultSpecError(
            f"{name}: channel {merged['channel']:g} does not exist; 0 is X, 1 is Y"
        )
    if merged.get("way", 0.0) not in (0.0, 1.0, 2.0):
        raise FaultSpecError(f"{name}: way {merged['way']:g}; give 0 (to board), 1 (to host), 2")
    return Injection(kind, round(at_s * 1e6), merged, lasts_s)


_HOW_TO_WRITE = "write NAME@seconds[:parameter=value,...]"


def parse_injection(text: str) -> Injection:
    """Return the injection that NAME@t[:parameter=value,...] describes, t in seconds.

    Raises FaultSpecError with what is wrong.
    """
    head, _, tail = text.partition(":")
    name, at_sign, time = head.partition("@")
    if name not in FAULT_KINDS:
        raise _no_such(name)
    if not at_sign:
        raise FaultSpecError(f"{text!r} gives no time; {_HOW_TO_WRITE}")
    try:
        at_s = float(time)
    except ValueError:
        raise FaultSpecError(f"{text!r}: its time is not a number; {_HOW_TO_WRITE}") from None
    try:
        parameters = numbers_by_name(tail)
    except ValueError as error:
        raise FaultSpecError(f"{text!r}: {error}; {_HOW_TO_WRITE}") from None
    return injection(name.strip(), at_s, **parameters)
