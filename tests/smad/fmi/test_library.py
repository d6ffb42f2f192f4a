"""The kernel as a library of C: it has every entry, and stands for the present text only."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sim_device.plant import kernel
from sim_device.plant.kernel.library import FILE, Library
from smad.fmi.library import ENTRIES, build_library

WITHOUT_NUMBA = """
import sys
sys.modules["numba"] = None
from sim_device.plant import Plant, load_parameters
Plant(load_parameters('A'))
"""


def test_the_library_has_every_function_that_the_kernel_exports() -> None:
    functions = [f for name in kernel.__all__ if hasattr(f := getattr(kernel, name), "py_func")]
    assert {f.__name__ for f in functions} == {entry.__name__ for entry in ENTRIES}
    library = Library(kernel.PACKAGE / FILE, kernel.text_digest())
    for function in functions:
        library.entry(function.py_func)


def test_a_library_of_another_text_of_the_kernel_is_refused(tmp_path: Path) -> None:
    assert build_library(tmp_path / FILE, ("-std=c11", "-O0", "-shared", "-fPIC"))
    Library(tmp_path / FILE, kernel.text_digest())
    with pytest.raises(OSError, match="another text"):
        Library(tmp_path / FILE, "0123456789abcdef")


def test_an_edited_kernel_is_not_run_from_the_library_of_its_former_text(tmp_path: Path) -> None:
    """Numba would compile it; where that is missing, the plant says so."""
    root = kernel.PACKAGE.parents[2]
    for package in ("sim_device", "firmware_protocol"):
        shutil.copytree(
            root / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    run = [
        sys.executable,
        "-c",
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{WITHOUT_NUMBA}",
    ]
    assert subprocess.run(run, check=False, cwd=tmp_path).returncode == 0
    with (tmp_path / "sim_device/plant/kernel/film.py").open("a") as module:
        module.write("# edited\n")
    done = subprocess.run(run, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 1
    assert "ModuleNotFoundError: numba is not installed" in done.stderr
