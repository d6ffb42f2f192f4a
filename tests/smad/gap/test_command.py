"""`smad gap` as a user meets it, on run logs of the simulated bench."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from smad.cli.gap import gap
from smad.diagnosis.spring_pair.catalogue import CATALOGUE
from smad.errors import SmadError
from tests.smad.gap.cases import ask_alike


def call(*arguments: str) -> Result:
    result = CliRunner().invoke(gap, list(arguments), catch_exceptions=True)
    if isinstance(result.exception, Exception) and not isinstance(result.exception, SmadError):
        raise result.exception
    return result


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    assert call("next", "--sim", "--run", "one side", "--folder", str(folder)).exit_code == 0
    return next(folder.glob("*.mcap"))


def test_effects_lists_the_whole_library_from_the_registry() -> None:
    listed = json.loads(call("effects", "--json").output)
    assert len(listed) >= 25
    shown = call("effects").output
    for e in listed:
        assert e["name"] in shown
        assert e["equation"]
        assert e["separates"]
        assert e["reference"]
        assert all(q["low"] <= q["typical"] <= q["high"] for q in e["parameters"])


def test_next_without_runs_lists_the_catalogue() -> None:
    assert all(t.name in call("next").output for t in CATALOGUE)


def test_next_prints_what_each_experiment_brings_and_all_of_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    left = ask_alike()
    monkeypatch.setattr("smad.cli.gap._diagnosed", lambda *asked: left)
    path = tmp_path / "a.mcap"
    path.touch()
    *_, first, second, third, last = call("next", str(path)).output.splitlines()
    for line, x in zip((first, second, third), left.experiments, strict=True):
        assert line.startswith(f"d² {x.counted:>7.1f}    60 s  {x.title}")
    assert last == (
        f"Together d² {left.experiments[-1].together:.1f}, one run of each; 14 tell two causes "
        "apart."
    )


def test_an_unknown_experiment_is_refused_with_the_known_ones() -> None:
    result = call("next", "--sim", "--run", "no such")
    assert isinstance(result.exception, SmadError)
    assert "smad gap next" in str(result.exception)
    close = call("next", "--sim", "--run", "pump width")
    assert "did you mean pump widths?" in str(close.exception)


def test_a_recorded_experiment_is_a_run_that_verify_can_read(log: Path, tmp_path: Path) -> None:
    from smad.diagnosis.plant import ModelPoint
    from smad.diagnosis.spring_pair import SmaPlant

    model = tmp_path / "model.toml"
    SmaPlant().save_model(ModelPoint({"flow_max": 1.6e-7}), model, "")
    rows = json.loads(call("verify", "--model", str(model), str(log), "--json").output)
    by_name = {r["channel"]: r for r in rows}
    assert by_name["displacement_mm"]["before"] < 1.0
    assert by_name["rtd_x_degC"]["after"] > 5.0


def test_a_log_that_is_cut_is_used_up_to_the_cut(log: Path, tmp_path: Path) -> None:
    from smad.diagnosis.spring_pair.signals import read_gap_run

    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.read_bytes()[: int(0.6 * log.stat().st_size)])
    run = read_gap_run(cut)
    assert run.cut_short
    assert 10.0 < run.duration_s < read_gap_run(log).duration_s


def test_an_exported_table_is_the_same_run_as_its_log(log: Path, tmp_path: Path) -> None:
    from smad.diagnosis.spring_pair.signals import read_gap_run
    from smad.runlog.export import export_run
    from smad.runlog.reader import read_run

    one = read_gap_run(log)
    for name in ("table.csv", "table.parquet"):
        export_run(read_run(log), tmp_path / name)
        other = read_gap_run(tmp_path / name)
        assert one.outputs.keys() == other.outputs.keys()
        assert all(np.allclose(other.outputs[k], v, atol=1e-6) for k, v in one.outputs.items())


def test_a_parameter_file_that_is_not_there_is_one_line(tmp_path: Path, log: Path) -> None:
    result = call("diagnose", str(log), "--params", str(tmp_path / "none.toml"))
    assert isinstance(result.exception, SmadError)
    assert "none.toml" in str(result.exception)
