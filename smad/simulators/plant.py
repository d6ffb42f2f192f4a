"""A declared simulator with its runs, as a plant of the diagnosis, and its places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from smad.diagnosis.places.bare import BarePlaces
from smad.diagnosis.places.place import Place
from smad.diagnosis.plant import Array, Channel, Mask, ModelPoint, Signal, Uncertainty
from smad.diagnosis.runs import GapRun
from smad.simulators.calling import called
from smad.simulators.declare import Simulator, value_name
from smad.simulators.errors import LostProcessError
from smad.simulators.replayed import ReplayedPlant
from smad.simulators.saving import save_values
from smad.simulators.starts import Window
from smad.simulators.transducers import effects_of, transduced

_STILL = 0.02
_RUNAWAY = 1e3
"""Times a channel's range beyond which a simulator has exploded."""


class SimulatedPlant(ReplayedPlant):
    """A declared function, replayed on the runs as they were recorded.

    Each run is replayed in windows of `window_s` that begin from its readings; 0: from its start
    to its end. A point at which the function fails, or runs away, predicts NaN. As many threads as
    there are `processes` are of use.
    """

    most_replays = 128

    def __init__(
        self,
        declared: Simulator,
        inputs: Sequence[Signal],
        channels: Sequence[Channel],
        *,
        lag_s: float,
        shortest_s: float,
    ) -> None:
        self.declared = declared
        self._signals = tuple(c.name for c in channels)
        effects = [replace(e, signals=e.signals or self._signals) for e in declared.effects]
        if declared.transducers:
            drives = [s for s in inputs if s.name not in declared.forces]
            effects += effects_of(
                channels, drives, lag_s, acts_at=declared.acts_at, saturation=True
            )
        super().__init__(
            name=declared.name,
            version=declared.version,
            inputs=inputs,
            channels=channels,
            parameters=declared.parameters,
            effects=effects,
            shortest_s=shortest_s,
        )
        self._largest = {s.name: max(abs(s.low), abs(s.high)) for s in inputs}

    def _driven(self, point: ModelPoint, run: GapRun, whole: GapRun) -> dict[str, Array]:
        """What the function is given: inputs as recorded, with what was added, as drives make it.

        A thinned run may have been pushed: what its inputs have beyond the means holds over the
        samples that each stands for.
        """
        driven: dict[str, Array] = {}
        signals = {s.name for s in self.inputs}
        size = run.pieces.astype(np.intp)
        for name, column in whole.inputs.items():
            values = np.asarray(column, dtype=np.float64)
            if name in signals:
                if run.whole is not None:
                    pushed = np.asarray(run.inputs[name], dtype=np.float64)
                    more = pushed - self._means(run, values)
                    if np.any(np.abs(more) > 1e-12 * self._largest[name]):
                        values = values + np.repeat(more, size)
                values = transduced(values, point.effects, name, whole.t_s, self._largest[name])
            driven[name] = values
        return driven

    def _course(self, point: ModelPoint, run: GapRun, moved: str) -> tuple[Array, dict[str, Array]]:
        whole = run.as_recorded
        driven = self._driven(point, run, whole)
        values = self.declared.values(point.theta, point.effects)
        key = (
            (id(whole.t_s), id(whole.outputs), self.window_s, moved),
            tuple(values.values()),
            *(hash(driven[n].tobytes()) for n in sorted(driven)),
        )
        course = self._remembered(key, lambda: self._replayed(values, whole, driven, moved))
        return whole.t_s, course

    def _replayed(
        self, values: Mapping[str, float], whole: GapRun, driven: Mapping[str, Array], moved: str
    ) -> dict[str, Array]:
        self.failures.replays += 1
        try:
            windows = [w.moved(moved) for w in self.windows(whole)]
            parts = [
                (whole.t_s[a:b], {n: v[a:b] for n, v in driven.items()}, dict(start))
                for a, b, start, _ in windows
            ]
            played = self._play(dict(values), parts)
            out = {n: np.concatenate([part[n] for part in played]) for n in self._signals}
            away = [c.name for c in self.channels if not _bounded(c, out[c.name])]
            why = f"{away[0]} runs away" if away else ""
        except LostProcessError:
            raise
        except Exception as error:  # whatever somebody else's function does at some point
            why = f"{type(error).__name__}: {error}"
        self.failures.count(self._present(values), failed=bool(why))
        if not why:
            return out
        words = ", ".join(f"{n} = {v:.4g}" for n, v in values.items() if v)
        self.failures.add(f"{why} at {words}")
        return {n: np.full(len(whole.t_s), np.nan) for n in self._signals}

    def _present(self, values: Mapping[str, float]) -> list[str]:
        """The declared effects that a replay with these values has."""
        return [
            e.name
            for e in self.declared.effects
            if any(values[value_name(e, q)] for q in e.parameters if q.strength)
        ]

    def play(
        self,
        values: Mapping[str, float],
        parts: Sequence[tuple[Array, Mapping[str, Array], Mapping[str, float]]],
    ) -> list[dict[str, Array]]:
        """What the function shows of the channels of each part of a run: times, inputs, start."""
        played = [called(self.declared, t_s, inputs, values, start) for t_s, inputs, start in parts]
        return [{n: y[n] for n in self._signals} for y in played]

    def windows(self, run: GapRun) -> list[Window]:
        """Those of the whole run."""
        return self._windows.of(run.as_recorded, self.window_s)

    def seams(self, run: GapRun) -> list[int]:
        """The samples of a run, thinned or not, at which a window begins."""
        whole = run.as_recorded
        starts = [whole.t_s[a] for a, *_ in self.windows(whole)]
        return sorted({int(np.searchsorted(run.t_s, t)) for t in starts} | {0})

    def _means(self, run: GapRun, y: Array) -> Array:
        size = run.pieces
        starts = np.r_[0, np.cumsum(size)[:-1]].astype(np.intp)
        return np.asarray(np.add.reduceat(y, starts) / size)

    def _at_rest(self, run: GapRun) -> Mask:
        """At no time where something that is measured moves before an input does."""
        rest = super()._at_rest(run)
        for column in run.outputs.values():
            still = np.ptp(column[rest]) if rest.any() else 0.0
            if still > _STILL * float(np.ptp(column)):
                rest = np.zeros(len(run.t_s), dtype=bool)
        return rest


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


def _bounded(c: Channel, y: Array) -> bool:
    most = _RUNAWAY * max(c.high - c.low, abs(c.low), abs(c.high))
    return bool(np.all(np.abs(y) < most))
