"""Names on both sides: outcomes, subsystems, and what the library calls each listed cause."""

from __future__ import annotations

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
    Outcome.CONTRADICTING: "contradicting",
}
"""Outcome of a diagnosis → outcome of a verdict file.

Refused runs support no answer either. That runs contradict each other is one: they are of different
states of the bench.
"""

SILENT = frozenset(("no_gap", "parameters_only", "not_enough_excitation"))
"""Outcomes that do not claim a structural gap."""

NAMING = frozenset(OUTCOMES[outcome] for outcome in NAMED)

_CAUSES: dict[str, tuple[str, ...]] = {
    "electrical": (
        "driver_gain", "driver_lag", "saturation", "resistivity", "contact_resistance",
    ),
    "sensors": (
        "rtd_lag", "rtd_stem_error", "rtd_offset", "channel_delay", "encoder_backlash",
        "encoder_slip", "force_offset", "force_gain", "force_creep",
    ),
    "thermal": (
        "water_drain", "air_bubbles", "pump_dead_time", "flow_shortfall", "reservoir_warming",
        "ambient_drift", "valve_leak", "cold_ends", "convection_exponent",
    ),
    "phase": ("minor_loop", "transformation_drift", "r_phase", "stress_latent_heat"),
    "mechanics": ("tube_friction", "viscous_drag", "tendon_compliance", "tube_stiffness"),
}  # fmt: skip
"""Subsystem of a bank → the causes that a key may name there."""

CAUSES = tuple(cause for causes in _CAUSES.values() for cause in causes)
"""The causes that a key may name, in the list of candidates' order."""

ALIASES = {
    "driver_saturation": "saturation",
    "phase_resistivity": "resistivity",
    "rtd_stem": "rtd_stem_error",
    "water_drainage": "water_drain",
    "air_pockets": "air_bubbles",
    "pump_lag": "pump_dead_time",
    "thermal_crosstalk": "valve_leak",
    "temperature_spread": "cold_ends",
    "cooling_front": "cold_ends",
    "unified_kinetics": "minor_loop",
    "transformation_fatigue": "transformation_drift",
    "stress_latent": "stress_latent_heat",
    "tendon_slack": "tendon_compliance",
}
"""Entry of this bench's library → listed cause, where they are called otherwise.

Where the library splits what the list has as one entry (cold ends, a spread of temperatures and a
cooling front), all of them are the same answer.
"""

SUBSYSTEM_ALIASES = {"actuator": "electrical", "timing": "sensors", "water": "thermal"}
"""Sub-model of the plant → subsystem of a bank, where they are called otherwise."""


def canonical(name: str) -> str:
    """The bank's name of a cause. Unlisted names stay as they are.

    >>> canonical("tendon_slack")
    'tendon_compliance'
    """
    return ALIASES.get(name, name)


def subsystem_of(name: str) -> str:
    """Subsystem of a listed cause, or an empty string for a name that is not listed."""
    return next((part for part, causes in _CAUSES.items() if name in causes), "")
