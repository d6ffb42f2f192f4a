"""The kernel as a library of C that a wheel brings, so that a plant runs without numba.

python -m smad.fmi.library FILE     write it, where a C compiler is
"""

from __future__ import annotations

import inspect
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from sim_device.plant import kernel as k
from sim_device.plant.kernel.library import PREFIX
from smad.fmi.to_c import Program

RECORDS = {"states": k.State, "works": k.Work, "models": k.Model, "mounts": k.Mounting}
"""Layout of the parameters of the kernel's entries that are arrays of one record."""
ENTRIES = (k.rest, k.advance, k.lay_curves, k.film_conductance_of, k.compliance_of)
"""What a plant calls."""
# No operation is fused, so that it computes what numba's code does.
FLAGS = ("-std=c11", "-O2", "-ffp-contract=off", "-shared", "-fPIC")


def library_source() -> str:
    """The C of `ENTRIES`, each under its name with PREFIX, and the digest of the kernel's text."""
    program = Program(RECORDS)
    lines = [program.text(ENTRIES), f'const char *const {PREFIX}text = "{k.text_digest()}";']
    for function in ENTRIES:
        plain = program.call(function)
        name = plain.__name__
        head = program.heads[name].removeprefix("static ").removesuffix(";")
        # An array goes as address and shape: structures by value are not safe in every ctypes.
        head = re.sub(r"Table (\w+)", r"double *\1, long \1_rows, long \1_columns", head)
        tables = set(re.findall(r"long (\w+)_rows", head))
        given = ", ".join(
            f"(Table){{{n}, {n}_rows, {n}_columns}}" if n in tables else n
            for n in inspect.signature(plain).parameters
        )
        returns = "" if head.startswith("void ") else "return "
        lines.append(head.replace(f" k_{name}(", f" {PREFIX}{name}(") + " {")
        lines.append(f"    {returns}k_{name}({given});\n}}")
    return "\n".join(lines) + "\n"


def build_library(target: Path, flags: tuple[str, ...] = FLAGS) -> bool:
    """Compile the library to `target`; return whether a C compiler is here (`cc`, or what CC says).

    Raises subprocess.CalledProcessError for a compiler that fails.
    """
    compiler = shutil.which(os.environ.get("CC", "cc"))
    if compiler is None:
        return False
    with tempfile.TemporaryDirectory(prefix="smad-kernel-") as folder:
        source = Path(folder) / "kernel.c"
        source.write_text(library_source())
        subprocess.run([compiler, *flags, str(source), "-o", str(target), "-lm"], check=True)
    return True


if __name__ == "__main__":
    sys.exit(0 if build_library(Path(sys.argv[1])) else "no C compiler")
