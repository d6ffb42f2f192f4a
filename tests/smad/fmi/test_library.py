"""The kernel as a library of C: it has every function of the kernel, and knows its text."""

from pathlib import Path

import pytest

from sim_device.plant import kernel
from sim_device.plant.kernel import compiled, layout
from sim_device.plant.kernel.library import FILE, Library
from smad.fmi.library import ENTRIES, build_library


def test_the_library_has_every_function_that_the_kernel_exports() -> None:
    plain = {compiled.__name__, layout.__name__}
    exported = [getattr(kernel, name) for name in kernel.__all__]
    functions = [f for f in exported if callable(f) and not isinstance(f, type)]
    functions = [f for f in functions if f.__module__ not in plain]
    assert {f.__name__ for f in functions} == {entry.__name__ for entry in ENTRIES}
    # Inner functions are compiled without that: Python that called one of numba's would crash.
    assert all(hasattr(f, "py_func") for f in functions)
    library = Library(compiled.PACKAGE / FILE, kernel.text_digest())
    for function in functions:
        library.entry(function.py_func)


def test_a_library_of_another_text_of_the_kernel_is_refused(tmp_path: Path) -> None:
    assert build_library(tmp_path / FILE, ("-O0",))
    Library(tmp_path / FILE, kernel.text_digest())
    with pytest.raises(OSError, match="another text"):
        Library(tmp_path / FILE, "0123456789abcdef")
