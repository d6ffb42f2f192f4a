"""The parameters that a parameter file has to hold: one row each, in one table.

The row fixes what no file may change: the symbol, the SI unit, the hard physical limits and what
the number is. Value, status, range and source are the file's.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Field:
    """One parameter: `low` and `high` are hard limits in SI that a file's own range must keep."""

    name: str
    symbol: str
    unit: str
    low: float
    high: float
    meaning: str


FIELDS: tuple[Field, ...] = (
    Field("wire_diameter", "d_s", "m", 1e-5, 5e-3, "diameter of the SMA wire"),
    Field("coil_diameter", "D_s", "m", 1e-4, 5e-2, "mean diameter of the spring's coils"),
    Field("tube_diameter", "d_t", "m", 1e-4, 2e-2, "inner diameter of the silicone tube"),
    Field("coils", "N", "1", 1, 200, "number of coils of one spring"),
    Field("modulus_martensite", "G_M", "Pa", 1e9, 4e10, "shear modulus of martensite"),
    Field("modulus_austenite", "G_A", "Pa", 1e9, 8e10, "shear modulus of austenite"),
    Field("stress_start", "τ_s", "Pa", 1e6, 5e8, "shear stress at which detwinning starts"),
    Field("stress_finish", "τ_f", "Pa", 1e6, 1e9, "shear stress at which detwinning is complete"),
    Field("max_deflection", "δ_L", "m", 1e-4, 0.3, "deflection of complete detwinning"),
    Field("austenite_start", "A_S", "K", 250, 400, "austenite start temperature, no stress"),
    Field("austenite_finish", "A_F", "K", 250, 420, "austenite finish temperature, no stress"),
    Field("martensite_start", "M_S", "K", 240, 400, "martensite start temperature, no stress"),
    Field("martensite_finish", "M_F", "K", 230, 400, "martensite finish temperature, no stress"),
    Field("slope_austenite", "C_A", "Pa/K", 1e5, 5e7, "stress slope of the austenite lines"),
    Field("slope_martensite", "C_M", "Pa/K", 1e5, 5e7, "stress slope of the martensite lines"),
    Field("initial_deflection", "δ0", "m", 0, 0.2, "deflection of each mounted spring at rest"),
    Field("initial_force", "F0", "N", 0, 50, "tension of the mounted pair at rest"),
    Field("density", "ρ_s", "kg/m3", 1e3, 2e4, "density of the wire"),
    Field("conductivity", "k_s", "W/(m K)", 1, 500, "thermal conductivity of the wire"),
    Field("heat_capacity_heating", "C_h", "J/(kg K)", 50, 2000, "heat capacity while heating"),
    Field("heat_capacity_cooling", "C_c", "J/(kg K)", 50, 2000, "heat capacity while cooling"),
    Field("latent_heating", "L_h", "J/kg", 0, 5e4, "latent heat taken up, martensite to austenite"),
    Field("latent_cooling", "L_c", "J/kg", 0, 5e4, "latent heat released, austenite to martensite"),
    Field("resistivity", "β_s", "Ohm m", 1e-8, 1e-5, "electrical resistivity of the wire"),
    Field("warming_share", "φ", "1", 0.01, 1, "share of the water in the tube that warms"),
    Field("tube_loss", "UA′", "W/(m K)", 0, 5, "loss from tube to ambient, per metre of wire"),
    Field("water_temperature", "T_w", "K", 274, 350, "temperature of the water at the inlet"),
    Field("ambient_temperature", "T_a", "K", 250, 350, "temperature of the surrounding air"),
    Field("air_conductivity", "k_a", "W/(m K)", 0.005, 0.1, "thermal conductivity of air"),
    Field("air_expansion", "β_a", "1/K", 1e-3, 1e-2, "volumetric expansion coefficient of air"),
    Field("air_viscosity", "ν_a", "m2/s", 1e-6, 1e-4, "kinematic viscosity of air"),
    Field("air_diffusivity", "α_a", "m2/s", 1e-6, 1e-4, "thermal diffusivity of air"),
    Field("flow_max", "Q_max", "m3/s", 0, 1e-5, "water flow through one tube at full pump duty"),
    Field("current_max", "I_max", "A", 0.1, 20, "largest current of the driver"),
    Field("robot_gain", "g_θ", "deg/m", -1e5, 1e5, "MINIR-II segment angle for a displacement"),
    Field("film_scale", "s_h", "1", 0.1, 10, "factor on the film coefficient of the water"),
    Field("drain_time", "t_d", "s", 0.01, 100, "time constant of purging the tube with air"),
    Field("drain_film", "w_f", "1", 0.01, 1, "share of the water that a purge leaves on the wire"),
    Field("work_share", "χ", "1", 0, 1, "share of the transformation work in the heat balance"),
    Field("supply_voltage", "V_s", "V", 1, 60, "supply of driver and pumps, no load"),
    Field("supply_resistance", "R_s", "Ohm", 0, 2, "source resistance of the supply"),
    Field("noise_temperature", "σ_T", "K difference", 0, 5, "noise of an RTD, standard deviation"),
    Field("noise_displacement", "σ_u", "m", 0, 1e-3, "noise of the encoder, standard deviation"),
    Field("noise_force", "σ_F", "N", 0, 0.5, "noise of the force sensor, standard deviation"),
    Field("noise_current", "σ_I", "A", 0, 0.5, "noise of a current sensor, standard deviation"),
    Field("noise_voltage", "σ_V", "V", 0, 0.5, "noise of a voltage sensor, standard deviation"),
)

# (smaller, larger): orderings between entries without which the equations have no meaning.
ORDERINGS: tuple[tuple[str, str], ...] = (
    ("austenite_start", "austenite_finish"),
    ("martensite_finish", "martensite_start"),
    ("stress_start", "stress_finish"),
    ("wire_diameter", "tube_diameter"),
    ("wire_diameter", "coil_diameter"),
    ("modulus_martensite", "modulus_austenite"),
)
