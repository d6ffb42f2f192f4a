"""One place where a parameter set, options and effects become what the kernel takes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from sim_device.plant import kernel as k
from sim_device.plant.constants import apply_warming, initial_state, kernel_constants, table_of
from sim_device.plant.effects.registry import (
    EffectValues,
    Resolved,
    check_needs,
    effect_vector,
    resolve,
)
from sim_device.plant.parameters import ParameterSet

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Setup:
    """Arrays for the kernel: constants `p`, effects `e`, film table; effects as resolved.

    `latest_rest` is the latest state at rest, by its temperature. The arrays must not be changed.
    """

    parameters: ParameterSet
    effects: Resolved
    p: Array
    e: Array
    table: Array
    latest_rest: dict[float | None, Array] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def make(
        cls,
        parameters: ParameterSet,
        *,
        variant: str,
        fixture: str,
        cooling: str,
        effects: EffectValues,
    ) -> Setup:
        """Raises ModelError for an unknown option and EffectError for a refused effect."""
        p = kernel_constants(parameters, variant=variant, fixture=fixture, cooling=cooling)
        resolved = resolve(effects)
        check_needs(resolved, {"variant": variant, "fixture": fixture, "cooling": cooling})
        e = effect_vector(resolved)
        apply_warming(p, e)
        if e[k.E_UNIFIED] > 0.0:
            e = np.concatenate([e, np.zeros(k.UNIFIED_SIZE - k.SIDES_SIZE)])
            k.lay_curves(p, e)
        return cls(parameters, resolved, p, e, table_of(variant))

    @property
    def reads_x(self) -> float:
        """X's share of what the force sensor reads, beyond one half."""
        return float(self.e[k.E_READS_X])

    def film_W_per_m_K(self, wire_K: float, water_K: float, duty: float) -> float:
        """Conductance from a metre of wire to its water, Eqs (19)-(25), at a duty of the pump."""
        speed = duty * float(self.p[k.P_FLOW_MAX] * self.p[k.P_AREA_INV])
        return float(k.film(wire_K, water_K, speed, self.p, self.table))

    def state(self, temperature_K: float | None = None) -> Array:
        """A fresh state at rest, sensors included."""
        known = self.latest_rest.get(temperature_K)
        if known is None:
            known = initial_state(self.parameters, self.p, self.e, temperature_K)
            k.wake(known, self.p, self.e, np.zeros((k.RING_ROWS, k.RING_COLUMNS)))
            known[k.SHARED + k.G_SAMPLES] = 0.0
            # Replays of one run after another begin at the same temperature.
            self.latest_rest.clear()
            self.latest_rest[temperature_K] = known
        return known.copy()
