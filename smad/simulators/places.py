"""Places of a simulator: its readings, its inputs, and the forces that it can be given inside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from smad.diagnosis.places.bare import BarePlaces
from smad.diagnosis.places.place import Place
from smad.diagnosis.plant import Array, ModelPoint, Uncertainty
from smad.diagnosis.runs import GapRun
from smad.simulators.plant import SimulatedPlant
from smad.simulators.saving import save_values


class SimulatorPlaces(BarePlaces):
    """A simulated plant that can be forced; see `Forceable`.

    An input that is felt through a force has no place beside that of the force: nothing could tell
    the two apart.
    """

    plain: SimulatedPlant

    @cached_property
    def places(self) -> Sequence[Place]:
        """Readings, inputs and forces, with the observed columns among their states."""
        of = self.plain.declared
        felt = {f"input_{name}" for name in of.felt_at}
        offered = []
        for place in super().places:
            if place.name not in felt:
                label = of.labels.get(place.name.removeprefix("input_"), place.label)
                states = tuple(s for s in place.states if s not in of.forces)
                offered.append(replace(place, label=label, states=(*states, *of.observed)))
        return tuple(offered)

    def state_words(self, place: str, state: str) -> tuple[str, str]:
        """See `Forceable`."""
        if state in self.plain.declared.observed:
            return state, self.plain.declared.unit(state)
        return super().state_words(place, state)

    def _states(self, run: GapRun, replay: Mapping[str, Array]) -> dict[str, Array]:
        """Those of a bare plant, and the observed columns."""
        observed = self.plain.declared.observed
        return super()._states(run, replay) | {
            n: np.asarray(run.inputs[n], float) for n in observed
        }

    def save_model(
        self, point: ModelPoint, path: Path, note: str, uncertainty: Uncertainty | None = None
    ) -> None:
        """See `SavesModel`."""
        of = self.plain.declared
        if of.save is None:
            save_values(of, point, path, note, uncertainty)
        else:
            of.save(point, path, note, uncertainty)
