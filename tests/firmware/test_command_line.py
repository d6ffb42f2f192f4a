"""`smad sim --firmware` as its user meets it: what it refuses, and what it runs."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from sim_device.firmware import build
from smad.cli.sim import sim
from smad.processes.boards import SimulatedBenchError
from tests.firmware.conftest import needs


def run(*arguments: str) -> str:
    done = CliRunner().invoke(sim, ["--for", "0.2", *arguments], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def test_it_names_its_port_and_how_much_passed() -> None:
    needs("host")
    assert run("--firmware", "host", "--speed", "5").startswith("ready: /dev/pts/")


def test_a_rate_that_the_mega_has_not_the_time_for_is_refused() -> None:
    with pytest.raises(SimulatedBenchError, match="got 500; allowed: 100"):
        run("--firmware", "avr", "--rate", "500")


def test_a_fault_of_the_python_boards_code_is_refused() -> None:
    needs("host")
    with pytest.raises(SimulatedBenchError, match="take --firmware python"):
        run("--firmware", "host", "--fault", "major_other@0")


def test_a_store_in_no_folder_is_refused(tmp_path: Path) -> None:
    needs("host")
    with pytest.raises(SimulatedBenchError, match="no such folder"):
        run("--firmware", "host", "--store", str(tmp_path / "none" / "store"))


def test_a_missing_compiler_is_named_with_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build.shutil, "which", lambda name: None)
    assert "gcc-avr" in build.missing("avr")
    monkeypatch.delenv(build.REQUIRED_VARIABLE, raising=False)
    assert "apt-get install" in build.reason_to_skip("avr")
    monkeypatch.setenv(build.REQUIRED_VARIABLE, "1")
    assert build.reason_to_skip("avr") == ""
    with pytest.raises(SimulatedBenchError, match="gcc-avr"):
        run("--firmware", "avr")
