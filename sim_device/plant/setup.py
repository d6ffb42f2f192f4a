"""One place where a parameter set, options and effects become what the kernel takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from sim_device.plant import kernel as k
from sim_device.plant.constants import (
    apply_warming,
    kernel_constants,
    mounting,
)
from sim_device.plant.effects.registry import (
    EffectValues,
    Resolved,
    check_needs,
    effect_terms,
    resolve,
)
from sim_device.plant.errors import InputError
from sim_device.plant.laws import Law, law_table
from sim_device.plant.parameters import ParameterSet
from sim_device.plant.places import check_place_needs
from sim_device.plant.start import AS_MOUNTED, Start, within_reach
from sim_device.plant.water import film_table

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Setup:
    """What the kernel takes: `model`, an array of one record, the film table, and laws as a table.

    `effects` are those as resolved. `late`: some channel is read late. `latest_rest` is the latest
    state at rest, by temperature and start. The arrays must not be changed.
    """

    parameters: ParameterSet
    effects: Resolved
    fixture: str
    cooling: str
    model: Any
    table: Array
    late: bool
    laws: Array
    options: Mapping[str, str]
    latest_rest: dict[tuple[float | None, Start], Any] = field(
        default_factory=dict, repr=False, compare=False
    )

    @classmethod
    def make(
        cls,
        parameters: ParameterSet,
        *,
        variant: str,
        fixture: str,
        cooling: str,
        effects: EffectValues,
        laws: Sequence[Law] = (),
    ) -> Setup:
        """Raises ModelError for an unknown option, EffectError and InputError for a refused effect
        or law.
        """
        options = {"variant": variant, "fixture": fixture, "cooling": cooling}
        constants = kernel_constants(parameters, **options)
        resolved = resolve(effects)
        check_needs(resolved, options)
        terms_x, terms_y = effect_terms(resolved)
        apply_warming(constants, terms_x)
        model = k.zeros(k.Model)
        row = k.numbers(model)
        k.fill(row, k.Model, "p", constants)
        if resolved:
            k.fill(row, k.Model, "x", terms_x)
            k.fill(row, k.Model, "y", terms_y)
        if terms_x["unified"] > 0.0:
            k.lay_curves(model)
        late = terms_x["late"] > 0.0
        for law in laws:
            check_place_needs(law.place, options)
        table = film_table(variant)
        terms = law_table(laws)
        return cls(parameters, resolved, fixture, cooling, model, table, late, terms, options)

    @property
    def p(self) -> k.Constants:
        """Constants of the plant."""
        constants: k.Constants = self.model[0].p
        return constants

    @property
    def e(self) -> k.Effects:
        """Terms of the effects, as far as the sides share them, and those of side X."""
        terms: k.Effects = self.model[0].x
        return terms

    @property
    def reads_x(self) -> float:
        """X's share of what the force sensor reads, beyond one half."""
        return float(self.e.reads_x)

    def film_W_per_m_K(self, wire_K: float, water_K: float, duty: float) -> float:
        """Conductance from a metre of wire to its water, Eqs (19)-(25), at a duty of the pump."""
        speed = duty * float(self.p.flow_max * self.p.per_annulus)
        return float(k.film_conductance_of(self.model, wire_K, water_K, speed, self.table))

    def memory(self) -> Array:
        """What the terms of the laws remember, before they have seen anything."""
        return np.zeros((len(self.laws), k.MEMORY_COLUMNS))

    def ring(self) -> Array:
        """Room for the history of the samples, as much as late channels need."""
        return np.zeros((k.RING_ROWS if self.late else 1, k.RING_COLUMNS))

    def state(self, temperature_K: float | None = None, start: Start = AS_MOUNTED) -> Any:
        """A fresh state at rest, an array of one record, sensors included."""
        if start != AS_MOUNTED and self.fixture != "antagonistic":
            raise InputError("a start other than as mounted needs the antagonistic pair")
        key = temperature_K, start
        state = self.latest_rest.get(key)
        if state is None:
            state = k.zeros(k.State)
            mount = mounting(
                self.parameters,
                fixture=self.fixture,
                cooling=self.cooling,
                temperature_K=temperature_K,
                start=within_reach(self.parameters, start),
            )
            k.rest(state, self.model, k.filled(k.Mounting, mount), self.ring())
            # Replays of one run after another begin alike.
            self.latest_rest.clear()
            self.latest_rest[key] = state
        return k.copied(state)
