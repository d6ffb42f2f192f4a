"""Names on both sides: outcomes, subsystems, and what a verdict may call each listed cause."""

from __future__ import annotations

from collections.abc import Mapping

from smad.gap.records import NAMED, Outcome

OUTCOMES: dict[Outcome, str] = {
    Outcome.NO_GAP: "no_gap",
    Outcome.PARAMETERS: "parameters_only",
    Outcome.EFFECT: "effect",
    Outcome.AMBIGUOUS: "ambiguous",
    Outcome.PLUS_REST: "effect_plus_rest",
    Outcome.UNKNOWN: "unknown",
    Outcome.NO_EXCITATION: "not_enough_excitation",
    Outcome.REFUSED: "not_enough_excitation",
}
"""Outcome of a diagnosis → outcome of a verdict file. Refused runs support no answer either."""

SILENT = frozenset(("no_gap", "parameters_only", "not_enough_excitation"))
"""Outcomes that do not claim a structural gap."""

NAMING = frozenset(OUTCOMES[outcome] for outcome in NAMED)

SUBSYSTEMS: dict[str, tuple[str, ...]] = {
    "electrical": ("actuator", "driver", "electric", "electronics"),
    "sensors": ("sensor", "timing", "sensors_and_timing", "measurement"),
    "thermal": ("water", "heat", "thermal_and_water", "hydraulic"),
    "phase": ("hysteresis", "transformation", "material"),
    "mechanics": ("mechanical", "tendon"),
}
"""Subsystem of a bank → other words for it."""

# Cause -> its subsystem, and further names under which a library may carry the same entry.
_LISTED: dict[str, tuple[str, tuple[str, ...]]] = {
    "driver_gain": ("electrical", ("current_gain",)),
    "driver_lag": ("electrical", ("current_lag",)),
    "saturation": (
        "electrical",
        ("headroom", "driver_saturation", "current_saturation", "driver_headroom"),
    ),
    "resistivity": (
        "electrical",
        (
            "phase_resistivity",
            "temperature_resistivity",
            "phase_and_temperature_resistivity",
            "resistance_change",
        ),
    ),
    "contact_resistance": ("electrical", ("lead_resistance",)),
    "rtd_lag": ("sensors", ("sensor_lag",)),
    "rtd_stem_error": ("sensors", ("stem_error", "rtd_stem", "rtd_stem_conduction")),
    "rtd_offset": ("sensors", ()),
    "channel_delay": ("sensors", ("sensor_delay", "displacement_delay", "encoder_delay")),
    "encoder_backlash": ("sensors", ("backlash",)),
    "encoder_slip": ("sensors", ("slip",)),
    "force_offset": ("sensors", ("load_cell_offset",)),
    "force_gain": ("sensors", ("load_cell_gain",)),
    "force_creep": ("sensors", ("load_cell_creep",)),
    "water_drain": (
        "thermal",
        (
            "residual_water_film",
            "water_film",
            "residual_water",
            "film_drain",
            "drain",
            "water_drainage",
        ),
    ),
    "air_bubbles": ("thermal", ("bubbles", "air_pockets")),
    "pump_dead_time": ("thermal", ("pump_spin_up", "pump_delay", "pump_lag")),
    "flow_shortfall": ("thermal", ("low_flow", "flow_loss")),
    "reservoir_warming": ("thermal", ("inlet_warming",)),
    "ambient_drift": ("thermal", ("draught",)),
    "valve_leak": ("thermal", ("cross_talk", "crosstalk", "leaking_valve", "thermal_crosstalk")),
    "cold_ends": (
        "thermal",
        (
            "non_uniform_temperature",
            "nonuniform_temperature",
            "temperature_spread",
            "cooling_front",
        ),
    ),
    "convection_exponent": ("thermal", ("convection_law",)),
    "minor_loop": ("phase", ("minor_loop_law", "hysteresis_law", "unified_kinetics")),
    "transformation_drift": (
        "phase",
        ("fatigue", "functional_fatigue", "transformation_fatigue"),
    ),
    "r_phase": ("phase", ()),
    "stress_latent_heat": (
        "phase",
        ("stress_dependent_latent_heat", "latent_heat_stress", "stress_latent"),
    ),
    "tube_friction": ("mechanics", ("friction", "coulomb_friction", "dry_friction")),
    "viscous_drag": ("mechanics", ("drag", "viscous_friction")),
    "tendon_compliance": ("mechanics", ("tendon_slack", "slack", "compliance")),
    "tube_stiffness": ("mechanics", ("parallel_stiffness", "tube_parallel_stiffness")),
}

CAUSES = tuple(_LISTED)
"""The causes that a key may name, in the list of candidates' order."""

ALIASES = {alias: name for name, (_, others) in _LISTED.items() for alias in others}
"""Other name → listed cause. The library of this bench is covered by it; a test holds it to that.

Where the library splits what the list has as one entry (cold ends, a spread of temperatures and a
cooling front; thermal cross-talk and a leaking valve; slack and compliance; two ways in which a
hysteresis may differ), all of them are the same answer.
"""


def plain(name: str) -> str:
    """A name as it is compared: lower case, words joined by underscores."""
    return name.strip().lower().replace("-", "_").replace(" ", "_")


def canonical(name: str, extra: Mapping[str, str] | None = None) -> str:
    """The bank's name of a cause. Unlisted names stay as they are.

    `extra` maps a tool's own names, each as `plain` gives it.

    >>> canonical("Tendon slack")
    'tendon_compliance'
    """
    said = plain(name)
    said = plain((extra or {}).get(said, said))
    return ALIASES.get(said, said)


def canonical_subsystem(name: str) -> str:
    """The bank's name of a subsystem."""
    said = plain(name)
    for known, others in SUBSYSTEMS.items():
        if said == known or said in others:
            return known
    return said


def subsystem_of(name: str) -> str:
    """Subsystem of a listed cause, or an empty string for a name that is not listed."""
    return _LISTED[name][0] if name in _LISTED else ""
