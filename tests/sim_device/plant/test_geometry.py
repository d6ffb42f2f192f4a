"""A spring of one's own, scaled from a known one."""

from pathlib import Path

import pytest

from sim_device.plant import load_parameters
from sim_device.plant.errors import ParameterError
from sim_device.plant.geometry import Geometry, coil_film, load_geometry, pitch_factor, scaled
from sim_device.plant.parameters import initial_detwinned, spring_factors

A = load_parameters("A")
OWN = Geometry(wire_mm=0.5, coil_mm=3.5, turns=12)


def test_the_geometry_of_the_set_itself_changes_nothing() -> None:
    same = scaled(A, Geometry(wire_mm=0.75, coil_mm=6.5, turns=20))
    assert same.vector() == pytest.approx(A.vector(), rel=1e-12)


def test_another_spring_has_the_same_strains_and_stresses() -> None:
    own = scaled(A, OWN)
    (c1, c2), (own_c1, own_c2) = spring_factors(A), spring_factors(own)
    for name in ("max_deflection", "initial_deflection"):
        assert own_c2 * own[name] == pytest.approx(c2 * A[name], rel=1e-12)
    assert own_c1 * own["initial_force"] == pytest.approx(c1 * A["initial_force"], rel=1e-12)
    assert initial_detwinned(own) == pytest.approx(initial_detwinned(A), rel=1e-9)
    assert own["tube_diameter"] - own["wire_diameter"] == pytest.approx(0.825e-3)


def test_the_prestrain_of_the_set_gives_its_tension() -> None:
    strain = spring_factors(A)[1] * A["initial_deflection"]
    own = scaled(A, Geometry(wire_mm=0.75, coil_mm=6.5, turns=20, prestrain=strain))
    assert own["initial_deflection"] == pytest.approx(A["initial_deflection"])
    assert own["initial_force"] == pytest.approx(A["initial_force"], rel=1e-6)
    assert initial_detwinned(own) == pytest.approx(initial_detwinned(A), rel=1e-6)


def test_closer_turns_lose_less_and_the_factor_rests_where_it_was_not_measured() -> None:
    factors = [pitch_factor(pitch, 0.51) for pitch in (0.0, 1.0, 2.0, 3.0)]
    assert factors == sorted(factors)
    assert factors[0] < 1.0 < factors[-1]
    assert pitch_factor(40.0, 0.5) == pitch_factor(3.0, 0.5)


def test_a_straight_wire_has_its_film_and_a_coil_one_that_grows_with_the_difference() -> None:
    assert coil_film(OWN) == {"laws": (), "effects": {}}
    film = coil_film(Geometry(wire_mm=0.5, coil_mm=3.5, turns=12, pitch_mm=0.0))
    (law,) = film["laws"]
    assert law.place == "film"
    assert law.terms[0].coefficient == pytest.approx(pitch_factor(0.0, 0.5) - 1.0)
    assert film["effects"]["convection_exponent"]["exponent"] > 0.0


def test_a_file_holds_a_geometry_and_its_base(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('base = "B"\nwire_mm = 0.5\ncoil_mm = 3.5\nturns = 12\npitch_mm = 1.0\n')
    base, geometry = load_geometry(path)
    assert base.vector() == load_parameters("B").vector()
    assert geometry == Geometry(wire_mm=0.5, coil_mm=3.5, turns=12, pitch_mm=1.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("wire_mm = 0.5\ncoil_mm = 3.5\n", "turns: missing"),
        ("wire_mm = 0.5\ncoil_mm = 3.5\nturns = 12\ncolour = 1\n", "colour: unknown"),
        ('wire_mm = "thin"\ncoil_mm = 3.5\nturns = 12\n', "not a number"),
        ("wire_mm = nan\ncoil_mm = 3.5\nturns = 12\n", "wire_mm: nan is outside"),
        ("wire_mm = 2.0\ncoil_mm = 3.5\nturns = 12\n", "less than two wires"),
        ("wire_mm = 0.5\ncoil_mm = 3.5\nturns = 12\ntube_mm = 0.4\n", "does not hold the wire"),
        (
            "wire_mm = 0.5\ncoil_mm = 3.5\nturns = 12\nprestrain = 0.5\n",
            "prestrain: 0.5 is outside",
        ),
    ],
)
def test_a_geometry_that_cannot_be_is_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=words):
        load_geometry(path)
