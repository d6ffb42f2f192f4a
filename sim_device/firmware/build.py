"""`python -m sim_device.firmware.build [PORT ...]`: compiles the ports of the firmware.

What is newer than its sources is left as it is. The results are in build/firmware of the
checkout; a wheel has no firmware in it.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sim_device.errors import BenchError

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ROOT / "firmware"
PROTOCOL = ROOT / "firmware_protocol" / "c"
OUTPUT = ROOT / "build" / "firmware"
AVR_PACKAGES = "gcc-avr binutils-avr avr-libc libsimavr-dev libelf-dev"
WARNINGS = ("-Wall", "-Wextra", "-Werror")


class BuildError(BenchError):
    """A port cannot be compiled."""


@dataclass(frozen=True)
class Step:
    """One call of a compiler."""

    compiler: str
    packages: str
    flags: tuple[str, ...]
    folders: tuple[Path, ...]
    output: str
    libraries: tuple[str, ...] = ()


_CORE = (SOURCES / "core", PROTOCOL)
_HOST = Step(
    "gcc",
    "gcc libc6-dev",
    ("-std=gnu99", "-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
    (*_CORE, SOURCES / "host"),
    "smad-firmware-host",
)
PORTS: dict[str, tuple[Step, ...]] = {"host": (_HOST,)}
"""What each port is made of, in order."""


def missing(port: str) -> str:
    """Return the packages to install before `port` can be built, empty if none is missing."""
    wanted = [step.packages for step in PORTS[port] if shutil.which(step.compiler) is None]
    return " ".join(wanted)


def build(port: str) -> tuple[str, ...]:
    """Compile a port if need be; return the command line that runs it behind the link.

    Raises BuildError with the compiler's words, or with what to install.
    """
    if port not in PORTS:
        raise BuildError(f"there is no port {port!r}; there are {', '.join(PORTS)}")
    if not SOURCES.is_dir():
        raise BuildError(f"{SOURCES} is not there; the firmware is built in a checkout of smad")
    if missing(port):
        raise BuildError(f"no compiler for {port}: apt-get install {missing(port)}")
    OUTPUT.mkdir(parents=True, exist_ok=True)
    for step in PORTS[port]:
        _run(step)
    return (str(OUTPUT / PORTS[port][-1].output),)


def _run(step: Step) -> None:
    sources = [path for folder in step.folders for path in sorted(folder.glob("*.c"))]
    headers = [path for folder in (*step.folders, SOURCES / "sim") for path in folder.glob("*.h")]
    output = OUTPUT / step.output
    newest = max(path.stat().st_mtime for path in (*sources, *headers, Path(__file__)))
    if output.exists() and output.stat().st_mtime >= newest:
        return
    includes = [f"-I{folder}" for folder in (*step.folders, SOURCES / "sim")]
    # Beside, then in one step: another process may be running the old one.
    beside = output.with_suffix(".new")
    command = [step.compiler, *step.flags, *WARNINGS, *includes, *map(str, sources)]
    done = subprocess.run(
        [*command, "-o", str(beside), *step.libraries], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise BuildError(f"{step.compiler} refuses {step.output}:\n{done.stderr.strip()}")
    beside.replace(output)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compile the ports named, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("ports", nargs="*", metavar="PORT", help=", ".join(PORTS))
    try:
        for port in parser.parse_args(arguments).ports or PORTS:
            print(f"{port}: {' '.join(build(port))}")
    except BuildError as error:
        print(f"firmware: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
