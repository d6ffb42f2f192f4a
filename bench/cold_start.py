"""How long `smad demo` takes from a wheel on a machine that has nothing of it yet.

In folders outside the checkout, with empty caches, on every Python that smad supports and is here:
pipx with the newest, uvx with the others. Which are not here is said. The time includes the
downloads. Time of the processor is shown beside it, because on a busy machine only that tells one
version from another.

python -m bench.cold_start [WHEEL]     the wheel is built when none is named
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
GOAL_S = 60.0
LIMIT_S = 600.0
_VERSION = "import sys; print(*sys.version_info[:2])"


def build_wheel(folder: Path) -> Path:
    """Build the wheel of this checkout in `folder`; return its path."""
    build = [sys.executable, "-m", "uv", "build", "--quiet", "--wheel", "--no-build-isolation"]
    subprocess.run([*build, "--python", sys.executable, "-o", str(folder), str(ROOT)], check=True)
    (wheel,) = folder.glob("smad-*.whl")
    return wheel


def supported() -> list[int]:
    """Return the minor versions of Python 3 that smad supports."""
    lines = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["classifiers"]
    return sorted(int(line.rpartition(".")[2]) for line in lines if "Python :: 3." in line)


def pythons() -> dict[tuple[int, int], str]:
    """Return the interpreters here that smad supports, by version: on PATH, and pyenv's."""
    by_version: dict[tuple[int, int], str] = {}
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for minor in supported():
        name = f"python3.{minor}"
        places = [*sorted(pyenv.glob(f"3.{minor}.*/bin/{name}")), shutil.which(name)]
        for place in filter(None, places):
            done = subprocess.run(
                [str(place), "-c", _VERSION], capture_output=True, text=True, check=False
            )
            if done.stdout.split() == ["3", str(minor)]:
                by_version[3, minor] = str(place)
                break
    return by_version


def processor_s() -> float:
    """Processor time of all children that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def try_cold(tool: str, python: str, wheel: Path) -> tuple[float, str]:
    """Run the demo with empty caches; return the seconds and what it printed.

    Raises RuntimeError when the demo fails.
    """
    with tempfile.TemporaryDirectory(prefix="smad-cold-") as name:
        folder = Path(name)
        caches = ("UV_CACHE_DIR", "PIP_CACHE_DIR", "PIPX_HOME", "XDG_CACHE_HOME")
        env = {**os.environ, **{cache: str(folder / cache.lower()) for cache in caches}}
        env |= {"HOME": name, "UV_PYTHON_DOWNLOADS": "never", "SMAD_RUNTIME_DIR": str(folder / "r")}
        for known in ("VIRTUAL_ENV", "PYTHONPATH"):
            env.pop(known, None)
        command = {
            "uvx": ["uv", "tool", "run", "--python", python, "--from", str(wheel), "smad", "demo"],
            "pipx": ["pipx", "run", "--python", python, "--spec", str(wheel), "smad", "demo"],
        }[tool]
        work = folder / "work"
        work.mkdir()
        begun_s = time.monotonic()
        done = subprocess.run(
            [sys.executable, "-m", *command],
            cwd=work,
            env=env,
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
        taken_s = time.monotonic() - begun_s
        if done.returncode or not list(work.glob("runs/*-demo.html")):
            raise RuntimeError(f"{' '.join(command)}: {done.stdout}\n{done.stderr}")
    return taken_s, done.stdout


def main(arguments: list[str]) -> int:
    """Measure and print. The goal is for an idle machine; only a demo that fails is an error."""
    with tempfile.TemporaryDirectory(prefix="smad-wheel-") as folder:
        wheel = Path(arguments[0]).resolve() if arguments else build_wheel(Path(folder))
        print(f"{wheel.name}, {wheel.stat().st_size / 1e6:.1f} MB")
        known = pythons()
        for version in sorted(known):
            tool = "pipx" if version == max(known) else "uvx"
            used_s = processor_s()
            taken_s, said = try_cold(tool, known[version], wheel)
            used_s = processor_s() - used_s
            (tracking,) = (line for line in said.splitlines() if "tracking" in line)
            print(
                f"{tool:5} Python {version[0]}.{version[1]:<4}{taken_s:6.1f} s, "
                f"{used_s:.1f} s of the processor   {tracking}"
            )
        missing = [f"3.{minor}" for minor in supported() if (3, minor) not in known]
        print(f"goal {GOAL_S:g} s; not here, so not tried: {', '.join(missing) or 'none'}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
