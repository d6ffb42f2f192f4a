"""`python -m campaign faults` as it is typed."""

import json
from pathlib import Path

import pytest

from campaign.command import execute
from campaign.faults import oracle


def test_a_short_campaign_prints_the_table_and_writes_page_and_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page, data = tmp_path / "page.html", tmp_path / "data.json"
    words = ["faults", "--lockstep", "--only", "leak", "--only", "reboot", "--count", "4"]
    files = ["--jobs", "1", "--report", str(page), "--json", str(data)]
    assert execute([*words, *files]) == 0
    out = capsys.readouterr().out
    assert "4 injections, seed 1" in out
    assert "the oracle holds for every one" in out
    assert "<h1>Fault campaign</h1>" in page.read_text()
    faults = json.loads(data.read_text())["faults"]
    assert [(row["name"], row["count"]) for row in faults] == [("leak", 2), ("reboot", 2)]


def test_an_injection_that_breaks_the_oracle_ends_with_status_1(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(oracle.CLAUSES, "energy", lambda outcome: "too much, says the test")
    words = ["faults", "--lockstep", "--only", "leak", "--count", "1", "--jobs", "1"]
    assert execute(words) == 1
    assert "energy: too much, says the test" in capsys.readouterr().out


def test_a_fault_that_does_not_exist_is_refused_with_those_that_do(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert execute(["faults", "--only", "leek"]) == 1
    assert "got leek" in capsys.readouterr().err
