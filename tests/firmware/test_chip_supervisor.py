"""The generated supervisor on the emulated chip does the same as the Python, to the last bit."""

import socket
import subprocess
from array import array
from pathlib import Path

import pytest

from firmware_protocol.enums import BoardState
from firmware_protocol.supervisor import Measurements
from sim_device.firmware.build import build
from sim_device.firmware.frontend import encode
from sim_device.firmware.link import MOST_BYTES, exchange
from sim_device.hardware import Hardware
from tests.firmware.conftest import needs
from tests.firmware_protocol.supervisor import c_peer
from tests.firmware_protocol.supervisor.test_c_supervisor import Walk

STEPS = 500
SLICE_US = 10_000
MOST_SLICES = 3000


def compiled(folder: Path) -> Path:
    """Compile the program of the comparison for the chip."""
    main = c_peer.write_main(folder)
    program = folder / "chip.elf"
    names = ["-Dfread=chip_read", "-Dfwrite=chip_write", "-Dmain=chip_main"]
    sources = [main, Path(__file__).parent / "chip_stdio.c", c_peer.FOLDER / "smad_supervisor.c"]
    command = ["avr-gcc", "-mmcu=atmega2560", "-DF_CPU=16000000UL", "-std=gnu99", "-O3", *names]
    subprocess.run(
        [*command, f"-I{c_peer.FOLDER}", *map(str, sources), "-o", str(program)],
        check=True,
        capture_output=True,
        text=True,
    )
    return program


def run(program: Path, rows: "array[int]", folder: Path, answers: int) -> "array[int]":
    """Return all answers of the chip, one after the other."""
    simavr = build("avr")[0]
    end, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    end.settimeout(60.0)
    chip = subprocess.Popen(
        [
            simavr,
            "--elf",
            str(program),
            "--link",
            str(theirs.fileno()),
            "--store",
            str(folder / "store"),
        ],
        pass_fds=[theirs.fileno()],
    )
    theirs.close()
    data, heard = rows.tobytes(), bytearray()
    codes = encode(Measurements(), Hardware())
    try:
        exchange(end, codes, SLICE_US)  # what arrives before the port is switched on is lost
        for _ in range(MOST_SLICES):
            piece, data = data[: MOST_BYTES // 2], data[MOST_BYTES // 2 :]
            heard += exchange(end, codes, SLICE_US, piece).data
            if len(heard) == 8 * answers:
                break
    finally:
        end.close()
        chip.wait(10.0)
    result = array("q")
    result.frombytes(heard[: len(heard) // 8 * 8])
    return result


@pytest.mark.parametrize("seed", [0, 3])
def test_chip_and_python_agree_over_random_sequences(tmp_path: Path, seed: int) -> None:
    needs("avr")
    walk = Walk(seed)
    walk.go(STEPS)
    python = array("q", (number for numbers in walk.answers for number in numbers))
    chip = run(compiled(tmp_path), walk.rows, tmp_path, len(python))
    assert len(chip) == len(python)
    if chip != python:
        at = next(n for n, pair in enumerate(zip(chip, python, strict=True)) if pair[0] != pair[1])
        name = c_peer.names_at(at, walk.answers)
        pytest.fail(f"{name}: the chip has {chip[at]}, Python {python[at]}")
    assert len(walk.states & set(BoardState)) >= 3
