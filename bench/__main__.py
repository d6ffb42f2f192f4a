"""Print every number of the project: speed (a ratio is of one run), memory, sizes.

python -m bench [NAME …]     all benchmarks, or the named ones; `--list` names them
"""

import subprocess
import sys
import time

BENCHMARKS = {
    "wire": "frames and sessions",
    "plant": "the physics kernel against solve_ivp, alone and in parallel",
    "board": "the simulated board and bench",
    "control": "a control step, and virtual time",
    "runlog": "recording and reading runs",
    "daemon": "the control path beside a C program, idle and under load",
    "axes": "1, 3 and 6 axes beside a C program for each board, skew, stops",
    "stop_latency": "a third party's stop, idle and under floods",
    "view_stop": "a click on STOP of the live page, idle and under floods",
    "view_cost": "setpoint age with the live page open and closed, in pairs",
    "gap": "the diagnosis",
    "envs": "steps of many environments, and replays on executors",
    "footprint": "what a bench computer installs, in MB, and how long a client takes to import",
    "units": "the exported FMI unit beside the simulator: sizes, needs, speed",
    "cold_start": "the demo from a wheel, with nothing installed",
}
"""By module of this folder."""


def main(names: list[str]) -> int:
    if names == ["--list"]:
        for name, about in BENCHMARKS.items():
            print(f"{name:14}{about} (python -m bench.{name})")
        return 0
    unknown = [name for name in names if name not in BENCHMARKS]
    if unknown:
        known = ", ".join(BENCHMARKS)
        print(f"no benchmark named {unknown[0]}; there are: {known}", file=sys.stderr)
        return 2
    failed = []
    for name in names or BENCHMARKS:
        print(f"\n{name}: {BENCHMARKS[name]}\n", flush=True)
        start_s = time.monotonic()
        if subprocess.run([sys.executable, "-m", f"bench.{name}"], check=False).returncode:
            failed.append(name)
        print(f"({time.monotonic() - start_s:.0f} s)", flush=True)
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
