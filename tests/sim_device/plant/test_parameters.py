"""Parameter files: what they give, and every way in which one is refused."""

import re

import pytest

from sim_device.plant import load_parameters
from sim_device.plant.errors import ParameterError
from sim_device.plant.fields import FIELDS
from sim_device.plant.parameters import (
    BUILT_IN,
    DATA,
    initial_detwinned,
    parameters_text,
    spring_factors,
)
from tests.sim_device.plant.cases import values_of


@pytest.fixture(scope="module")
def text():
    return (DATA / "set_a.toml").read_text(encoding="utf-8")


def refused(tmp_path, text):
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ParameterError) as error:
        load_parameters(path)
    return error.value


def changed(text, name, key, value):
    """The text with one key of one entry replaced."""
    pattern = rf"(\[{name}\]\n(?:.*\n)*?){key} = .*\n"
    result, count = re.subn(pattern, rf"\g<1>{key} = {value}\n", text, count=1)
    assert count == 1
    return result


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_built_in_set_has_every_entry_with_its_provenance(name):
    parameters = load_parameters(name)
    assert [entry.name for entry in parameters.entries] == [field.name for field in FIELDS]
    for entry in parameters.entries:
        assert entry.low <= entry.value <= entry.high
        assert entry.source
        assert entry.status in ("published", "derived", "assumed")


def test_set_b_differs_from_set_a_in_resistivity_share_and_loss_alone():
    a, b = load_parameters("A"), load_parameters("B")
    differing = {name for name in a.names if a[name] != b[name]}
    assert differing == {"resistivity", "warming_share", "tube_loss"}


def test_values_are_held_in_si():
    parameters = load_parameters("A")
    assert parameters["wire_diameter"] == pytest.approx(0.75e-3)
    assert parameters["austenite_start"] == pytest.approx(301.15)
    assert parameters["flow_max"] == pytest.approx(131.9e-9)
    assert parameters.entry("stress_start").shown() == "58 MPa"


def test_stiffnesses_and_first_fraction_are_those_of_the_text():
    parameters = load_parameters("A")
    c1, c2 = spring_factors(parameters)
    assert c2 * parameters["modulus_martensite"] / c1 == pytest.approx(58.5, rel=2e-3)
    assert c2 * parameters["modulus_austenite"] / c1 == pytest.approx(116.2, rel=2e-3)
    assert initial_detwinned(parameters) == pytest.approx(0.0976, abs=1e-4)


@pytest.mark.parametrize("name", [field.name for field in FIELDS])
def test_a_file_without_an_entry_is_refused_by_its_name(tmp_path, text, name):
    without = re.sub(rf"\[{name}\]\n(?:.+\n)+\n?", "", text)
    error = refused(tmp_path, without)
    assert error.name == name
    assert "missing" in str(error)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("density", ("value", "9000"), ["9000", "6300", "6600", "range of the file"]),
        ("austenite_start", ("value", "50"), ["50 degC", "27 degC to 31 degC"]),
        ("coils", ("value", "30"), ["30 is outside the range of the file, 16 to 21"]),
        ("coil_diameter", ("unit", '"m"'), ["physical limit", "0.05 m"]),
        ("austenite_start", ("unit", '"K"'), ["physical limit", "K"]),
        ("density", ("value", '"heavy"'), ["heavy", "not a number"]),
        ("density", ("value", "nan"), ["nan", "finite"]),
        ("density", ("unit", '"mm"'), ["'mm'", "kg/m3"]),
        ("density", ("unit", '"stone"'), ["'stone'", "kg/m3"]),
        ("density", ("status", '"guessed"'), ["guessed", "assumed"]),
        ("density", ("range", "[6600, 6300]"), ["reversed"]),
        ("density", ("range", "[1, 1e9]"), ["physical limit"]),
        ("density", ("range", "6450"), ["[low, high]"]),
        ("density", ("source", '""'), ["source"]),
        ("warming_share", ("range", "[0.1, 3.0]"), ["physical limit"]),
    ],
)
def test_a_wrong_entry_is_refused_with_name_value_and_limit(tmp_path, text, name, change, words):
    error = refused(tmp_path, changed(text, name, *change))
    assert error.name == name
    for word in words:
        assert word in str(error)


@pytest.mark.parametrize(
    ("small", "values", "large"),
    [
        ("austenite_start", ("46.0", "[20, 50]"), "austenite_finish"),
        ("martensite_finish", ("36.0", "[20, 50]"), "martensite_start"),
        ("stress_start", ("160.0", "[20, 200]"), "stress_finish"),
        ("wire_diameter", ("1.6", "[0.1, 2.0]"), "tube_diameter"),
    ],
)
def test_entries_out_of_order_are_refused_naming_both(tmp_path, text, small, values, large):
    value, wide = values
    error = refused(tmp_path, changed(changed(text, small, "range", wide), small, "value", value))
    assert error.name == small
    assert large in str(error)


def test_equal_start_and_finish_are_refused():
    parameters = load_parameters("A")
    with pytest.raises(ParameterError, match="austenite_start"):
        parameters.replace(austenite_start=parameters["austenite_finish"])


def test_a_mounting_that_the_moduli_cannot_hold_is_refused():
    with pytest.raises(ParameterError, match=r"initial_force.*Eq\. \(10\)"):
        load_parameters("A").replace(initial_force=1.6)


def test_unknown_entries_and_keys_are_refused(tmp_path, text):
    assert refused(tmp_path, text + "\n[colour]\nvalue = 1\n").name == "colour"
    assert "unknown key 'note'" in str(refused(tmp_path, text + 'note = "x"\n'))


def test_broken_and_absent_files_are_refused_without_a_traceback(tmp_path):
    assert "not TOML" in str(refused(tmp_path, "[density\n"))
    with pytest.raises(ParameterError, match="cannot be read"):
        load_parameters(tmp_path / "none.toml")
    (tmp_path / "loop.toml").write_text('extends = "loop.toml"\n')
    with pytest.raises(ParameterError, match="extends itself"):
        load_parameters(tmp_path / "loop.toml")


def test_a_file_can_extend_another_one_and_inherits_its_entries(tmp_path, text):
    (tmp_path / "base.toml").write_text(text, encoding="utf-8")
    entry = re.search(r"\[coils\]\n(?:.+\n)+", text).group(0).replace("value = 20", "value = 18")
    (tmp_path / "mine.toml").write_text('extends = "base.toml"\n' + entry, encoding="utf-8")
    parameters = load_parameters(tmp_path / "mine.toml")
    assert parameters["coils"] == 18
    assert parameters["density"] == load_parameters("A")["density"]


def test_replace_makes_another_set_and_leaves_the_first():
    parameters = load_parameters("A")
    changed = parameters.replace(resistivity=0.5e-6)
    assert changed["resistivity"] == 0.5e-6
    assert parameters["resistivity"] == pytest.approx(0.82e-6)
    assert changed.digest() != parameters.digest()
    assert load_parameters("A").digest() == parameters.digest()
    with pytest.raises(ParameterError, match="no such parameter"):
        parameters.replace(colour=1.0)
    with pytest.raises(ParameterError, match="physical limit"):
        parameters.replace(resistivity=1.0)


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_set_written_out_and_read_back_is_the_same(tmp_path, name):
    parameters = load_parameters(name).replace(latent_cooling=5000.0)
    path = tmp_path / "out.toml"
    path.write_text(parameters_text(parameters), encoding="utf-8")
    again = load_parameters(path)
    assert values_of(again) == pytest.approx(values_of(parameters), rel=1e-14)
    assert [entry.source for entry in again.entries] == [e.source for e in parameters.entries]
