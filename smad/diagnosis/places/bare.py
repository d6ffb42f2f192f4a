"""Places of a plant that offers none: its readings and its inputs.

A law at a reading adds to a channel, one at an input to what the plant is given. Its states are
those of any plant: inputs, predicted channels, their rates, and time.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, Protocol, runtime_checkable

import numpy as np

from sim_device.plant import Law
from smad.diagnosis.places.place import BOTH, Forceable, Forcing, Place, PlacesPlant, law_series
from smad.diagnosis.plant import Array, ModelPoint, PlantModel
from smad.diagnosis.runs import GapRun

READING, INPUT = "reading_", "input_"
_PASSES = 4
"""Most replays of the fixed-point iteration between laws of inputs and their states."""
_AGREED = 1e-3
"""Relative residual at which that iteration has converged."""


def with_places(plant: PlantModel) -> PlacesPlant:
    """The plant itself if it can be forced, else the plant in `BarePlaces`."""
    return plant if isinstance(plant, Forceable) else BarePlaces(plant)


def unwrapped(plant: PlantModel) -> PlantModel:
    """The plant inside `BarePlaces`, or the plant itself.

    Optional protocols are looked up on it: from Python 3.12 on `isinstance` does not see methods
    that `__getattr__` finds.
    """
    return plant.plain if isinstance(plant, BarePlaces) else plant


@runtime_checkable
class InWindows(Protocol):
    """A plant that is replayed in windows, each of which starts from the readings."""

    def seams(self, run: GapRun) -> Sequence[int]:
        """The samples of a run, thinned or not, at which a window begins; 0 is the first."""
        ...

    def begun_otherwise(self, point: ModelPoint, run: GapRun) -> Iterable[dict[str, Array]]:
        """Replays in which one reading or rate that a window starts from is off by a standard
        deviation, one for each of these in turn."""
        ...


class BarePlaces:
    """A `PlantModel` with its readings and inputs as places; everything else is the plant's own.

    Laws of a model point act in `simulate`. Laws of inputs depend on the states that they change,
    so the replay is repeated until both agree.
    """

    def __init__(self, plant: PlantModel) -> None:
        self.plain = plant

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plain, name)

    @cached_property
    def places(self) -> Sequence[Place]:
        """One for each channel, and one for each input."""
        channels = [c.name for c in self.plain.channels]
        states = [s.name for s in self.plain.inputs] + channels
        states += [*(f"{name}_rate" for name in channels), "time"]
        place = partial(Place, sides=(BOTH,), states=tuple(states))
        readings = [
            place(
                name=f"{READING}{c.name}",
                label=f"reading of {c.name}",
                unit=c.unit,
                scale=max(c.quantum, c.noise, 1e-3 * (c.high - c.low)),
                reading=True,
            )
            for c in self.plain.channels
        ]
        inputs = [
            place(
                name=f"{INPUT}{s.name}",
                label=f"input {s.name}",
                unit=s.unit,
                scale=0.03 * (s.high - s.low),
            )
            for s in self.plain.inputs
        ]
        return (*readings, *inputs)

    def state_words(self, place: str, state: str) -> tuple[str, str]:
        """See `Forceable`."""
        units = {s.name: s.unit for s in self.plain.inputs}
        units |= {c.name: c.unit for c in self.plain.channels}
        units |= {f"{c.name}_rate": f"{c.unit}/s" for c in self.plain.channels}
        words = f"rate of {state.removesuffix('_rate')}" if state.endswith("_rate") else state
        return words, units.get(state, "s")

    def seen(self, place: str, side: str, states: Mapping[str, Array]) -> dict[str, Array]:
        """See `Forceable`: every place sees everything."""
        return dict(states)

    def trajectory(self, point: ModelPoint, run: GapRun, *, fast: bool = False) -> dict[str, Array]:
        """See `Forceable`."""
        return self._states(run, self.simulate(point, run, fast=fast))

    def forced(
        self, point: ModelPoint, run: GapRun, forcing: Forcing, *, fast: bool = False
    ) -> dict[str, Array]:
        """See `Forceable`."""
        pushed = {n.removeprefix(INPUT): f for (n, _), f in forcing.items() if n.startswith(INPUT)}
        out = self.simulate(point, _pushed(run, pushed), fast=fast)
        for (name, _), series in forcing.items():
            if name.startswith(READING):
                channel = name.removeprefix(READING)
                out[channel] = out[channel] + series
        return out

    def simulate(self, point: ModelPoint, run: GapRun, *, fast: bool = False) -> dict[str, Array]:
        """See `PlantModel`; laws of the point are in force."""
        bare = replace(point, laws=())
        out = dict(self.plain.simulate(bare, run, fast=fast))
        if not point.laws:
            return out
        inputs = [law for law in point.laws if law.place.startswith(INPUT)]
        if inputs:
            out = self._agreed(bare, run, out, inputs, fast=fast)
        states = self._states(run, out)
        for law in point.laws:
            if law.place.startswith(READING):
                channel = law.place.removeprefix(READING)
                out[channel] = out[channel] + law_series(self, law, states, run.t_s)
        return out

    def _agreed(
        self,
        point: ModelPoint,
        run: GapRun,
        out: dict[str, Array],
        laws: Sequence[Law],
        *,
        fast: bool,
    ) -> dict[str, Array]:
        """The replay in which laws of inputs agree best with the states that they depend on.

        Plain repetition need not converge for a law of a state that it changes itself, such as a
        drag: the iteration is Anderson's.
        """
        names = sorted({law.place.removeprefix(INPUT) for law in laws})

        def series(replay: Mapping[str, Array]) -> Array:
            states, more = self._states(run, replay), dict.fromkeys(names, np.zeros(len(run.t_s)))
            for law in laws:
                name = law.place.removeprefix(INPUT)
                more[name] = more[name] + law_series(self, law, states, run.t_s)
            return np.concatenate([more[n] for n in names])

        # The measured states are the best start for a right law.
        pushed = series(_measured(run, out))
        first = series(out)
        images, residuals = [first], [first]
        best, least = out, float(np.linalg.norm(first))
        if not np.isfinite(least):
            return best
        for _ in range(_PASSES):
            parts = np.split(pushed, len(names))
            moved = _pushed(run, dict(zip(names, parts, strict=True)))
            replay = dict(self.plain.simulate(point, moved, fast=fast))
            image = series(replay)
            if not np.isfinite(image).all():
                return best
            residual = image - pushed
            size = float(np.linalg.norm(residual))
            if size < least:
                best, least = replay, size
            if size <= _AGREED * float(np.linalg.norm(image)):
                break
            images.append(image)
            residuals.append(residual)
            pushed = _mixed(images, residuals)
        return best

    def _states(self, run: GapRun, replay: Mapping[str, Array]) -> dict[str, Array]:
        """Inputs, channels, their rates by central differences, and time.

        Rates are not taken across the seams of a plant that is replayed in windows. What has become
        infinite has none.
        """
        out = {s.name: np.asarray(run.inputs[s.name], float) for s in self.plain.inputs}
        seams = self.plain.seams(run) if isinstance(self.plain, InWindows) else [0]
        edges = [*seams, len(run.t_s)]
        for c in self.plain.channels:
            out[c.name] = replay[c.name]
            rate = np.zeros(len(run.t_s))
            course = np.where(np.isfinite(replay[c.name]), replay[c.name], np.nan)
            for a, b in pairwise(edges):
                if b - a > 1:
                    rate[a:b] = np.gradient(course[a:b], run.t_s[a:b])
            out[f"{c.name}_rate"] = rate
        return out | {"time": run.t_s - run.t_s[0]}


def _mixed(images: Sequence[Array], residuals: Sequence[Array]) -> Array:
    """The next series by Anderson's mixing (1965): the combination of images, with weights that sum
    to 1, whose residual is least."""
    steps = np.array([residuals[-1] - r for r in residuals[:-1]])
    weights = np.linalg.lstsq(steps.T, residuals[-1], rcond=None)[0]
    back = np.array([images[-1] - x for x in images[:-1]])
    return np.asarray(images[-1] - weights @ back)


def _measured(run: GapRun, replay: Mapping[str, Array]) -> dict[str, Array]:
    """The measured channels; predicted where one was not measured throughout."""
    return {
        n: y if np.isfinite(y := run.outputs.get(n, replay[n])).all() else replay[n] for n in replay
    }


def _pushed(run: GapRun, more: Mapping[str, Array]) -> GapRun:
    """The run with series (n,) added to its inputs."""
    if not more:
        return run
    return run.with_columns(inputs={n: np.asarray(run.inputs[n]) + x for n, x in more.items()})
