"""Magnitudes that mean the same in any functional form, so that intervals can be checked.

Each is one number about the effect on spring X, defined without reference to this plant's form.
"""

from collections.abc import Callable

from evaluation.plant.effects import Active

QUANTITIES: dict[str, tuple[str, Callable[[float], float]]] = {
    "driver_gain": ("relative excess of real over commanded current at 2 A", lambda e: e * 0.84),
    "driver_lag": ("mean delay of the current behind its command, s", lambda e: e),
    "contact_resistance": ("extra resistance at 2 A held, ohm", lambda e: e * 0.85),
    "rtd_lag": ("mean extra delay of the RTD in a ramp, s", lambda e: e * 1.35),
    "rtd_offset": ("reading minus truth at 37 °C, K", lambda e: e * 1.1),
    "channel_delay": ("mean delay of encoder and load cell, s", lambda e: e),
    "encoder_backlash": ("width of the play, mm", lambda e: e),
    "force_offset": ("reading minus truth after a minute, N", lambda e: e * 0.98),
    "force_gain": ("relative excess of the reading at 1.5 N", lambda e: e),
    "pump_dead_time": ("mean delay of the flow behind the duty, s", lambda e: e * 1.3),
    "flow_shortfall": ("relative loss of flow at full duty", lambda e: e),
    "transformation_drift": (
        "fall of the transformation temperatures after three full cycles, K",
        lambda e: e * 0.865,
    ),
}
"""Effect → (what the number is, its value from this plant's magnitude)."""


def true_quantity(active: Active) -> float | None:
    """The comparable magnitude of an effect, or None where its form has none."""
    if active.name not in QUANTITIES:
        return None
    return QUANTITIES[active.name][1](active.magnitude)
