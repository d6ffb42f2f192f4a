"""Compiled code that is kept follows the text of the whole kernel."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sim_device.plant.kernel import compiled

ROOT = Path(compiled.__file__).parents[3]
# A small function of one module that calls one of another.
CALL = """
from sim_device.plant.kernel.compiled import FOLDER
from sim_device.plant.kernel.probes import outer_curve
import numpy as np
out = np.zeros(2)
outer_curve(np.ones(800), 0.5, out)
print(out[0], sum(outer_curve.stats.cache_hits.values()), FOLDER)
"""


WITHOUT_NUMBA = """
import sys
sys.modules["numba"] = None
from sim_device.plant import Plant, load_parameters
Plant(load_parameters("A"))
"""


def python_in(folder: Path, code: str, **more: str) -> subprocess.CompletedProcess[str]:
    """Run code on a copy of the package."""
    environment = {**os.environ, "PYTHONPATH": str(folder), **more}
    environment.pop("NUMBA_CACHE_DIR", None)
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def called(folder: Path) -> tuple[float, bool, Path]:
    """Result of the call in a copy of the package, whether it was kept, and where."""
    done = python_in(folder, CALL, SMAD_KERNEL="numba")
    assert done.returncode == 0, done.stderr
    value, hits, home = done.stdout.split()
    return float(value), hits == "1", Path(home)


@pytest.fixture
def copy(tmp_path):
    shutil.copytree(
        ROOT / "sim_device", tmp_path / "sim_device", ignore=shutil.ignore_patterns("__pycache__")
    )
    return tmp_path


def edited(copy: Path) -> None:
    """The callee of the call, in another module than its caller, gives one more."""
    module = copy / "sim_device/plant/kernel/curves.py"
    text = module.read_text(encoding="utf-8")
    changed = re.sub(r"return left, slope\n$", "return left + 1.0, slope\n", text)
    assert changed != text
    module.write_text(changed, encoding="utf-8")


def test_an_edit_of_a_callee_changes_what_its_kept_caller_gives(copy):
    first, kept, home = called(copy)
    assert not kept
    assert called(copy) == (first, True, home)
    edited(copy)
    second, kept, other = called(copy)
    assert second == first + 1.0
    assert not kept
    assert other.parent == home.parent
    assert other != home


def test_an_edited_kernel_is_not_run_from_the_library_of_its_former_text(copy):
    """Numba would compile it; where that is missing, the plant says so."""
    assert python_in(copy, WITHOUT_NUMBA).returncode == 0
    edited(copy)
    done = python_in(copy, WITHOUT_NUMBA)
    assert done.returncode == 1
    assert "ModuleNotFoundError: numba is not installed" in done.stderr


def test_the_name_of_the_folder_follows_every_module(tmp_path):
    for module in sorted(compiled.PACKAGE.glob("*.py")):
        package = tmp_path / module.stem
        shutil.copytree(compiled.PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
        assert compiled.text_digest(package) == compiled.text_digest()
        with (package / module.name).open("a", encoding="utf-8") as file:
            file.write("# edited\n")
        assert compiled.text_digest(package) != compiled.text_digest()


def test_folders_of_earlier_texts_are_removed_but_for_the_latest(tmp_path):
    for age in range(6):
        folder = tmp_path / f"kernel-{age}"
        folder.mkdir()
        os.utime(folder, (1000 - age, 1000 - age))
    own = compiled.cache_folder([tmp_path])
    assert own is not None
    left = sorted(known.name for known in tmp_path.iterdir())
    assert left == sorted(["kernel-0", "kernel-1", own.name])
    assert len(left) == compiled.KEPT


def blocked(folder: Path) -> Path:
    """A place where no folder can be made, for root neither: below a file."""
    file = folder / "file"
    file.write_text("")
    return file / "home"


def test_a_place_that_cannot_be_written_is_passed_over(tmp_path):
    home = tmp_path / "home"
    found = compiled.cache_folder([blocked(tmp_path), home])
    assert found is not None
    assert found.parent == home


def test_where_nothing_can_be_written_nothing_is_kept(tmp_path):
    assert compiled.cache_folder([blocked(tmp_path)]) is None


def test_what_came_with_a_read_only_installation_is_taken_along(tmp_path, monkeypatch):
    shipped, home = tmp_path / "shipped", tmp_path / "home"
    own = shipped / f"kernel-{compiled.text_digest()}"
    own.mkdir(parents=True)
    (own / "function.nbi").write_text("compiled")
    writable = compiled._writable
    monkeypatch.setattr(compiled, "_writable", lambda place: place != shipped and writable(place))
    found = compiled.cache_folder([shipped, home])
    assert found == home / own.name
    assert (found / "function.nbi").read_text() == "compiled"
