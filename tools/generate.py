"""Write every generated file anew, or with --check say which are stale and exit 1.

Each generator owns its files and its `--check`; this only calls them all.
"""

import argparse
import subprocess
import sys

GENERATORS = (
    "firmware_protocol.generate",
    "firmware_protocol.supervisor.generate",
    "sim_device.plant.docs",
    "firmware.generate",
    "tools.blocking_client",
    "tools.commands_schema",
    "tools.reference",
    "evaluation.results.page",
)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; name what is stale")
    passed = ["--check"] if parser.parse_args().check else []
    stale = [
        name
        for name in GENERATORS
        if subprocess.run([sys.executable, "-m", name, *passed], check=False).returncode != 0
    ]
    if stale:
        print("stale or failed: " + ", ".join(stale) + " (run `make generate`)", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    raise SystemExit(main())
