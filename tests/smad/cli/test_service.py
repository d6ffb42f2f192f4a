"""`smad service`: the files come to where the system looks, and nobody's changes are lost."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from smad.cli.service import service
from smad.errors import SmadError
from smad.processes.service import content


def test_the_files_are_installed_and_start_this_smad(tmp_path: Path) -> None:
    done = CliRunner().invoke(service, ["install", "--root", str(tmp_path)])
    rule = tmp_path / "etc/udev/rules.d/60-smad.rules"
    *units, last = map(Path, done.output.splitlines()[:4])
    assert last == rule
    for unit, words in zip(units, ("start", "queue run", "hooks run"), strict=True):
        assert f"ExecStart={sys.prefix}/bin/smad {words} --bench %i" in unit.read_text()
    unit = units[0]
    assert unit == tmp_path / "etc/systemd/system/smad@.service"
    assert unit.stat().st_mode & 0o777 == 0o644


def test_the_rule_names_the_board_that_the_wiring_proposes() -> None:
    assert '"2341", ATTRS{idProduct}=="0042"' in content("60-smad.rules"), "the Mega 2560 R3"


def test_a_file_that_somebody_changed_stays_until_it_is_given_up(tmp_path: Path) -> None:
    runner, arguments = CliRunner(), ["install", "--root", str(tmp_path)]
    runner.invoke(service, arguments)
    rule = tmp_path / "etc/udev/rules.d/60-smad.rules"
    rule.write_text("mine")
    with pytest.raises(SmadError, match="--overwrite"):
        runner.invoke(service, arguments, catch_exceptions=False)
    assert rule.read_text() == "mine"
    runner.invoke(service, [*arguments, "--overwrite"])
    assert rule.read_text() != "mine"
