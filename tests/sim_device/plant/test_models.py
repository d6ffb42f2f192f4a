"""Model files: written, read back, and refused."""

import json

import pytest

from sim_device.plant import load_parameters
from sim_device.plant.errors import EffectError, ModelError, ParameterError
from sim_device.plant.models import read_model, save_model, write_model


@pytest.mark.parametrize("name", ["model.toml", "model.json"])
def test_a_model_comes_back_as_it_was_saved(tmp_path, name):
    path = tmp_path / name
    save_model(
        path,
        base="B",
        overrides={"resistivity": 0.5e-6, "austenite_start": 300.4},
        effects={"tube_friction": {"coulomb_N": 0.11, "proportional": 0.06}},
        mounting={"side_resistance": -0.02, "displacement_zero_mm": 0.3},
        note='from a diagnosis of "run 3"',
    )
    model = read_model(path)
    assert model.variant == "extended"
    assert model.parameters["resistivity"] == 0.5e-6
    assert model.parameters["warming_share"] == load_parameters("B")["warming_share"]
    assert model.effects["tube_friction"]["coulomb_N"] == 0.11
    assert model.effects["tube_friction"]["velocity_m_s"] > 0
    assert model.note == 'from a diagnosis of "run 3"'
    assert model.mounting == {"side_resistance": -0.02, "displacement_zero_mm": 0.3}


def test_a_base_beside_the_model_file_is_found(tmp_path):
    (tmp_path / "bench.toml").write_text('extends = "set_b.toml"\n')
    save_model(tmp_path / "model.toml", base="bench.toml")
    model = read_model(tmp_path / "model.toml")
    assert model.parameters["warming_share"] == 0.25
    (tmp_path / "elsewhere").mkdir()
    write_model(tmp_path / "elsewhere/model.toml", model)
    again = read_model(tmp_path / "elsewhere/model.toml").parameters
    assert {n: again[n] for n in again.names} == {n: model.parameters[n] for n in again.names}


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"format": "other"}, ModelError, "format 'other'"),
        ({"format": None}, ModelError, "not a model file: it has no format"),
        ({"variant": "real"}, ModelError, "variant 'real'"),
        ({"colour": 1}, ModelError, "unknown key 'colour'"),
        ({"overrides": {"colour": 1.0}}, ParameterError, "colour"),
        ({"overrides": {"density": "heavy"}}, ParameterError, "density"),
        ({"overrides": 3}, ModelError, "overrides"),
        ({"effects": {"warp": {}}}, EffectError, "warp"),
        ({"effects": {"rtd_lag": 3}}, ModelError, "effects.rtd_lag"),
        ({"mounting": {"tilt": 1.0}}, ModelError, "mounting.tilt"),
        ({"mounting": {"side_resistance": "even"}}, ModelError, "'even', not a number"),
        ({"base": "none.toml"}, ParameterError, r"^model\.json: base: .*none\.toml"),
    ],
)
def test_a_wrong_model_file_is_refused_with_what_is_wrong(tmp_path, change, error, words):
    path = tmp_path / "model.json"
    path.write_text(json.dumps({"format": "smad-model-1", **change}))
    with pytest.raises(error, match=words):
        read_model(path)


def test_text_that_is_no_model_is_refused(tmp_path):
    for name, text in (("a.json", "[1]"), ("b.json", "{"), ("c.toml", "= 3")):
        (tmp_path / name).write_text(text)
        with pytest.raises(ModelError):
            read_model(tmp_path / name)
    with pytest.raises(ModelError, match=r"cannot be read \(.*\); give a model file"):
        read_model(tmp_path / "none.toml")


def test_saving_a_wrong_model_leaves_the_old_file_alone(tmp_path):
    path = tmp_path / "model.toml"
    save_model(path, effects={"rtd_lag": {}})
    before = path.read_text()
    with pytest.raises(EffectError):
        save_model(path, effects={"warp": {}})
    with pytest.raises(ParameterError):
        save_model(path, overrides={"density": 0.0})
    assert path.read_text() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["model.toml"]
