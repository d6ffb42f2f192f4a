"""How hot a wire gets whose RTD came off while 4 A heat it.

`python -m tests.sim_device.loose` prints the hottest wire for each set and each lag of the loose
RTD, over onsets from 0.5 to 12 s after arming: with a reading that follows, and with one that also
swings by 1 to 10 K in 0.5 to 10 s. `LIMIT=VALUE` tightens a limit.
"""

import sys
from typing import NamedTuple

from firmware_protocol.enums import Fault
from firmware_protocol.supervisor import tighten
from sim_device.bench import SimulatedBench
from sim_device.faults import injection
from sim_device.plant import load_parameters

from .harsh import FULL_MA, setpoint

LAGS_S = (9.0, 12.0, 20.0, 40.0, 60.0, 1e9)
ONSETS_S = (0.5, 2.0, 5.0, 8.0, 12.0)
SWINGS = [(swing_K, period_s) for swing_K in (1.0, 2.4, 5.0, 10.0) for period_s in (0.5, 3.0, 10.0)]
WATCHED_S = 90.0


class Loose(NamedTuple):
    """The hottest that the wire was, in °C, and the first fault, if the board found one."""

    hottest_degC: float
    fault: Fault | None


def loose(
    parameters: str,
    lag_s: float,
    swing_K: float = 0.0,
    period_s: float = 2.0,
    *,
    at_s: float = 2.0,
    limits: dict[str, int] | None = None,
) -> Loose:
    """Heat spring X of set `parameters` with 4 A, whose RTD comes off at `at_s`."""
    fault = injection("sensor_detached", at_s, value=lag_s, swing=swing_K, period=period_s)
    bench = SimulatedBench(parameters=load_parameters(parameters), seed=1, faults=[fault])
    supervisor = bench.board.supervisor
    supervisor.set_limits(tighten(supervisor.limits, limits or {}))
    bench.arm()
    state = bench.step_typed(None)
    hottest_K = 0.0
    while not state.faults and bench.now_us < WATCHED_S * 1e6:
        state = bench.step_typed(setpoint(state, FULL_MA))
        hottest_K = max(hottest_K, bench.plant.T_K[0])
    first = supervisor.first_fault
    return Loose(hottest_K - 273.15, None if first is None else first.fault)


def main() -> None:
    limits = {name: int(value) for name, _, value in (word.partition("=") for word in sys.argv[1:])}
    for parameters in ("A", "B"):
        for lag_s in LAGS_S:
            hottest = [
                max(
                    loose(parameters, lag_s, *swing, at_s=at_s, limits=limits)[0]
                    for swing in swings
                    for at_s in ONSETS_S
                )
                for swings in ([(0.0, 2.0)], SWINGS)
            ]
            print(
                f"set {parameters}, lag {lag_s:g} s: {hottest[0]:.0f} °C, "
                f"swinging {hottest[1]:.0f} °C",
                flush=True,
            )


if __name__ == "__main__":
    main()
