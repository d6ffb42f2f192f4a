"""A recipe of docs/architecture.md as edits of a copy of the tree, and what must pass then."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COPIED = (
    "bench", "campaign", "docs", "evaluation", "examples", "firmware", "firmware_protocol", "paper",
    "sim_device", "smad", "tests", "tools",
)  # fmt: skip
FILES = (
    "CHANGELOG.md",
    "CITATION.cff",
    "CONTRIBUTING.md",
    "Makefile",
    "README.md",
    "pyproject.toml",
)
KERNEL = "sim_device/plant/kernel/"
_HEAT = "--deselect=tests/firmware_protocol/supervisor/test_checks.py::test_"
LONGEST = (
    f"{_HEAT}i2t_lowers_the_ceiling_and_trips_only_a_driver_that_does_not_obey",
    f"{_HEAT}the_current_folds_back_before_the_temperature_trips",
    f"{_HEAT}a_spring_in_balance_may_be_held_for_minutes",
)
"""No recipe changes what they ask."""


@dataclass(frozen=True)
class Insert:
    """Put `text` in front of `before` in a file; with `before` empty, make the file."""

    name: str
    path: str
    text: str
    before: str = ""

    def carry_out(self, tree: Path) -> None:
        """Edit the copy. Raises AssertionError when the place is gone from the file."""
        file = tree / self.path
        if not self.before:
            assert not file.exists(), f"{self.path} is there already"
            file.write_text(self.text)
            return
        old = file.read_text()
        assert old.count(self.before) == 1, f"{self.path} has not exactly one {self.before!r}"
        file.write_text(old.replace(self.before, self.text + self.before))


@dataclass(frozen=True)
class Generate:
    """A program that makes files from others, by default `make generate`."""

    name: str = "make generate"
    program: tuple[str, ...] = ("tools/generate.py",)

    def carry_out(self, tree: Path) -> None:
        """Write the made files of the copy anew; a step left out may keep it from that."""
        run(tree, *self.program)


Step = Insert | Generate


@dataclass(frozen=True)
class Recipe:
    """The steps, the tests that show that all of them were done, and a program that uses it."""

    name: str
    steps: tuple[Step, ...]
    tests: tuple[str, ...]
    shows: tuple[str, ...] = ()

    def complaints(self, tree: Path, left_out: Step | None, *, types: bool = True) -> str:
        """Carry out the recipe without one step; return what complains, or nothing.

        types: whether mypy is asked about a recipe that is whole.
        """
        for step in self.steps:
            if step is not left_out:
                step.carry_out(tree)
        if any(isinstance(s, Insert) and KERNEL in s.path for s in self.steps):
            run(tree, "-m", "smad.fmi.library")
        checks = [("tools/generate.py", "--check"), ("-m", "ruff", "check", "-q", ".")]
        checks += [("-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *self.tests)]
        if left_out is None:
            checks.insert(2, ("-m", "ruff", "format", "-q", "--check", "."))
            if types:
                checks.append(("-m", "mypy"))
            if self.shows:
                checks.append(("-m", *self.shows))
        for check in checks:
            done = run(tree, *check)
            if done.returncode:
                return f"{' '.join(check)}:\n{done.stdout}{done.stderr}"
        return ""


def together(recipes: Sequence[Recipe]) -> Recipe:
    """Return the recipes as one: every edit, each program once, every test but the longest."""
    steps = [step for recipe in recipes for step in recipe.steps]
    edits = [step for step in steps if isinstance(step, Insert)]
    programs = dict.fromkeys(step for step in steps if isinstance(step, Generate))
    tests = dict.fromkeys(test for recipe in recipes for test in recipe.tests)
    return Recipe("all", (*edits, *programs), (*tests, *LONGEST))


def copy_of_the_tree(folder: Path, *, whole: bool) -> Path:
    """Return a copy of the sources, with what was compiled of the physics.

    `whole`: with what mypy found out, too.
    """
    for name in COPIED:
        ignored = shutil.ignore_patterns("*.mcap", ".*")
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    for name in FILES:
        shutil.copy2(ROOT / name, folder / name)
    if whole and (ROOT / ".mypy_cache").is_dir():
        shutil.copytree(ROOT / ".mypy_cache", folder / ".mypy_cache")
    return folder


def run(tree: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a copy, on the copy's packages."""
    return subprocess.run(
        [sys.executable, *words],
        cwd=tree,
        env={
            **os.environ,
            "PYTHONPATH": str(tree),
            "OPENBLAS_NUM_THREADS": "1",
        },
        capture_output=True,
        text=True,
        check=False,
    )
