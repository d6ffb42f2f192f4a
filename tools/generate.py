"""Write every generated file anew, or with --check say which are stale and exit 1.

Each generator owns its files and its `--check`; this only calls them all.
"""

import subprocess
import sys

GENERATORS = (
    "firmware_protocol.generate",
    "firmware_protocol.supervisor.generate",
    "sim_device.plant.docs",
    "smad.docs",
)


def main() -> int:
    stale = [
        name
        for name in GENERATORS
        if subprocess.run([sys.executable, "-m", name, *sys.argv[1:]], check=False).returncode != 0
    ]
    if stale:
        print("stale or failed: " + ", ".join(stale) + " (run `make generate`)", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    raise SystemExit(main())
