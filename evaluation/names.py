"""What the library of this bench calls the causes that banks list."""

from __future__ import annotations

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


def canonical(name: str) -> str:
    """The bank's name of a cause. Unlisted names stay as they are.

    >>> canonical("tendon_slack")
    'tendon_compliance'
    """
    return ALIASES.get(name, name)
