"""The kernel's Python as C: what has a translation computes the same, what has none is named."""

import ctypes
import math
import subprocess
from pathlib import Path

import pytest

from sim_device.plant import load_parameters
from sim_device.plant.constants import kernel_constants
from smad.fmi.to_c import Program, Untranslatable
from smad.fmi.traced import trace

OPTIONS = {"variant": "extended", "fixture": "antagonistic", "cooling": "water"}


def collatz(start: float, most: int) -> float:
    n = int(start)
    total = 0.0
    for k in range(most, 0, -1):
        if n % 2:
            n = 3 * n + 1
        else:
            n >>= 1
        low, high = min(n, k), max(total, 0.5 * k)
        total += math.sqrt(low) / k + (high if 0.0 < high < 1e6 else 1 / 3)
        if n == 1 or not math.isfinite(total):
            break
    return total


def keyword(start: float) -> float:
    return collatz(start, most=3)


def listed(start: float) -> float:
    return sum([start, 1.0])


def compiled(program: Program, tmp_path: Path, head: str) -> ctypes.CDLL:
    source = tmp_path / "a.c"
    source.write_text(program.text([collatz]) + head)
    flags = ["-std=c11", "-O2", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run(["cc", *flags, str(source), "-o", str(tmp_path / "a.so"), "-lm"], check=True)
    return ctypes.CDLL(str(tmp_path / "a.so"))


def test_loops_branches_and_whole_numbers_compute_what_python_does(tmp_path: Path) -> None:
    library = compiled(
        Program({}), tmp_path, "double run(double s, long m) { return k_collatz(s, m); }"
    )
    library.run.restype = ctypes.c_double
    library.run.argtypes = [ctypes.c_double, ctypes.c_long]
    for start in (1.0, 7.9, 27.0):
        for most in (1, 5, 40):
            assert library.run(start, most) == collatz(start, most)


@pytest.mark.parametrize("function", [keyword, listed])
def test_a_construct_without_a_translation_is_named(function: object) -> None:
    with pytest.raises(Untranslatable, match=getattr(function, "__name__", "")):
        Program({}).text([function])  # type: ignore[list-item]


def test_constants_are_traced_to_the_numbers_of_the_parameter_set() -> None:
    known = load_parameters("A")
    lines, made, mount = trace(known, **OPTIONS)
    space = {"v": [entry.value for entry in known.entries], **vars(math)}
    for line in lines:
        exec(line.removeprefix("double ").rstrip(";"), space)
    numbers = {n: space[s.name] if hasattr(s, "name") else s for n, s in made.items()}
    assert numbers == pytest.approx(kernel_constants(known, **OPTIONS), rel=1e-14)
    assert mount.keys() >= {"tension", "xi_S", "deflection"}
