"""Water: the table against IAPWS-95, and how far the printed polynomials are off."""

import numpy as np
import pytest

from sim_device.plant import load_parameters
from sim_device.plant.setup import Setup
from sim_device.plant.water import interpolated, printed_water, real_water
from tests.sim_device.plant.cases import setup_of

PROPERTIES = {"rho": "D", "cp": "C", "k": "L", "mu": "V", "beta": "ISOBARIC_EXPANSION_COEFFICIENT"}


@pytest.mark.parametrize("name", PROPERTIES)
@pytest.mark.parametrize("T_K", [285.3, 300.0, 312.7, 341.9, 365.5])
def test_the_table_agrees_with_iapws_between_its_nodes(name, T_K):
    CoolProp = pytest.importorskip("CoolProp.CoolProp")
    exact = CoolProp.PropsSI(PROPERTIES[name], "T", T_K, "P", 101325, "Water")
    assert getattr(interpolated(real_water(), T_K), name)[0] == pytest.approx(exact, rel=6e-6)


def test_the_committed_table_is_what_the_script_makes():
    from sim_device.plant.make_water_table import rows

    water = real_water()
    held = np.column_stack([water.T_K, water.rho, water.cp, water.k, water.mu, water.beta])
    np.testing.assert_allclose(held, np.array(rows()), rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "errors"),
    [
        ("mu", (-16, -7, -10)),
        ("k", (-3, -5, -6)),
        ("prandtl", (38, 94, 148)),
        ("rho", (4, 5, 6)),
        ("beta", (6, 6, 4)),
    ],
)
def test_the_printed_polynomials_are_as_wrong_as_documented(name, errors):
    for T_K, percent in zip((300.0, 325.0, 350.0), errors, strict=True):
        printed = getattr(interpolated(printed_water(), T_K), name)[0]
        real = getattr(interpolated(real_water(), T_K), name)[0]
        assert 100 * (printed / real - 1) == pytest.approx(percent, abs=0.9)


@pytest.mark.parametrize("variant", ["extended", "printed"])
@pytest.mark.parametrize("flow", [0.0, 131.9e-9])
def test_the_kernel_film_coefficient_is_the_correlation_at_the_film_temperature(variant, flow):
    parameters = load_parameters("A")
    setup = setup_of(parameters, variant)
    T, T_water = 318.4, 303.1
    water = interpolated(
        real_water() if variant == "extended" else printed_water(), 0.5 * (T + T_water)
    )
    d, d_t = parameters["wire_diameter"], parameters["tube_diameter"]
    D = d_t - d
    nu, alpha, pr = water.nu[0], water.diffusivity[0], water.prandtl[0]
    Ra = 9.81 * water.beta[0] * (T - T_water) * D**3 / (nu * alpha)
    shape = (1 + ((0.559 if variant == "extended" else 0.56) / pr) ** (9 / 16)) ** (16 / 9)
    nusselt = (0.60 + 0.387 * (Ra / shape) ** (1 / 6)) ** 2
    if flow:
        u = flow / (np.pi * (d_t**2 - d**2) / 4)
        nusselt = max(nusselt, (0.255 + 0.699 * np.sqrt(u * D / nu)) * pr**0.29)
    expected = water.k[0] * nusselt / D * np.pi * d
    got = setup.film_W_per_m_K(T, T_water, flow / parameters["flow_max"])
    assert got == pytest.approx(expected, rel=5e-6)


def test_in_a_bath_the_film_has_the_diameter_of_the_wire_and_no_flow():
    parameters = load_parameters("A")
    setup = Setup.make(
        parameters, variant="extended", fixture="stretch", cooling="bath", effects={}
    )
    wire = parameters["wire_diameter"]
    water = interpolated(real_water(), 0.5 * (318.4 + 303.1))
    nu, alpha, pr = water.nu[0], water.diffusivity[0], water.prandtl[0]
    Ra = 9.81 * water.beta[0] * (318.4 - 303.1) * wire**3 / (nu * alpha)
    shape = (1 + (0.559 / pr) ** (9 / 16)) ** (16 / 9)
    expected = water.k[0] * np.pi * (0.60 + 0.387 * (Ra / shape) ** (1 / 6)) ** 2
    for duty in (0.0, 1.0):
        assert setup.film_W_per_m_K(318.4, 303.1, duty) == pytest.approx(expected, rel=5e-6)


def test_temperatures_beyond_the_table_are_refused():
    with pytest.raises(ValueError, match="280"):
        interpolated(real_water(), 270.0)
