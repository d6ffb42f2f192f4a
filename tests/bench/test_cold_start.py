"""Starting from a wheel: which Pythons are tried, and that what is locked is what is asked for."""

import re
import tomllib
from pathlib import Path

import pytest

from bench import cold_start

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def base_name(requirement: str) -> str:
    return re.split(r"[\[<>=;! ]", requirement)[0].lower().replace("_", "-")


def test_only_supported_pythons_are_tried_and_this_one_is_among_them() -> None:
    found = cold_start.pythons()
    assert {minor for _, minor in found} <= set(cold_start.supported())
    assert cold_start.supported()[0] == 11
    assert all(Path(python).exists() for python in found.values())


def test_a_demo_that_fails_is_an_error_with_what_it_said(tmp_path: Path) -> None:
    wheel = tmp_path / "smad-0.0-py3-none-any.whl"
    wheel.write_bytes(b"no wheel")
    known = cold_start.pythons()
    with pytest.raises(RuntimeError, match="smad demo"):
        cold_start.try_cold("uvx", known[min(known)], wheel)


def test_the_lock_file_has_what_the_project_asks_for() -> None:
    locked = tomllib.loads((ROOT / "uv.lock").read_text())["package"]
    (own,) = (package for package in locked if package["name"] == "smad")
    told = {entry["name"] for entry in own["metadata"]["requires-dist"]}
    extras = PROJECT["project"]["optional-dependencies"].values()
    asked = {base_name(line) for line in PROJECT["project"]["dependencies"]}
    asked |= {base_name(line) for lines in extras for line in lines}
    assert told == asked, "run make lock"


def test_the_bench_computer_s_packages_are_part_of_what_the_demo_needs() -> None:
    bench = set(PROJECT["dependency-groups"]["bench"])
    assert bench < set(PROJECT["project"]["dependencies"])
