"""`python -m sim_device.firmware.build [PORT ...]`: compiles the ports of the firmware.

What is newer than its sources is left as it is. The results are in build/firmware of the
checkout; a wheel has no firmware in it.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sim_device.errors import BenchError

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ROOT / "firmware"
PROTOCOL = ROOT / "firmware_protocol" / "c"
OUTPUT = ROOT / "build" / "firmware"
WARNINGS = ("-Wall", "-Wextra", "-Werror")


class BuildError(BenchError):
    """A port cannot be compiled."""


@dataclass(frozen=True)
class Step:
    """One call of a compiler. `header` is one of the library's, to see whether it is there."""

    compiler: str
    flags: tuple[str, ...]
    sources: tuple[Path, ...]
    """Folders of which every C file is compiled, or single files."""
    output: str
    libraries: tuple[str, ...] = ()
    header: Path | None = None


@dataclass(frozen=True)
class Port:
    """What a port is made of, what to install for it, and what runs it behind the link."""

    packages: str
    steps: tuple[Step, ...]
    program: tuple[str, ...] = ()
    emulator: str = ""
    """A program of the computer that runs the image, before `program`."""


_CORE = (SOURCES / "core", PROTOCOL)
_CHIP = ("-std=gnu99", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections")
_MEGA = Step(
    "avr-gcc",
    ("-mmcu=atmega2560", "-DF_CPU=16000000UL", "-O3", "-mrelax", *_CHIP),
    (*_CORE, SOURCES / "avr"),
    "smad-mega.elf",
)
_SIMAVR = Step(
    "gcc",
    ("-std=gnu99", "-O2", "-isystem/usr/include/simavr"),
    (SOURCES / "sim",),
    "smad-simavr",
    libraries=("-lsimavr", "-lelf"),
    header=Path("/usr/include/simavr/sim_avr.h"),
)
_HOST = Step(
    "gcc",
    ("-std=gnu99", "-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
    (*_CORE, SOURCES / "host"),
    "smad-firmware-host",
)
_M4 = Step(
    "arm-none-eabi-gcc",
    (
        "-mcpu=cortex-m4",
        "-mthumb",
        "-Os",
        *_CHIP,
        "-ffreestanding",
        "-fno-tree-loop-distribute-patterns",
        "-nostdlib",
        f"-T{SOURCES / 'cortex_m' / 'stm32f446.ld'}",
        f"-I{SOURCES / 'cortex_m' / 'freestanding'}",
    ),
    (*_CORE, SOURCES / "cortex_m"),
    "smad-nucleo.elf",
    libraries=("-lgcc",),
)
_WRAPPED = (
    "main", "hal_analog", "hal_rtd", "hal_bridge", "hal_tacho_us", "hal_gate", "hal_current",
    "hal_drain", "hal_sample_timer", "hal_store_read", "hal_store_write", "hal_mark",
)  # fmt: skip
_QEMU = replace(
    _M4,
    flags=(
        *_M4.flags,
        "-Wl,--defsym=flash_at=0",
        *(f"-Wl,--wrap={name}" for name in _WRAPPED),
        "-DREG(address)=(*(volatile uint32_t *)(0x20100000u + ((address) & 0x3FFFFu)))",
    ),
    sources=(*_M4.sources, SOURCES / "qemu"),
    output="smad-qemu.elf",
)
PORTS: dict[str, Port] = {
    "host": Port("gcc libc6-dev", (_HOST,), ("smad-firmware-host",)),
    "cortex-m": Port("gcc-arm-none-eabi", (_M4,)),
    "qemu": Port(
        "gcc-arm-none-eabi qemu-system-arm", (_QEMU,), ("smad-qemu.elf",), "qemu-system-arm"
    ),
    "mega": Port("gcc-avr binutils-avr avr-libc", (_MEGA,)),
    "avr": Port(
        "gcc libc6-dev gcc-avr binutils-avr avr-libc libsimavr-dev libelf-dev",
        (_MEGA, _SIMAVR),
        ("smad-simavr", "--elf", "smad-mega.elf"),
    ),
}


def missing(port: str) -> str:
    """Return what to install before `port` can be built, as a command; empty if nothing is."""
    emulator = PORTS[port].emulator
    for step in PORTS[port].steps:
        has_header = step.header is None or step.header.exists()
        tools = [step.compiler, *([emulator] if emulator else [])]
        if None in map(shutil.which, tools) or not has_header:
            return f"apt-get install --no-install-recommends {PORTS[port].packages}"
    return ""


REQUIRED_VARIABLE = "SMAD_FIRMWARE_REQUIRED"


def reason_to_skip(port: str) -> str:
    """Return why a test of `port` cannot run here, in one line; empty if it can.

    With SMAD_FIRMWARE_REQUIRED set there is no such reason: the build then fails instead.
    """
    command = missing(port)
    if not command or os.environ.get(REQUIRED_VARIABLE):
        return ""
    return f"the firmware for {port} cannot be compiled here: {command}"


def build(port: str) -> tuple[str, ...]:
    """Compile a port if need be; return the command line that runs it behind the link.

    Raises BuildError with the compiler's words, or with what to install.
    """
    if port not in PORTS:
        raise BuildError(f"there is no port {port!r}; there are {', '.join(PORTS)}")
    if not SOURCES.is_dir():
        raise BuildError(f"{SOURCES} is not there; the firmware is built in a checkout of smad")
    if missing(port):
        raise BuildError(f"the compiler for {port} is missing: {missing(port)}")
    OUTPUT.mkdir(parents=True, exist_ok=True)
    for step in PORTS[port].steps:
        _run(step)
    words = [word if word.startswith("--") else str(OUTPUT / word) for word in PORTS[port].program]
    emulator = PORTS[port].emulator
    return (emulator, *words) if emulator else tuple(words)


def _run(step: Step) -> None:
    folders = [place if place.is_dir() else place.parent for place in step.sources]
    sources = [path for place in step.sources for path in (sorted(place.glob("*.c")) or [place])]
    headers = [path for folder in (*folders, SOURCES / "sim") for path in folder.glob("*.h")]
    output = OUTPUT / step.output
    newest = max(path.stat().st_mtime for path in (*sources, *headers, Path(__file__)))
    if output.exists() and output.stat().st_mtime >= newest:
        return
    includes = [f"-I{folder}" for folder in (*folders, SOURCES / "sim")]
    # Beside, then in one step: another process may be running the old one.
    beside = output.with_name(f"{output.name}.{os.getpid()}")
    command = [step.compiler, *step.flags, *WARNINGS, *includes, *map(str, sources)]
    _call([*command, "-o", str(beside), *step.libraries])
    if step is _MEGA:
        image = output.with_suffix(".hex")
        _call(["avr-objcopy", "-O", "ihex", "-R", ".eeprom", str(beside), str(image)])
    beside.replace(output)


def _call(command: Sequence[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise BuildError(f"{command[0]} failed:\n{done.stderr.strip()}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Compile the ports named, or all whose compiler is here."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("ports", nargs="*", metavar="PORT", help=", ".join(PORTS))
    chosen = parser.parse_args(arguments).ports
    try:
        for port in chosen or PORTS:
            if not chosen and reason_to_skip(port):
                print(f"{port}: left out, {missing(port)}")
                continue
            build(port)
            outputs = ", ".join(str(OUTPUT / step.output) for step in PORTS[port].steps)
            print(f"{port}: {outputs}")
    except BuildError as error:
        print(f"firmware: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
