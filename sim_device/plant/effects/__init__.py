"""The library of candidate effects: one registry entry each, used by plant, diagnosis and docs.

Every effect can be switched on alone or together; at zero strength the plant is bit-identical.
"""

from sim_device.plant.effects.parse import format_effects, parse_effects
from sim_device.plant.effects.record import Effect, EffectParameter, Prior
from sim_device.plant.effects.registry import (
    EFFECTS,
    check_needs,
    effect,
    effect_terms,
    resolve,
)

__all__ = [
    "EFFECTS",
    "Effect",
    "EffectParameter",
    "Prior",
    "check_needs",
    "effect",
    "effect_terms",
    "format_effects",
    "parse_effects",
    "resolve",
]
