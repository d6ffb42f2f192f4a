"""What a bench computer's smad puts on a disk, and how long a client takes to import.

Installs the dependency group `bench` and a wheel of this tree into an environment of its own, from
the package index. Goals: 60 MB for client, daemon and run log; 50 ms of processor time for
`from smad import Client`.

python -m bench.footprint [EXTRA …]     also what each of these extras adds, e.g. log sim
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path
from statistics import median

from bench.cold_start import build_wheel

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
GOAL_MB = 60.0
GOAL_MS = 50.0
IMPORTS = 21
CLIENT = "from smad import Client"
FLOOR = "import msgspec, zmq"
"""What a client cannot do without."""
_TIMED = """
import time
begun = time.process_time()
{}
print((time.process_time() - begun) * 1e3)
"""


def megabytes(folder: Path) -> float:
    """Return what the files of a folder hold together, compiled modules left out."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.suffix != ".pyc")
    return sum(path.stat().st_size for path in files) / 1e6


class Environment:
    """An environment with nothing but pip, until something is installed."""

    def __init__(self, folder: Path) -> None:
        venv.create(folder, with_pip=True)
        self.python = str(folder / "bin" / "python")
        self.site = next(folder.glob("lib/python*/site-packages"))
        self.before_MB = megabytes(self.site)

    def install(self, *what: str) -> None:
        """Install with pip, quietly."""
        run = [self.python, "-m", "pip", "install", "-q", "--disable-pip-version-check", *what]
        subprocess.run(run, check=True)

    @property
    def installed_MB(self) -> float:
        """What was installed since."""
        return megabytes(self.site) - self.before_MB

    def largest(self, count: int) -> list[tuple[float, str]]:
        """The largest packages, in MB."""
        folders = [
            p for p in self.site.iterdir() if p.is_dir() and p.name not in ("pip", "setuptools")
        ]
        return sorted(((megabytes(p), p.name) for p in folders), reverse=True)[:count]

    def import_ms(self, what: str) -> list[float]:
        """Processor time of an import, each in a process of its own; sorted."""
        command = [self.python, "-c", _TIMED.format(what)]
        runs = [
            subprocess.run(command, check=True, capture_output=True, text=True)
            for _ in range(IMPORTS + 1)
        ]
        # The first compiles the modules.
        return sorted(float(run.stdout) for run in runs[1:])


def main(extras: list[str]) -> int:
    """Measure, print, and return 1 where a goal is missed."""
    with tempfile.TemporaryDirectory(prefix="smad-footprint-") as place:
        folder = Path(place)
        wheel = build_wheel(folder)
        environment = Environment(folder / "env")
        environment.install(*PROJECT["dependency-groups"]["bench"])
        environment.install("--no-deps", str(wheel))
        base_MB, times_ms = environment.installed_MB, environment.import_ms(CLIENT)
        print(f"wheel                     {wheel.stat().st_size / 1e6:7.1f} MB")
        print(f"of a bench computer       {base_MB:7.1f} MB    goal {GOAL_MB:g}")
        for size_MB, name in environment.largest(5):
            print(f"  {name:<23} {size_MB:7.1f} MB")
        print(
            f"{CLIENT:<26}{median(times_ms):7.1f} ms    goal {GOAL_MS:g}; "
            f"{times_ms[0]:.1f} to {times_ms[-1]:.1f} in {len(times_ms)} processes"
        )
        print(f"  {FLOOR:<24}{median(environment.import_ms(FLOOR)):7.1f} ms    of them")
        for extra in extras:
            environment.install(f"{wheel}[{extra}]")
            print(f"with [{extra}]".ljust(26) + f"{environment.installed_MB:7.1f} MB")
    return 0 if base_MB <= GOAL_MB and median(times_ms) <= GOAL_MS else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
