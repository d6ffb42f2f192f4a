"""Names on both sides: outcomes, subsystems, and what a verdict may call each listed cause."""

from tests.withheld.plant.effects import BY_NAME

OUTCOMES = (
    "no_gap",
    "parameters_only",
    "effect",
    "ambiguous",
    "effect_plus_rest",
    "unknown",
    "not_enough_excitation",
)
SILENT = frozenset(("no_gap", "parameters_only", "not_enough_excitation"))
"""Outcomes that do not claim a structural gap."""

NAMING = frozenset(("effect", "ambiguous", "effect_plus_rest"))

SUBSYSTEMS = {
    "electrical": ("actuator", "driver", "electric", "electronics"),
    "sensors": ("sensor", "timing", "sensors_and_timing", "measurement"),
    "thermal": ("water", "heat", "thermal_and_water", "hydraulic"),
    "phase": ("hysteresis", "transformation", "material"),
    "mechanics": ("mechanical", "tendon"),
}

ALIASES: dict[str, tuple[str, ...]] = {
    "driver_gain": ("current_gain",),
    "driver_lag": ("current_lag",),
    "saturation": ("headroom", "driver_saturation", "current_saturation", "driver_headroom"),
    "resistivity": (
        "phase_resistivity",
        "temperature_resistivity",
        "phase_and_temperature_resistivity",
        "resistance_change",
    ),
    "contact_resistance": ("lead_resistance",),
    "rtd_lag": ("sensor_lag",),
    "rtd_stem_error": ("stem_error", "rtd_stem", "rtd_stem_conduction"),
    "rtd_offset": (),
    "channel_delay": ("sensor_delay", "displacement_delay", "encoder_delay"),
    "encoder_backlash": ("backlash",),
    "encoder_slip": ("slip",),
    "force_offset": ("load_cell_offset",),
    "force_gain": ("load_cell_gain",),
    "force_creep": ("load_cell_creep",),
    "water_drain": ("residual_water_film", "water_film", "residual_water", "film_drain", "drain"),
    "air_bubbles": ("bubbles", "air_pockets"),
    "pump_dead_time": ("pump_spin_up", "pump_delay", "pump_lag"),
    "flow_shortfall": ("low_flow", "flow_loss"),
    "reservoir_warming": ("inlet_warming",),
    "ambient_drift": ("draught",),
    "valve_leak": ("cross_talk", "crosstalk", "leaking_valve", "thermal_crosstalk"),
    "cold_ends": ("non_uniform_temperature", "nonuniform_temperature"),
    "convection_exponent": ("convection_law",),
    "minor_loop": ("minor_loop_law", "hysteresis_law"),
    "transformation_drift": ("fatigue", "functional_fatigue"),
    "r_phase": (),
    "stress_latent_heat": ("stress_dependent_latent_heat", "latent_heat_stress"),
    "tube_friction": ("friction", "coulomb_friction", "dry_friction"),
    "viscous_drag": ("drag", "viscous_friction"),
    "tendon_compliance": ("tendon_slack", "slack", "compliance"),
    "tube_stiffness": ("parallel_stiffness", "tube_parallel_stiffness"),
}
"""Listed cause → further names under which a library may carry the same entry."""


def canonical(name: str, extra: dict[str, str] | None = None) -> str:
    """The bank's name of a cause; `extra` maps a tool's own names. Unlisted names stay as they are.

    >>> canonical("Tendon slack")
    'tendon_compliance'
    """
    plain = name.strip().lower().replace("-", "_").replace(" ", "_")
    if extra and plain in extra:
        plain = extra[plain]
    for known, others in ALIASES.items():
        if plain == known or plain in others:
            return known
    return plain


def canonical_subsystem(name: str) -> str:
    """The bank's name of a subsystem."""
    plain = name.strip().lower().replace("-", "_").replace(" ", "_")
    for known, others in SUBSYSTEMS.items():
        if plain == known or plain in others:
            return known
    return plain


def subsystem_of(name: str) -> str:
    """Subsystem of a cause by the bank's table, or an empty string for a name not in it."""
    return BY_NAME[name].subsystem if name in BY_NAME else ""
