"""Model files: written, read back, and refused."""

import json

import pytest

from sim_device.plant import load_parameters
from sim_device.plant.errors import EffectError, ModelError, ParameterError
from sim_device.plant.models import load_model, read_model, save_model


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
    parameters, variant, effects = load_model(path)
    assert variant == "extended"
    assert parameters["resistivity"] == 0.5e-6
    assert parameters["warming_share"] == load_parameters("B")["warming_share"]
    assert effects["tube_friction"]["coulomb_N"] == 0.11
    assert effects["tube_friction"]["velocity_m_s"] > 0
    assert read_model(path).note == 'from a diagnosis of "run 3"'
    assert read_model(path).mounting == {"side_resistance": -0.02, "displacement_zero_mm": 0.3}


def test_a_base_beside_the_model_file_is_found(tmp_path):
    (tmp_path / "bench.toml").write_text('extends = "set_b.toml"\n')
    save_model(tmp_path / "model.toml", base="bench.toml")
    assert load_model(tmp_path / "model.toml")[0]["warming_share"] == 0.25


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"format": "other"}, ModelError, "format 'other'"),
        ({"variant": "real"}, ModelError, "variant 'real'"),
        ({"colour": 1}, ModelError, "unknown key 'colour'"),
        ({"overrides": {"colour": 1.0}}, ParameterError, "colour"),
        ({"overrides": {"density": "heavy"}}, ParameterError, "density"),
        ({"overrides": 3}, ModelError, "overrides"),
        ({"effects": {"warp": {}}}, EffectError, "warp"),
        ({"effects": {"rtd_lag": 3}}, ModelError, "effects.rtd_lag"),
        ({"mounting": {"tilt": 1.0}}, ModelError, "mounting.tilt"),
        ({"mounting": {"side_resistance": "even"}}, ModelError, "'even', not a number"),
        ({"base": "none.toml"}, ParameterError, "none.toml"),
    ],
)
def test_a_wrong_model_file_is_refused_with_what_is_wrong(tmp_path, change, error, words):
    path = tmp_path / "model.json"
    path.write_text(json.dumps({"format": "smad-model-1", **change}))
    with pytest.raises(error, match=words):
        load_model(path)


def test_text_that_is_no_model_is_refused(tmp_path):
    for name, text in (("a.json", "[1]"), ("b.json", "{"), ("c.toml", "= 3")):
        (tmp_path / name).write_text(text)
        with pytest.raises(ModelError):
            load_model(tmp_path / name)
    with pytest.raises(ModelError, match="cannot be read"):
        load_model(tmp_path / "none.toml")


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
