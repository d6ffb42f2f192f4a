"""The model of a verdict as a file: with all its causes, or its first ones."""

from dataclasses import astuple
from pathlib import Path

import msgspec
import pytest
from click.testing import CliRunner

from smad.cli.gap import gap
from smad.diagnosis.answer import Answer
from smad.diagnosis.errors import PlantMismatch
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.report.files import AnswerFiles
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.verdict import CAUSES, DIFFERS, Verdict

TOLD = Verdict(
    question=DIFFERS, outcome=CAUSES, headline="", models=["parameters", "one", "one and two"]
)


@pytest.mark.parametrize(
    ("first", "text"), [(0, "parameters"), (1, "one"), (2, "one and two"), (None, "one and two")]
)
def test_the_first_causes_are_written_or_all(first: int | None, text: str, tmp_path: Path) -> None:
    TOLD.write_model(tmp_path / "m.toml", first)
    assert (tmp_path / "m.toml").read_text() == text


@pytest.mark.parametrize("first", [3, -1])
def test_more_causes_than_there_are_are_refused_with_the_limit(first: int, tmp_path: Path) -> None:
    with pytest.raises(PlantMismatch, match=r"fewer causes.*0 \(parameters alone\) to 2"):
        TOLD.write_model(tmp_path / "m.toml", first)
    assert not (tmp_path / "m.toml").exists()


def test_a_verdict_without_a_model_writes_nothing_and_says_why(tmp_path: Path) -> None:
    bare = Verdict(question=DIFFERS, outcome="refused", headline="", plant="heater")
    with pytest.raises(PlantMismatch, match="refused, plant heater"):
        bare.write_model(tmp_path / "m.toml")
    assert not (tmp_path / "m.toml").exists()


def test_a_plant_class_that_writes_no_model_is_told_which_member_would(tmp_path: Path) -> None:
    of_own_class = Verdict(question=DIFFERS, outcome=CAUSES, headline="", plant="dc motor")
    with pytest.raises(PlantMismatch, match=r"causes, plant dc motor.*save_model.*answer\.model"):
        of_own_class.write_model(tmp_path / "m.toml")


@pytest.mark.parametrize("name", ["n.toml", "n.json"])
def test_a_model_is_written_in_the_format_that_its_name_ends_with(
    name: str, tmp_path: Path
) -> None:
    plant = SmaPlant()
    plant.save_model(ModelPoint({}, {"rtd_lag": {"tau_s": 0.6}}), tmp_path / "m.toml", "a lag")
    verdict = msgspec.structs.replace(TOLD, models=[(tmp_path / "m.toml").read_text()])
    files = AnswerFiles(verdict=tmp_path / "v.json", page=None, model=tmp_path / name)
    written, failed = files.write(Answer(verdict=verdict), "", ())
    assert (written, failed) == ([tmp_path / "v.json", tmp_path / name], [])
    again = ["apply", str(tmp_path / "v.json"), "--out", str(tmp_path / f"again-{name}")]
    assert CliRunner().invoke(gap, again).exit_code == 0
    for model in (tmp_path / name, tmp_path / f"again-{name}"):
        assert astuple(plant.load_model(model)) == astuple(plant.load_model(tmp_path / "m.toml"))
        assert model.read_text().startswith("{") == (model.suffix == ".json")


def test_a_verdict_writes_its_model_in_the_format_that_the_name_ends_with(tmp_path: Path) -> None:
    plant = SmaPlant()
    plant.save_model(ModelPoint({}, {"rtd_lag": {"tau_s": 0.6}}), tmp_path / "m.toml", "a lag")
    text = (tmp_path / "m.toml").read_text()
    verdict = Verdict(question=DIFFERS, outcome=CAUSES, headline="", models=[text, "<mujoco/>"])
    for name in ("n.toml", "n.json"):
        verdict.write_model(tmp_path / name, 0)
        written, given = (plant.load_model(tmp_path / file) for file in (name, "m.toml"))
        assert astuple(written) == astuple(given)
    verdict.write_model(tmp_path / "x.json", 1)
    assert (tmp_path / "x.json").read_text() == "<mujoco/>"


def test_an_answer_without_a_model_still_writes_its_verdict(tmp_path: Path) -> None:
    bare = msgspec.structs.replace(TOLD, models=[])
    files = AnswerFiles(verdict=tmp_path / "v.json", page=None, model=tmp_path / "m.toml")
    written, failed = files.write(Answer(verdict=bare), "", ())
    assert written == [tmp_path / "v.json"]
    assert "has no model to write" in str(failed[0])
    assert not (tmp_path / "m.toml").exists()
