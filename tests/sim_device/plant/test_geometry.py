"""A spring of one's own, scaled from a known one."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_device.plant import load_parameters
from sim_device.plant.constants import kernel_constants, wire_length
from sim_device.plant.errors import ParameterError
from sim_device.plant.geometry import (
    COIL_EXPONENT,
    COIL_K,
    EMISSIVITY,
    STEFAN_BOLTZMANN,
    Geometry,
    air_film,
    fan,
    load_geometry,
    pitch_factor,
    radiating_share,
    radiation,
    scaled,
)
from sim_device.plant.laws import Law
from sim_device.plant.parameters import initial_detwinned, spring_factors
from tests.sim_device.plant.cases import values_of

A, CONSERVING = load_parameters("A"), load_parameters("conserving")
OWN = Geometry(wire_mm=0.5, coil_mm=3.5, turns=12)


def test_the_geometry_of_the_set_itself_changes_nothing() -> None:
    same = scaled(A, Geometry(wire_mm=0.75, coil_mm=6.5, turns=20))
    assert values_of(same) == pytest.approx(values_of(A), rel=1e-12)


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


def test_the_loss_of_a_coil_is_what_kolyvas_measured() -> None:
    """Their surface h(I², pitch) in W/K of the whole spring, 0.35 Ω, room at 18 °C."""
    worst = []
    for square_A2 in np.linspace(0.1, 1.1, 11):
        for pitch_mm in np.linspace(0.0, 3.0, 7):
            x, y = square_A2, pitch_mm
            measured_W = 2.261 + 3.879 * x + 0.5832 * y - 2.035 * x**2 + 0.6178 * x * y
            measured_W = 1e-3 * (measured_W + 0.1431 * y**2)
            rise_K = 0.35 * square_A2 / measured_W
            geometry = Geometry(wire_mm=0.51, coil_mm=3.45, turns=8, pitch_mm=pitch_mm)
            own = scaled(CONSERVING, geometry).replace(ambient_temperature=291.15)
            convection = kernel_constants(own, variant="extended", fixture="stretch", cooling="air")
            root = 0.60 + convection["air_convection"] * rise_K ** (1.0 / 6.0)
            film = convection["air_conductance"] * convection["length"] * root**2
            film *= pitch_factor(pitch_mm, 0.51) * (rise_K / COIL_K) ** COIL_EXPONENT
            given_W = film - radiated_W(radiation(own, geometry), rise_K) / rise_K
            worst.append(given_W / measured_W - 1.0)
    assert np.std(worst) < 0.025
    assert np.max(np.abs(worst)) < 0.085


def radiated_W(law: Law, rise_K: float) -> float:
    line, square = (term.coefficient for term in law.terms)
    return line * rise_K + square * rise_K**2


def test_a_straight_wire_radiates_as_its_emissivity_says_and_a_closed_coil_less() -> None:
    own = scaled(A, OWN)
    straight = radiation(own, OWN)
    area_m2 = math.pi * 0.5e-3 * wire_length(own)
    for rise_K, near in ((50.0, 1e-6), (100.0, 1e-6), (25.0, 0.06), (75.0, 0.06)):
        black_W = STEFAN_BOLTZMANN * area_m2 * ((300.0 + rise_K) ** 4 - 300.0**4)
        assert radiated_W(straight, rise_K) == pytest.approx(-EMISSIVITY * black_W, rel=near)
    shares = [radiating_share(replace(OWN, pitch_mm=pitch)) for pitch in (0.0, 0.5, 3.0, 50.0)]
    assert shares == sorted(shares)
    closed = 1.0 / ((1.0 - EMISSIVITY) / EMISSIVITY + math.pi)  # a tube: 1/π of the wire's surface
    assert shares[0] == pytest.approx(closed, rel=1e-3)
    assert shares[-1] == pytest.approx(EMISSIVITY, rel=0.02)


def test_a_straight_wire_has_its_film_and_a_coil_one_that_grows_with_the_difference() -> None:
    own = scaled(A, OWN)
    assert air_film(own, OWN) == {"laws": (radiation(own, OWN),), "effects": {}}
    coil = replace(OWN, pitch_mm=0.0)
    film = air_film(own, coil)
    law, radiates = film["laws"]
    assert law.place == "film"
    assert law.terms[0].coefficient == pytest.approx(pitch_factor(0.0, 0.5) - 1.0)
    assert radiates == radiation(own, coil)
    assert film["effects"]["convection_exponent"]["exponent"] > 0.0


def test_a_fan_blows_as_churchill_and_bernstein_say() -> None:
    own = scaled(A, OWN)
    blown, still = fan(own, 2.0)
    reynolds = 2.0 * 0.5e-3 / 15.89e-6
    prandtl = 15.89 / 22.5
    nusselt = 0.3 + 0.62 * reynolds**0.5 * prandtl ** (1 / 3) / (
        1.0 + (0.4 / prandtl) ** (2 / 3)
    ) ** (1 / 4) * (1.0 + (reynolds / 282e3) ** (5 / 8)) ** (4 / 5)
    lost = math.pi * 0.0263 * nusselt * wire_length(own)
    assert blown.terms[0].coefficient == pytest.approx(-lost, rel=1e-9)
    assert still.terms[0].coefficient == -1.0
    places = [(law.place, len(law.terms)) for law in air_film(own, OWN, air_m_per_s=2.0)["laws"]]
    assert places == [("heat_into_wire", 3), ("film", 1)]


def test_a_file_holds_a_geometry_and_its_base(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('base = "B"\nwire_mm = 0.5\ncoil_mm = 3.5\nturns = 12\npitch_mm = 1.0\n')
    base, geometry = load_geometry(path)
    assert base.digest() == load_parameters("B").digest()
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
