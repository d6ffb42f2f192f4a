"""The constants of the inverse model from a parameter file, as the controller takes them."""

from sim_device.plant.parameters import ParameterSet
from sim_device.plant.units import ZERO_C
from smad.config import Config, ControlConfig, FeedforwardConfig, config_to_toml

WIRE_K = 313.0
ABOVE_WATER_K = 5.0
"""Where the film coefficients are taken: they vary by a fifth over the range of the actuator."""


def feedforward_of(parameters: ParameterSet, variant: str = "extended") -> FeedforwardConfig:
    """The section `[control.feedforward]` for these parameters, switched off.

    All per metre of wire. The film coefficients are those of the plant (Eqs (19)–(25)) at a wire of
    313 K, 5 K above its water. Raises ModelError for an unknown variant.
    """
    from sim_device.plant.setup import Setup

    setup = Setup.make(
        parameters, variant=variant, fixture="antagonistic", cooling="water", effects={}
    )
    p = setup.p
    full_flow = float(p.flow_max)

    def film(duty: float) -> float:
        return setup.film_W_per_m_K(WIRE_K, WIRE_K - ABOVE_WATER_K, duty)

    return FeedforwardConfig(
        wire_capacity_J_per_m_K=_rounded(p.capacity_heating),
        water_capacity_J_per_m_K=_rounded(p.water_capacity * p.warming_share),
        film_still_W_per_m_K=_rounded(film(0.0)),
        film_flow_W_per_m_K=_rounded(film(1.0)),
        flow_W_per_m_K=_rounded(p.flow_conductance * full_flow),
        loss_W_per_m_K=_rounded(p.tube_loss),
        heat_W_per_m_A2=_rounded(p.resistance_per_m),
        austenite_start_degC=_rounded(parameters["austenite_start"] - ZERO_C),
        slope_austenite_MPa_per_K=_rounded(parameters["slope_austenite"] * 1e-6),
        martensite_start_degC=_rounded(parameters["martensite_start"] - ZERO_C),
        slope_martensite_MPa_per_K=_rounded(parameters["slope_martensite"] * 1e-6),
        stress_start_MPa=_rounded(parameters["stress_start"] * 1e-6),
        stress_MPa_per_N=_rounded(p.C1 * 1e-6),
        inlet_degC=_rounded(parameters["water_temperature"] - ZERO_C),
        fill_time_s=_rounded(1.0 / (p.fill_rate * full_flow)),
        drain_time_s=_rounded(parameters["drain_time"]),
        drain_ratio=_rounded(parameters["drain_film"]),
    )


def feedforward_section(parameters: ParameterSet, variant: str) -> str:
    """The same as TOML."""
    control = ControlConfig(feedforward=feedforward_of(parameters, variant))
    head = "[control.feedforward]"
    text = config_to_toml(Config(control=control))
    return head + text.partition(head)[2].partition("\n[")[0] + "\n"


def _rounded(value: float) -> float:
    """Four digits: a configuration file is read by people."""
    return float(f"{float(value):.4g}")
