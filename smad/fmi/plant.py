"""A unit of FMI as a plant of the diagnosis: a map says what its variables are."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from smad.diagnosis.places.bare import INPUT
from smad.diagnosis.plant import (
    Array,
    Channel,
    Effect,
    EffectParameter,
    ModelPoint,
    Parameter,
    Signal,
)
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair.signals import means_over_pieces
from smad.fmi.errors import FmiError
from smad.fmi.map_file import Map, ParameterRow, require_fit
from smad.fmi.running import Fed, Runner
from smad.fmi.unit_file import UnitFile
from smad.simulators.replayed import ReplayedPlant
from smad.simulators.starts import Window
from smad.simulators.transducers import effects_of, transduced


class FmuPlant(ReplayedPlant):
    """A unit. Its effects: errors of each reading and each drive, and the map's terms.

    Raises FmiError for a map that does not fit the unit. The unit runs once at a time, in each of
    its `processes` if it has some.
    """

    most_replays = 64
    one_at_a_time = True

    def __init__(self, unit: UnitFile, mapped: Map) -> None:
        require_fit(mapped, unit)
        self._map = mapped
        inputs = [Signal(n, r.unit, r.low, r.high) for n, r in mapped.inputs.items()]
        channels = [
            Channel(name=n, unit=r.unit, quantum=r.quantum, low=r.low, high=r.high, noise=r.noise)
            for n, r in mapped.channels.items()
        ]
        super().__init__(
            name=mapped.name or unit.described.modelName,
            version=str(unit.described.guid),
            inputs=inputs,
            channels=channels,
            parameters=[_parameter(n, r, unit) for n, r in mapped.parameters.items()],
            effects=[*effects_of(channels, inputs, mapped.lag_s, delay=False), *_terms(mapped)],
            shortest_s=mapped.shortest_s,
            window_s=mapped.window_s or 0.0,
        )
        driven = (*mapped.inputs.values(), *mapped.terms.values())
        self._rows = list(dict.fromkeys(r.variable for r in driven))
        """The unit's variables that are driven, each once."""
        self._runner = Runner(unit, self._rows, [c.variable for c in mapped.channels.values()])
        self._starts_anew = False

    def _course(self, point: ModelPoint, run: GapRun, moved: str) -> tuple[Array, dict[str, Array]]:
        theta = {p.name: p.nominal for p in self.parameters} | dict(point.theta)
        values = {self._map.parameters[n].variable: v for n, v in theta.items()}
        rows, fed = self._driven(point, run)
        about = hashlib.sha256(np.ascontiguousarray(run.t_s).tobytes())
        about.update(rows.tobytes())
        windows = [w.moved(moved) for w in self.windows(run)]
        key = (about.digest(), tuple(sorted(values.items())), tuple(map(repr, (*fed, *windows))))
        course = self._remembered(key, lambda: self._replayed(values, run, rows, fed, windows))
        columns = zip(self._map.channels.items(), course, strict=True)
        return run.t_s, {name: row.scale * column + row.offset for (name, row), column in columns}

    def _replayed(
        self,
        values: Mapping[str, float],
        run: GapRun,
        rows: Array,
        fed: list[Fed],
        windows: Sequence[Window],
    ) -> Array:
        """Outputs of the unit, shape (channels, n), in windows.

        The first replay is made twice, for a unit that does not start anew.
        """
        times = 1 if self._starts_anew else 2
        course, *others = self._in_windows(values, run, rows, fed, windows, times=times)
        for again in others:
            if not np.array_equal(course, again, equal_nan=True):
                place = np.argwhere(course != again)[0]
                raise FmiError(
                    f"unit {self.name} keeps state between runs: its second replay of "
                    f"run {run.name} differs in {list(self._map.channels)[place[0]]} from "
                    f"{run.t_s[place[1]]:.6g} s on",
                    value=f"a difference of up to {np.nanmax(np.abs(course - again)):.3g}",
                    limit="the same to the last bit",
                    action="make the unit set all of its state when it is initialised",
                )
            self._starts_anew = True
        return course

    def _in_windows(
        self,
        values: Mapping[str, float],
        run: GapRun,
        rows: Array,
        fed: list[Fed],
        windows: Sequence[Window],
        *,
        times: int,
    ) -> list[Array]:
        parts, why = [], ""
        self.failures.replays += 1
        for a, b, start, _ in windows:
            unit_values = {**start, **values}
            played, logged = self._played(unit_values, run.t_s[a:b], rows[a:b], fed, times)
            part = played[0]
            if not np.isfinite(part).all():
                k = a + int(np.argmin(np.isfinite(part).all(axis=0)))
                words = ", ".join(f"{name} = {value:.6g}" for name, value in unit_values.items())
                last = f" ({logged})" if logged else ""
                why = why or f"run {run.name} at {run.t_s[k]:.6g} s, with {words}{last}"
            parts.append(played)
        if why:
            self.failures.add(why)
        return [np.concatenate(course, axis=1) for course in zip(*parts, strict=True)]

    def play(self, *arguments: Any) -> tuple[list[Array], str]:
        """Replays of the unit; see `Runner.replays`."""
        return self._runner.replays(*arguments)

    def _played(self, *arguments: Any) -> tuple[list[Array], str]:
        try:
            played: tuple[list[Array], str] = self._play(*arguments)
        except RuntimeError as error:
            if self.processes is None:
                raise
            raise FmiError(
                f"unit {self.name} does not run in processes",
                value=str(error),
                action="leave processes out",
            ) from error
        return played

    def windows(self, run: GapRun) -> list[Window]:
        """The windows of a run; its start is what the unit is set to before each."""
        read = {n: v for n, v in self._map.start.items() if isinstance(v, str)}
        fixed = {n: v for n, v in self._map.start.items() if not isinstance(v, str)}
        if not read or not run.outputs:
            return [Window(0, len(run.t_s), fixed, {})]
        out = []
        for w in self._windows.of(run, self.window_s):
            start = {n: self._in_unit(c, w.start) for n, c in read.items()}
            off = {n: self._in_unit(c, w.moved(c).start) - start[n] for n, c in read.items()}
            out.append(w._replace(start=fixed | start, off=off))
        return out

    def _in_unit(self, of: str, readings: Mapping[str, float]) -> float:
        """A reading, or a rate of one, as the unit has it."""
        if of in self._map.channels:
            return (readings[of] - self._map.channels[of].offset) / self._map.channels[of].scale
        return readings[of] / self._map.channels[of.removesuffix("_rate")].scale

    def _driven(self, point: ModelPoint, run: GapRun) -> tuple[Array, list[Fed]]:
        """What the unit's inputs get, shape (n, inputs), and the terms that follow its outputs."""
        columns = {}
        for name, row in self._map.inputs.items():
            column = transduced(run.inputs[name], point.effects, name, run.t_s)
            if (row.held or self._map.held) == "from" and run.whole is None:
                column = np.r_[column[:1], column[:-1]]
            columns[name] = column
        rows = np.zeros((len(run.t_s), len(self._rows)))
        for name, row in self._map.inputs.items():
            rows[:, self._rows.index(row.variable)] += columns[name]
        fed = []
        for name, term in self._map.terms.items():
            size = point.effects.get(name, {}).get("size", 0.0)
            if size == 0.0:
                continue
            place = self._rows.index(term.variable)
            if term.of in self._map.channels:
                output = list(self._map.channels).index(term.of)
                fed.append(Fed(row=place, output=output, size=size, term=term))
            elif term.of:
                rows[:, place] += size * term.shaped(columns[term.of])
            else:
                rows[:, place] += size
        return rows, fed

    def _means(self, run: GapRun, y: Array) -> Array:
        return means_over_pieces(run, y)

    def close(self) -> None:
        """End the unit."""
        self._runner.close()


def _terms(mapped: Map) -> list[Effect]:
    effects = []
    everything = tuple(mapped.channels)
    drives = {row.variable: f"{INPUT}{name}" for name, row in mapped.inputs.items()}
    for name, term in mapped.terms.items():
        size = EffectParameter(
            name="size", unit=term.unit, typical=term.typical, low=term.low, high=term.high
        )
        f = {"power": "", "sign": "tanh", "deadband": "deadband"}[term.shape]
        raised = f"^{term.power:g}" if term.shape == "power" else ""
        factor = f"{f}(({term.of} − {term.zero:g})/{term.width:g}){raised}" if term.of else "1"
        effects.append(
            Effect(
                name=name,
                title=term.title,
                parameters=(size,),
                signals=everything,
                equation=f"{term.variable} += size · {factor}",
                places=(term.place or drives.get(term.variable, f"unit's {term.variable}"),),
            )
        )
    return effects


def _parameter(name: str, row: ParameterRow, unit: UnitFile) -> Parameter:
    """A row of the map, with what it leaves out: the unit's own value, a sixth of the range."""
    start = unit.variables[row.variable].start
    nominal = row.nominal if row.nominal is not None or start is None else float(start)
    if nominal is None or not row.low <= nominal <= row.high:
        raise FmiError(
            f"parameters.{name} does not begin within its range",
            value="nothing" if nominal is None else nominal,
            limit=f"{row.low:g} to {row.high:g} {row.unit}",
            action="give nominal, or another range, in the map",
        )
    prior = row.prior_sd or (row.high - row.low) / 6
    return Parameter(
        name=name, unit=row.unit, nominal=nominal, low=row.low, high=row.high, prior_sd=prior
    )
