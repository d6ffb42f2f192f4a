"""Legitimate harsh use of a bench, as scripts of setpoints: nothing here may trip a check.

`python -m tests.sim_device.harsh FIRST LAST` runs every script on the benches of seeds FIRST to
LAST - 1 (0 and 1 are the built-in sets) and prints each trip and the hours that were run.
"""

import math
import random
import sys
from collections.abc import Callable

from firmware_protocol.enums import SetpointFlag
from firmware_protocol.messages import Setpoint, State
from sim_device.bench import SimulatedBench
from sim_device.plant import ParameterSet, load_parameters
from sim_device.plant.errors import ParameterError

FULL_MA = 4000
Script = Callable[[float, State], Setpoint]


def setpoint(
    state: State, x_mA: float = 0, y_mA: float = 0, duty: tuple[int, int] = (0, 0), flags: int = 0
) -> Setpoint:
    return Setpoint(0, state.t_us, (round(x_mA), round(y_mA)), duty, flags, 100)


class Positioner:
    """PI on displacement that heats the pulling spring and pumps the other one."""

    def __init__(self, reference_mm: Callable[[float], float], *, pumps: bool = True) -> None:
        self.reference_mm = reference_mm
        self.pumps = pumps
        self.sum_mm_s = 0.0
        self.last_s: float | None = None

    def __call__(self, t_s: float, state: State) -> Setpoint:
        error_mm = self.reference_mm(t_s) - state.encoder_counts / 1000.0
        dt_s = 0.0 if self.last_s is None else t_s - self.last_s
        self.last_s = t_s
        command_mA = 15_000 * error_mm + 3_000 * self.sum_mm_s
        if abs(command_mA) < FULL_MA:
            self.sum_mm_s += error_mm * dt_s
        current_mA = max(-FULL_MA, min(FULL_MA, command_mA))
        duty = min(255, round(abs(current_mA) / FULL_MA * 255)) if self.pumps else 0
        if current_mA >= 0:
            return setpoint(state, current_mA, 0, (0, duty))
        return setpoint(state, 0, -current_mA, (duty, 0))


def sine(amplitude_mm: float, period_s: float, *, pumps: bool = True) -> Script:
    return Positioner(lambda t: amplitude_mm * math.sin(2 * math.pi * t / period_s), pumps=pumps)


def steps(amplitude_mm: float, half_s: float) -> Script:
    return Positioner(lambda t: amplitude_mm * (1 if t % (2 * half_s) < half_s else -1))


def plain(x_mA: float, y_mA: float = 0, duty: tuple[int, int] = (0, 0), flags: int = 0) -> Script:
    return lambda t, state: setpoint(state, x_mA, y_mA, duty, flags)


def heat_then_flush(t_s: float, state: State) -> Setpoint:
    if t_s % 40.0 < 12.0:
        return setpoint(state, FULL_MA)
    return setpoint(state, duty=(255, 0))


def bang_bang(t_s: float, state: State) -> Setpoint:
    return setpoint(state, FULL_MA if (t_s * 2.0) % 1.0 < 0.5 else 0.0)


DRY = int(SetpointFlag.DRAIN_X | SetpointFlag.DRAIN_Y)

SCRIPTS: dict[str, tuple[Callable[[], Script], float]] = {
    "4 A in still water": (lambda: plain(FULL_MA), 60.0),
    "4 A in both springs": (lambda: plain(FULL_MA, FULL_MA), 40.0),
    "4 A with the pump on": (lambda: plain(FULL_MA, 0, (255, 255)), 60.0),
    "4 A in drained tubes": (lambda: plain(FULL_MA, 0, (0, 0), DRY), 20.0),
    "1 A for two minutes": (lambda: plain(1000), 130.0),
    "sine 12 mm, 20 s": (lambda: sine(12.0, 20.0), 60.0),
    "sine 2 mm, 3 s": (lambda: sine(2.0, 3.0), 30.0),
    "sine 2 mm, 7 s without water": (lambda: sine(2.0, 7.0, pumps=False), 70.0),
    "steps of 10 mm": (lambda: steps(10.0, 20.0), 80.0),
    "hold 5 mm": (lambda: Positioner(lambda t: 5.0), 180.0),
    "heat, then flush": (lambda: heat_then_flush, 80.0),
    "4 A on and off twice a second": (lambda: bang_bang, 20.0),
}

WITHOUT_WATER = ("4 A in both springs", "sine 2 mm, 7 s without water", "1 A for two minutes")
"""Scripts that use no pump, so that they make sense with bare wires in air too."""


def run(bench: SimulatedBench, script: Script, seconds: float) -> State:
    """Arm and run a script; return the first STATE that is not ARMED, else the last."""
    bench.arm()
    state = bench.step_typed(None)
    start_us = bench.now_us
    while bench.now_us - start_us < seconds * 1e6:
        state = bench.step_typed(script((bench.now_us - start_us) * 1e-6, state))
        if state.faults:
            break
    return state


# Parameters of which the largest current or the supply is the point: a bench that cannot give 4 A
# is not asked for it.
FIXED = ("current_max", "supply_voltage", "supply_resistance")

AROUND_B = 200
"""Benches from this seed on are drawn around set B."""


def drawn_parameters(seed: int) -> ParameterSet:
    """Return a bench with every parameter drawn uniformly within its range.

    The ranges are those of both sets. From seed AROUND_B on, what sets B apart from A is kept as
    it is in B: resistivity, share of the water that warms, loss of the tube.
    """
    rng = random.Random(seed)
    base, other = load_parameters("A"), load_parameters("B")
    kept = set(FIXED)
    if seed >= AROUND_B:
        kept |= {entry.name for entry in base.entries if base[entry.name] != other[entry.name]}
        base = other
    while True:
        values = {
            entry.name: rng.uniform(entry.low, entry.high)
            for entry in base.entries
            if entry.name not in kept
        }
        try:
            return base.replace(**values)
        except ParameterError:
            # The draw broke an ordering, such as start above finish.
            continue


def bench_of(seed: int) -> ParameterSet:
    """Return set A, set B, and from seed 2 on drawn benches."""
    return load_parameters("AB"[seed]) if seed < 2 else drawn_parameters(seed)


def campaign(first: int, last: int) -> tuple[int, float]:
    """Run every script on benches `first` to `last` - 1; return the trips and the hours run."""
    trips, hours = 0, 0.0
    for seed in range(first, last):
        parameters = bench_of(seed)
        for name, (make, seconds) in SCRIPTS.items():
            for cooling in ("water", "air") if name in WITHOUT_WATER else ("water",):
                bench = SimulatedBench(parameters=parameters, seed=seed, cooling=cooling)
                state = run(bench, make(), seconds)
                hours += bench.now_us / 3.6e9
                if state.faults:
                    trips += 1
                    first_fault = bench.board.supervisor.first_fault
                    print(f"bench {seed}, {name}, {cooling}: {first_fault}", flush=True)
    return trips, hours


def main() -> int:
    trips, hours = campaign(int(sys.argv[1]), int(sys.argv[2]))
    print(f"{trips} trips in {hours:.1f} hours of board time")
    return 1 if trips else 0


if __name__ == "__main__":
    sys.exit(main())
