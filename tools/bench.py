"""Print every number of the project: speed as ratios within one run, memory, sizes.

python tools/bench.py [NAME …]     all benches, or the named ones; `--list` names them
"""

import subprocess
import sys
import time

BENCHES = {
    "wire": ("firmware_protocol.bench", "frames and sessions"),
    "plant": (
        "sim_device.plant.bench",
        "the physics kernel against solve_ivp, alone and in parallel",
    ),
    "board": ("sim_device.bench_numbers", "the simulated board and bench"),
    "control": ("smad.control.bench", "a control step, and virtual time"),
    "log": ("smad.runlog.bench", "recording and reading runs"),
    "daemon": ("smad.daemon.bench", "the control path beside a C program, idle and under load"),
    "stops": ("bench.stop_latency", "a third party's stop, idle and under floods"),
    "gap": ("smad.gap.bench", "the diagnosis"),
}


def main(names: list[str]) -> int:
    if names == ["--list"]:
        for name, (module, about) in BENCHES.items():
            print(f"{name:8}{about} (python -m {module})")
        return 0
    unknown = [name for name in names if name not in BENCHES]
    if unknown:
        print(f"no bench named {unknown[0]}; there are: {', '.join(BENCHES)}", file=sys.stderr)
        return 2
    failed = []
    for name in names or BENCHES:
        module, about = BENCHES[name]
        print(f"\n{name}: {about}\n", flush=True)
        start_s = time.monotonic()
        if subprocess.run([sys.executable, "-m", module], check=False).returncode:
            failed.append(name)
        print(f"({time.monotonic() - start_s:.0f} s)", flush=True)
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
