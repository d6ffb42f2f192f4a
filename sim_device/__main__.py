"""`python -m sim_device`: a simulated bench on a pseudo-terminal."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_device.bench import SimulatedBench

RATES_HZ = (100, 250, 500)
EXIT_BAD_INPUT = 2


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(prog="python -m sim_device", description=__doc__)
    add = parser.add_argument
    add("--rate", type=int, default=100, choices=RATES_HZ, help="samples per second of board time")
    add("--speed", type=float, default=1.0, help="board time over wall time (default 1)")
    add("--seed", type=int, default=0, help="of noise, tokens and damage on the line")
    add("--params", default="A", help="parameter file, or the built-in A, B or conserving")
    add("--variant", default="extended", choices=("extended", "printed"), help="thermal model")
    add(
        "--fixture",
        default="antagonistic",
        choices=("antagonistic", "stretch", "blocked"),
        help="how the springs are mounted",
    )
    add("--cooling", default="water", choices=("water", "air"), help="tubes with water, or bare")
    add(
        "--effects",
        default="{}",
        metavar="JSON",
        help='effects switched on, as {"name": {"parameter": value}}',
    )
    add(
        "--fault",
        action="append",
        default=[],
        metavar="NAME@T[:P=V,...]",
        help="inject a fault at T seconds of board time; repeat for more",
    )
    add("--list-faults", action="store_true", help="list the faults that can be injected, and end")
    add("--clock-start", type=int, default=0, metavar="US", help="board time at power-up")
    add("--symlink", type=Path, help="also make this symlink to the tty; removed at the end")
    add("--transport", default="pty", help="pty, or fd:N for one end of an inherited socket pair")
    add(
        "--paced-by-host",
        action="store_true",
        help="wait for the setpoint that answers each STATE, and for an arming to be confirmed",
    )
    add(
        "--host-timeout",
        type=float,
        default=2.0,
        metavar="S",
        help="wall time after which a silent host is left behind (default 2)",
    )
    add("--max-seconds", type=float, metavar="S", help="end after so much wall time")
    return parser


def make_bench(options: argparse.Namespace) -> SimulatedBench:
    """Return the bench that the options describe. Raises ValueError, BenchError, PlantError."""
    from sim_device.bench import SimulatedBench
    from sim_device.faults import parse_injection
    from sim_device.plant import load_parameters

    effects = json.loads(options.effects)
    if not isinstance(effects, Mapping):
        raise ValueError(f'--effects {options.effects!r}: give {{"name": {{"parameter": value}}}}')
    return SimulatedBench(
        parameters=load_parameters(options.params),
        variant=options.variant,
        effects=effects,
        fixture=options.fixture,
        cooling=options.cooling,
        rate_hz=options.rate,
        seed=options.seed,
        faults=[parse_injection(text) for text in options.fault],
        clock_start_us=options.clock_start,
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the simulated bench; return the exit status."""
    options = make_parser().parse_args(arguments)
    if options.list_faults:
        from sim_device.faults import list_faults

        print(list_faults())
        return 0
    from sim_device.errors import BenchError
    from sim_device.plant.errors import PlantError
    from sim_device.pty import said_of_host, serve

    try:
        # The first step compiles the physics, which may take seconds; no port is open meanwhile.
        make_bench(options).step()
        stats, counts = serve(
            {"": make_bench(options)},
            speed=options.speed,
            symlink=options.symlink,
            transport=options.transport,
            paced_by_host=options.paced_by_host,
            host_timeout_s=options.host_timeout if options.paced_by_host else None,
            max_seconds=options.max_seconds,
            on_ready=lambda names: print(f"port: {options.symlink or names['']}", flush=True),
        )
    except (BenchError, PlantError, ValueError, OSError) as error:
        print(f"sim_device: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    print(
        f"ended after {stats.samples} samples; {counts.bytes_in} bytes in, {counts.bytes_out} out, "
        f"{counts.dropped} pieces dropped; fell behind the clock {stats.grid_restarts} times, "
        f"{said_of_host(stats)}"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
