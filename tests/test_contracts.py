"""The contracts of the house: who may import whom, and what a wheel must carry."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FLOORS = {"firmware_protocol": 0, "sim_device": 1, "smad": 2, "firmware": 2}

# Folder -> what its modules must not import, beyond the order of the floors.
FORBIDDEN = {
    "firmware_protocol": {"numpy", "scipy", "serial", "zmq", "socket", "asyncio", "time", "click"},
    "smad/control": {
        "serial",
        "zmq",
        "socket",
        "asyncio",
        "pathlib",
        "time",
        "smad.daemon",
        "smad.runlog",
    },
    "smad/gap": {"serial", "zmq", "socket", "asyncio", "smad.daemon", "smad.client"},
    "smad/daemon": {"sim_device"},
    "firmware": {"smad"},
    "smad": {"firmware"},
    "tests/withheld/plant": {"smad", "sim_device", "firmware_protocol"},
}
# Tools of a package that are run by hand; they may read a clock or a file.
EXEMPT_NAMES = {"bench.py", "generate.py", "__main__.py"}


def imports_of(path: Path) -> set[str]:
    found: set[str] = set()
    package = list(path.relative_to(ROOT).with_suffix("").parts)
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            found.add(module)
            found.update(f"{module}.{alias.name}" for alias in node.names)
    return found


def modules_under(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


@pytest.mark.parametrize("package", FLOORS)
def test_imports_between_packages_go_down_only(package: str) -> None:
    upward = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules_under(package)
        for name in imports_of(path)
        if FLOORS.get(name.split(".")[0], -1) > FLOORS[package]
    ]
    assert not upward


@pytest.mark.parametrize("folder", FORBIDDEN)
def test_a_pure_room_imports_nothing_it_must_not_know(folder: str) -> None:
    modules = modules_under(folder)
    assert modules, f"{folder} holds no modules: the contract names a room that is gone"
    broken = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules
        if path.name not in EXEMPT_NAMES and "generate" not in path.parts
        for name in imports_of(path)
        if any(name == bad or name.startswith(bad + ".") for bad in FORBIDDEN[folder])
    ]
    assert not broken


def test_no_committed_file_names_a_path_of_a_developers_machine() -> None:
    tracked = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.splitlines()
    needle = "/wo" + "rk/"
    assert [
        name
        for name in tracked
        if (ROOT / name).is_file() and needle in (ROOT / name).read_text(errors="ignore")
    ] == []


def test_every_data_file_of_the_packages_is_in_the_wheel(tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation",
         "--disable-pip-version-check", "-w", str(tmp_path), str(ROOT)],
        check=True,
    )  # fmt: skip
    import zipfile

    wheel = next(tmp_path.glob("*.whl"))
    inside = set(zipfile.ZipFile(wheel).namelist())
    packages = tomllib.loads((ROOT / "pyproject.toml").read_text())
    wanted = {
        str(path.relative_to(ROOT))
        for package in packages["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert wanted <= inside


def test_every_room_that_the_architecture_page_names_is_there() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text()
    rows = re.findall(r"^\| (`[^|]*) \|", page, flags=re.MULTILINE)
    named = [name for row in rows for name in re.findall(r"`([\w./*-]+)`", row) if "/" in name]
    assert len(named) > 15
    assert [name for name in named if not any(ROOT.glob(name.rstrip("/")))] == []
