"""The generated C supervisor as a program, fed the same operations as the Python one.

An operation is a row of 64-bit integers: what, the time, then the fields of the record it takes.
The program answers each with its code and what it decided, and each `FULL_EVERY`-th with every
field of its memory as well.
"""

import shutil
import subprocess
from array import array
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import firmware_protocol
from firmware_protocol.supervisor import Measurements, Memory
from firmware_protocol.supervisor.memory import Command
from firmware_protocol.supervisor.table import LINE_COUNT

FOLDER = Path(firmware_protocol.__file__).parent / "c"
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined", "-O1"]
COMPILER = shutil.which("cc")

SAMPLE = 0
FULL_EVERY = 97
ROW = 32
DECIDED = (
    "state", "faults", "first_fault", "first_channel", "first_value", "first_limit", "warnings",
    "gate", "value", "limit",
)  # fmt: skip
PAIRS = ("applied_mA", "ceiling_mA", "duty", "limiter")

_MAIN = """\
#include "smad_supervisor.h"
#include <stdio.h>

int main(void)
{
    static struct smad_sv_memory s;
    struct smad_sv_measurements m;
    struct smad_sv_command c;
    /* A copy: on a chip the compiled limits are in flash, where no pointer reaches. */
    static struct smad_sv_limits limits;
    const struct smad_sv_limits *lim = &limits;
    int64_t row[ROW], code, count = 0, n;
    limits = smad_sv_limits_compiled;
    smad_sv_init(&s);
    smad_sv_configure(&s, lim);
    while (fread(row, sizeof row, 1, stdin) == 1) {
        int64_t now = row[1];
        int64_t *from = row + 2;
        if (row[0] == 0) {
MEASUREMENTS
        } else {
COMMAND
        }
        switch ((int)row[0]) {
        case 0: smad_sv_sample(&s, &m, lim, now); code = 0; break;
        case 1: code = smad_sv_on_self_test(&s, lim, &c); break;
        case 2: code = smad_sv_on_arm_request(&s, &m, lim, &c, now); break;
        case 3: code = smad_sv_on_arm_confirm(&s, &m, lim, &c, now); break;
        case 4: code = smad_sv_on_setpoint(&s, lim, &c, now); break;
        case 5: code = smad_sv_on_disarm(&s, lim); break;
        case 6: code = smad_sv_on_estop(&s, lim); break;
        case 7: code = smad_sv_on_clear_fault(&s, lim, &c); break;
        case 8: code = smad_sv_on_restart(&s, &c); break;
        default: return 3;
        }
        fwrite(&code, sizeof code, 1, stdout);
FIELDS
        if (++count % FULL_EVERY == 0) {
MEMORY
        }
    }
    return 0;
}
"""


def write_main(folder: Path) -> Path:
    """Write the program around the generated C; return its path."""
    memory = Memory(LINE_COUNT)
    text = _MAIN
    for word, lines in (
        ("FIELDS", [_write(memory, name) for name in (*DECIDED, *PAIRS)]),
        ("MEMORY", [_write(memory, field.name) for field in fields(memory)]),
        ("MEASUREMENTS", [_read(Measurements(), "m", f.name) for f in fields(Measurements)]),
        ("COMMAND", [_read(Command(), "c", f.name) for f in fields(Command)]),
    ):
        text = text.replace(f"{word}\n", "\n".join(lines) + "\n")
    text = text.replace("[ROW]", f"[{ROW}]").replace("FULL_EVERY", str(FULL_EVERY))
    main = folder / "main.c"
    main.write_text(text)
    return main


def build(folder: Path) -> Path:
    """Compile the generated C with a program around it; return the program."""
    main = write_main(folder)
    program = folder / "supervisor"
    command = [str(COMPILER), *FLAGS, f"-I{FOLDER}", str(main), str(FOLDER / "smad_supervisor.c")]
    subprocess.run([*command, "-o", str(program)], check=True, capture_output=True, text=True)
    return program


def _elements(record: object, owner: str, name: str) -> list[str]:
    value = getattr(record, name)
    count = len(value) if isinstance(value, list) else 0
    return [f"{owner}.{name}[{n}]" for n in range(count)] or [f"{owner}.{name}"]


def _write(record: object, name: str) -> str:
    """Fields have types of their own; the answer is 64 bits of each."""
    elements = _elements(record, "s", name)
    return "\n".join(f"n = {element}; fwrite(&n, sizeof n, 1, stdout);" for element in elements)


def _read(record: object, owner: str, name: str) -> str:
    return "\n".join(f"{element} = *from++;" for element in _elements(record, owner, name))


def run(program: Path, rows: "array[int]") -> "array[int]":
    """Return all answers, one after the other."""
    done = subprocess.run([str(program)], input=rows.tobytes(), capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    answers = array("q")
    answers.frombytes(done.stdout)
    return answers


def row(what: int, now_us: int, record: Measurements | Command) -> list[int]:
    """Return one operation as the program reads it."""
    cells = [what, now_us, *flat(record)]
    return cells + [0] * (ROW - len(cells))


def answer(code: int, s: Memory, count: int) -> list[int]:
    """Return what the Python supervisor would answer to operation number `count` (from 1)."""
    numbers = [code, *(int(getattr(s, name)) for name in DECIDED)]
    for name in PAIRS:
        numbers += getattr(s, name)
    return numbers + (flat(s) if count % FULL_EVERY == 0 else [])


def flat(record: Measurements | Command | Memory) -> list[int]:
    """Return all numbers of a record in field order."""
    numbers: list[int] = []
    for name in record.__slots__:
        value = getattr(record, name)
        if isinstance(value, list):
            numbers += value
        else:
            numbers.append(int(value))
    return numbers


def names_at(offset: int, answers: Sequence[Sequence[int]]) -> str:
    """Return which field of which operation the number at `offset` of all answers is."""
    for number, numbers in enumerate(answers, 1):
        if offset < len(numbers):
            pairs = [f"{name}[{k}]" for name in PAIRS for k in (0, 1)]
            head = ["code", *DECIDED, *pairs]
            memory = Memory(LINE_COUNT)
            for field in fields(memory):
                value = getattr(memory, field.name)
                head += [field.name] * (len(value) if isinstance(value, list) else 1)
            return f"{head[offset]} after operation {number}"
        offset -= len(numbers)
    return "beyond the end"
