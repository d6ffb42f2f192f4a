"""`smad gap` as a user meets it, on run logs of the simulated bench."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from smad.cli.gap import gap
from smad.diagnosis.answer import Answer
from smad.diagnosis.next_run import Offer
from smad.diagnosis.plant import Experiment, ModelPoint
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.catalogue import CATALOGUE
from smad.diagnosis.spring_pair.recorded import recorded
from smad.diagnosis.verdict import Verdict
from smad.errors import SmadError
from smad.units import unparted

DIAGNOSED = "smad.diagnosis.spring_pair.files.diagnose_files"


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


def test_effects_lists_those_that_are_named_and_says_which_is_meant() -> None:
    shown = json.loads(call("effects", "rtd_lag", "pump_lag", "--json").output)
    assert {e["name"] for e in shown} == {"rtd_lag", "pump_lag"}
    refused = call("effects", "rtdlag")
    assert refused.exit_code == 2
    assert "did you mean rtd_lag" in refused.output


@pytest.mark.parametrize("command", [("diagnose",), ("plan", "--inputs")])
def test_a_table_without_a_known_column_is_refused_by_the_names_of_its_inputs(
    tmp_path: Path, command: tuple[str, ...]
) -> None:
    table = tmp_path / "other.csv"
    table.write_text("t_s,temp\n0,1\n1,2\n")
    refused = call(*command, str(table))
    assert refused.exit_code in (1, 3)
    said = f"{refused.output} {refused.exception}"
    assert "i_applied_x_A, i_applied_y_A, duty_x, duty_y" in said


def test_next_without_runs_lists_the_catalogue() -> None:
    assert all(t.name in call("next").output for t in CATALOGUE)


def test_next_prints_what_is_confused_and_each_experiment_that_parts_it_the_best_first(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def offered(answer: Answer, say: object) -> tuple[list[str], list[Offer]]:
        return ["film, X", "reading of the RTD, X"], [
            Offer(Experiment(f"n{k}", f"title {k}", 60.0, f"smad gap next --run n{k}"), 9.0 - k)
            for k in range(6)
        ]

    left = Answer(verdict=Verdict(question="differs", outcome="causes", headline="it lacks"))
    monkeypatch.setattr(DIAGNOSED, lambda *asked, **options: left)
    monkeypatch.setattr("smad.diagnosis.next_run.offers", offered)
    path = tmp_path / "a.mcap"
    path.touch()
    *_, confused, first, second, third, last = call("next", str(path)).output.splitlines()
    assert confused.startswith("Not separated: film, X or reading of the RTD, X.")
    for k, line in enumerate((first, second, third, last)):
        assert line == f"  d² {9.0 - k:>7.1f}    60 s  title {k}:  smad gap next --run n{k}"


def test_an_answer_whose_page_cannot_be_written_is_printed_and_its_other_files_are_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    verdict = Verdict(question="differs", outcome="causes", headline="it lacks", models=["a", "b"])
    monkeypatch.setattr(DIAGNOSED, lambda *asked, **options: Answer(verdict=verdict))

    write_text = Path.write_text

    def no_room(path: Path, text: str, encoding: str) -> int:
        if "v.html" in path.name:
            raise OSError(28, "No space left on device")
        return write_text(path, text, encoding)

    monkeypatch.setattr(Path, "write_text", no_room)
    run, page, json_path, model = (tmp_path / n for n in ("a.mcap", "v.html", "v.json", "m.toml"))
    run.touch()
    files = ["--report", str(page), "--json", str(json_path), "--apply", str(model)]
    result = call("diagnose", str(run), *files)
    assert isinstance(result.exception, SmadError)
    assert "the report cannot be written: No space left" in str(result.exception)
    assert result.stdout.startswith("it lacks\n")
    assert json_path.read_bytes() == verdict.to_json()
    assert model.read_text() == "b"
    assert f"written: {model}" in result.stderr
    assert str(page) not in result.stderr


def test_a_usage_error_of_a_check_up_names_the_help_of_its_command() -> None:
    assert "Usage: gap checkup " in call("checkup", "--good", ".").output


def test_next_says_so_where_nothing_is_confused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    left = Answer(verdict=Verdict(question="differs", outcome="quiet", headline="no gap"))
    monkeypatch.setattr(DIAGNOSED, lambda *asked, **options: left)
    path = tmp_path / "a.mcap"
    path.touch()
    assert call("next", str(path)).output.splitlines()[-1].startswith("No two rivals remain")


def test_an_unknown_experiment_is_refused_with_the_known_ones() -> None:
    result = call("next", "--sim", "--run", "no such")
    assert isinstance(result.exception, SmadError)
    assert "smad gap next" in str(result.exception)
    close = call("next", "--sim", "--run", "pump width")
    assert "did you mean pump widths?" in str(close.exception)


def test_a_recorded_experiment_is_a_run_that_verify_can_read(log: Path, tmp_path: Path) -> None:
    model = tmp_path / "model.toml"
    SmaPlant().save_model(ModelPoint({"flow_max": 1.6e-7}), model, "")
    rows = json.loads(call("verify", "--model", str(model), str(log), "--json").stdout)
    by_name = {r["signal"]: r for r in rows}
    assert by_name["displacement_mm"]["before"] < 1.0
    rtd = by_name["rtd_x_degC"]
    assert rtd["after"] > 3.0 * rtd["before"]
    assert rows[-1]["unit"] == "floors"


def test_verify_says_beside_its_table_which_run_it_could_not_use(log: Path, tmp_path: Path) -> None:
    model, other = tmp_path / "model.toml", tmp_path / "other.csv"
    SmaPlant().save_model(ModelPoint({"flow_max": 1.6e-7}), model, "")
    other.write_text("t_s,temp_x_degC\n0,1\n1,2\n")
    said = call("verify", "--model", str(model), str(log), str(other), "--json")
    assert "other: inputs are missing" in said.stderr
    assert json.loads(said.stdout)[-1]["unit"] == "floors"


def test_plan_takes_several_files_of_inputs_as_its_help_says(log: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.csv"
    other.write_text("t_s,temp_x_degC\n0,1\n1,2\n")
    said = call("plan", "--inputs", str(log), str(other))
    assert str(said.exception).startswith("other lacks inputs")


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


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result, Path]:
    """A diagnosis of one short run of a bench whose driver gives more: folder, what was said."""
    folder = tmp_path_factory.mktemp("told")
    plant = SmaPlant()
    bench = ModelPoint({}, {"driver_gain": {"gain": 0.1, "y_share": 1.0}})
    run = recorded("mixed", plant, bench, 1, duration_s=12.0)
    columns = {"t_s": run.t_s, **run.inputs, **run.outputs}
    table = folder / "run.csv"
    np.savetxt(
        table,
        np.column_stack(list(columns.values())),
        delimiter=",",
        header=",".join(columns),
        comments="",
        fmt="%.7g",
    )
    said = call(
        "diagnose",
        str(table),
        "--json",
        str(folder / "v.json"),
        "--report",
        str(folder / "v.html"),
        "--apply",
        str(folder / "all.toml"),
    )
    assert said.exit_code == 0
    return folder, said, table


def test_diagnose_says_the_answer_and_writes_verdict_page_and_model(
    told: tuple[Path, Result, Path],
) -> None:
    folder, said, _ = told
    verdict = Verdict.from_json((folder / "v.json").read_bytes())
    assert said.stdout.startswith(verdict.headline)
    assert verdict.causes[0].name == "driver_gain"
    assert verdict.whole is not None
    assert verdict.whole.final < 0.5 * verdict.whole.raw
    assert f"{verdict.whole.raw:.3g}" in said.stdout
    assert f"smad gap verify NEW-RUNS --model {folder / 'all.toml'}" in said.stdout
    assert "write the better model" not in said.stdout
    answer, gap = unparted(verdict.headline)[1:].split("; ")
    page = (folder / "v.html").read_text()
    assert answer in page
    assert gap[1:] in page
    assert (folder / "all.toml").read_text() == verdict.models[-1]


def test_apply_writes_the_model_with_the_first_causes_and_verify_shows_what_they_add(
    told: tuple[Path, Result, Path],
) -> None:
    folder, _, table = told
    left = []
    for first in ("0", "1"):
        out = folder / f"first-{first}.toml"
        said = call("apply", str(folder / "v.json"), "--out", str(out), "--first", first)
        assert said.output.startswith(f"{out}: parameters")
        rows = json.loads(call("verify", "--model", str(out), str(table), "--json").stdout)
        left.append(rows[-1]["after"])
    assert left[1] < 0.8 * left[0]
    too_many = call("apply", str(folder / "v.json"), "--out", str(folder / "x"), "--first", "99")
    assert "fewer causes" in str(too_many.exception)
    no_verdict = call("apply", str(table), "--out", str(folder / "x"))
    assert "is not a verdict" in str(no_verdict.exception)
