"""The kernel as a library of C, which loads at once: with it a plant needs no numba.

python -m smad.fmi.library     compile it beside its source, where a C compiler is
"""

import inspect
import re
from pathlib import Path

from firmware_protocol.shared_library import compile_library
from sim_device.plant import kernel as k
from sim_device.plant.kernel.compiled import PACKAGE
from sim_device.plant.kernel.library import FILE, PREFIX
from smad.fmi.to_c import Program

RECORDS = {"states": k.State, "works": k.Work, "models": k.Model, "mounts": k.Mounting}
"""Layout of the parameters of the kernel's entries that are arrays of one record."""
ENTRIES = (
    k.advance,
    k.advance_many,
    k.compliance_of,
    k.film_conductance_of,
    k.lag_samples,
    k.lay_curves,
    k.outer_curve,
    k.replay,
    k.replay_drivers,
    k.rest,
)
"""Everything of the kernel that Python calls."""
FLAGS = ("-O2", "-ffp-contract=off")
"""No operation is fused, so that it computes what numba's code does."""


def library_source() -> str:
    """The C of `ENTRIES`, each under its name with PREFIX."""
    program = Program(RECORDS)
    lines = [program.text(ENTRIES)]
    for function in ENTRIES:
        plain = program.call(function)
        name = plain.__name__
        head = program.heads[name].removeprefix("static ").removesuffix(";")
        # An array goes as address and shape: structures by value are not safe in every ctypes.
        head = re.sub(r"Table (\w+)", r"double *\1, long \1_rows, long \1_columns", head)
        tables = set(re.findall(r"long (\w+)_rows", head))
        arguments = ", ".join(
            f"(Table){{{n}, {n}_rows, {n}_columns}}" if n in tables else n
            for n in inspect.signature(plain).parameters
        )
        returns = "" if head.startswith("void ") else "return "
        lines.append(head.replace(f" k_{name}(", f" {PREFIX}{name}(") + " {")
        lines.append(f"    {returns}k_{name}({arguments});\n}}")
    return "\n".join(lines) + "\n"


def build_library(target: Path, flags: tuple[str, ...] = FLAGS) -> bool:
    """Compile the library to `target`; see `firmware_protocol.shared_library.compile_library`."""
    return compile_library(target, {"kernel.c": library_source()}, k.text_digest(), flags)


if __name__ == "__main__":
    if not build_library(PACKAGE / FILE):
        print("no C compiler here: numba compiles the kernel when it is first called")
