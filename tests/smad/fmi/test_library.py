"""The kernel as a library of C: a plant computes on it what it does on numba."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sim_device.plant import Plant, kernel, load_parameters
from sim_device.plant.kernel.library import Library, from_library
from sim_device.plant.records import Drive
from smad.fmi.library import FLAGS, build_library

WITHOUT_NUMBA = """
import sys
sys.modules["numba"] = None
from sim_device.plant import Plant, load_parameters
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("library") / "kernel.so"
    assert build_library(path, tuple(flag for flag in FLAGS if flag != "-O2"))
    return path


def heated() -> tuple[np.ndarray, float]:
    plant = Plant(load_parameters("A"), effects={"unified_kinetics": {}})
    for drive in (Drive((3.0, 0.0)), Drive((0.0, 2.0), (0.9, 0.0))):
        for _ in range(150):
            plant.advance(drive, 0.02)
    return plant.numbers.copy(), plant.energy.closing


def test_a_plant_on_the_library_is_the_one_on_numba(
    built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    numbers, closing = heated()
    library = Library(built, kernel.text_digest())
    for name in ("rest", "advance", "lay_curves", "compliance_of"):
        function = getattr(kernel, name)
        monkeypatch.setattr(kernel, name, library.entry(getattr(function, "py_func", function)))
    other, other_closing = heated()
    np.testing.assert_allclose(other, numbers, rtol=1e-9, atol=1e-12)
    assert other_closing == pytest.approx(closing, abs=1e-9)


def test_a_library_of_another_text_of_the_kernel_is_refused(built: Path) -> None:
    with pytest.raises(OSError, match="another text"):
        Library(built, "0123456789abcdef")


def test_what_the_library_lacks_asks_for_numba(built: Path) -> None:
    library = Library(built, kernel.text_digest())
    replay = from_library(library, getattr(kernel.replay, "py_func", kernel.replay))
    with pytest.raises(ModuleNotFoundError) as refused:
        replay()
    assert refused.value.name == "numba"


def test_without_numba_and_library_a_plant_asks_for_numba() -> None:
    done = subprocess.run(
        [sys.executable, "-c", f"{WITHOUT_NUMBA}Plant(load_parameters('A'))"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "ModuleNotFoundError: numba is not installed" in done.stderr
