"""What works without any extra, and what is said where one is missing."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from smad.extras import BROUGHT_BY, EXTRA_OF, EXTRA_OF_COMMAND
from tests.smad.runlog.helpers import write_small_run

PROJECT = tomllib.loads((Path(__file__).resolve().parents[2] / "pyproject.toml").read_text())
SMALL = """
import sys
sys.modules.update(dict.fromkeys({absent!r}))
from smad.cli import execute
sys.exit(max(execute(arguments) for arguments in {commands!r}))
"""


def without_extras(*commands: list[str]) -> subprocess.CompletedProcess[str]:
    """Run commands where no package of an extra can be imported."""
    script = SMALL.format(absent=sorted(EXTRA_OF), commands=commands)
    return subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )


def package(requirement: str) -> str:
    return requirement.partition(">")[0].partition("=")[0].strip()


def test_each_package_of_an_extra_is_known_and_no_other() -> None:
    extras = PROJECT["project"]["optional-dependencies"]
    ours = {name: extras[name] for name in {*EXTRA_OF.values(), *EXTRA_OF_COMMAND.values()}}
    brought = {package(line) for lines in ours.values() for line in lines}
    assert {name for name in brought if not name.startswith("smad")} == set(EXTRA_OF)
    bench = set(PROJECT["dependency-groups"]["bench"])
    assert not {package(line) for line in bench} & set(EXTRA_OF)


def test_what_is_installed_without_an_extra_is_the_bench_and_the_demo() -> None:
    extras = PROJECT["project"]["optional-dependencies"]
    bench = set(PROJECT["dependency-groups"]["bench"])
    assert set(PROJECT["project"]["dependencies"]) == bench | set(extras["log"])


@pytest.mark.parametrize("extra", BROUGHT_BY)
def test_what_an_extra_brings_is_what_the_project_says(extra: str) -> None:
    extras = PROJECT["project"]["optional-dependencies"]

    def brought(name: str) -> set[str]:
        found: set[str] = set()
        for one in map(package, extras[name]):
            below = one.removeprefix("smad[").removesuffix("]")
            found |= {one} if below == one else brought(below)
        return found

    assert set(BROUGHT_BY[extra]) == brought(extra)


def test_a_bench_computer_needs_no_extra(tmp_path: Path) -> None:
    cut = tmp_path / "a.mcap"
    cut.write_bytes(write_small_run(tmp_path / "b.mcap", 100).read_bytes()[:-200])
    folder, whole = str(tmp_path), str(tmp_path / "whole.mcap")
    done = without_extras(
        ["--help"],
        ["config", "show"],
        ["faults", "explain", "OVER_TEMPERATURE"],
        ["log", "list", "--folder", folder],
        ["log", "recover", str(cut), "-o", whole],
        ["log", "layouts", folder],
        ["start", "--help"],
        ["view", "--help"],
        ["service", "show"],
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "whole.mcap").exists()


def test_the_daemon_and_both_clients_import_nothing_of_an_extra() -> None:
    code = (
        "import sys, smad.daemon.lifecycle, smad.client.asynchronous, smad.view.server\n"
        f"print(sorted(set(sys.modules) & {set(EXTRA_OF)!r}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("command", "extra"),
    [
        (["sim"], "sim"),
        (["log", "show", "a.mcap"], "log"),
        (["log", "export", "a.mcap"], "export"),
        (["run", "--list"], "report"),
        (["gap", "effects"], "gap"),
    ],
)
def test_a_missing_extra_is_named_in_one_line(command: list[str], extra: str) -> None:
    done = without_extras(command)
    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.splitlines()
    assert line.endswith(f"pip install '.[{extra}]'")
