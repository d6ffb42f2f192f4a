"""A unit of FMI as a plant of the diagnosis: a map says what its variables are."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from smad.diagnosis.places.bare import INPUT, READING
from smad.diagnosis.plant import (
    Array,
    Channel,
    Effect,
    EffectParameter,
    Mask,
    ModelPoint,
    Parameter,
    Signal,
    Traits,
)
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair.signals import means_over_pieces
from smad.fmi.errors import FmiError
from smad.fmi.map_file import ChannelRow, InputRow, Map, ParameterRow, require_fit
from smad.fmi.running import Fed, Runner
from smad.fmi.unit_file import UnitFile
from smad.simulators.plant import Failures
from smad.simulators.processes import Processes
from smad.simulators.starts import Window, Windows, by_window
from smad.simulators.transducers import Transduced, effects_of, transduced

_KEPT = 64
_MOVED = 0.01


class FmuPlant:
    """Satisfies `PlantModel`. Its effects: errors of each reading and each drive, and the map's
    terms.

    Raises FmiError for a map that does not fit the unit. Safe to call from several threads: the
    unit runs once at a time, in each of its `processes` if it has some, and what it gave for the
    latest points is kept, so that errors of a reading do not run it again.
    """

    def __init__(self, unit: UnitFile, mapped: Map) -> None:
        require_fit(mapped, unit)
        self._map = mapped
        self.name = mapped.name or unit.described.modelName
        self.version = str(unit.described.guid)
        self._rows = _rows(mapped)
        outputs = [c.variable for c in mapped.channels.values()]
        self._runner = Runner(unit, self._rows, outputs)
        self._lock = threading.Lock()
        self._starts_anew = False
        self.failures = Failures()
        """Of replays: where the unit stopped before the end of a run."""
        self.processes: Processes | None = None
        self._known: OrderedDict[object, Array] = OrderedDict()
        self.inputs = [Signal(n, r.unit, r.low, r.high) for n, r in mapped.inputs.items()]
        self.channels = [
            Channel(name=n, unit=r.unit, quantum=r.quantum, low=r.low, high=r.high, noise=r.noise)
            for n, r in mapped.channels.items()
        ]
        self.parameters = [_parameter(n, r, unit) for n, r in mapped.parameters.items()]
        self.effects = effects_of_map(mapped)
        self.window_s = mapped.window_s or 0.0
        self._read = Windows(tuple(mapped.channels))

    @property
    def traits(self) -> Traits:
        """How long a run must be, and how many replays are worth asking for at once."""
        together = self.processes.count if self.processes else 1
        return Traits(shortest_s=self._map.shortest_s, together=together)

    def simulate(self, point: ModelPoint, run: GapRun, *, fast: bool = False) -> dict[str, Array]:
        """See `PlantModel`."""
        return self._shown(point, run)

    def begun_otherwise(self, point: ModelPoint, run: GapRun) -> Iterator[dict[str, Array]]:
        """See `InWindows`."""
        base = self.simulate(point, run)
        for name in self._windows(run)[0].off:
            yield from by_window(base, self._shown(point, run, name), self.seams(run))

    def _shown(self, point: ModelPoint, run: GapRun, moved: str = "") -> dict[str, Array]:
        """What is shown with one reading or rate moved, from which all windows begin."""
        course = self._course(point, run, moved)
        out = {}
        for name, column in zip(self._map.channels, course, strict=True):
            row = self._map.channels[name]
            shown = row.scale * column + row.offset
            shown = transduced(shown, point.effects, name, run.t_s)
            out[name] = shown if run.whole is None else means_over_pieces(run, shown)
        return out

    def _course(self, point: ModelPoint, run: GapRun, moved: str) -> Array:
        """Outputs of the unit, shape (channels, n), from what is known or from a run of it."""
        theta = {p.name: p.nominal for p in self.parameters} | dict(point.theta)
        values = {self._map.parameters[n].variable: v for n, v in theta.items()}
        rows, fed = self._driven(point, run)
        about = hashlib.sha256(np.ascontiguousarray(run.t_s).tobytes())
        about.update(rows.tobytes())
        windows = [w.moved(moved) for w in self._windows(run)]
        key = (about.digest(), tuple(sorted(values.items())), tuple(map(repr, (*fed, *windows))))
        with self._lock:
            known = self._known.get(key)
            if known is None and self.processes is None:
                known = self._replayed(values, run, rows, fed, windows)
        if known is None:
            known = self._replayed(values, run, rows, fed, windows)
        with self._lock:
            self._known[key] = known
            self._known.move_to_end(key)
            while len(self._known) > _KEPT:
                self._known.popitem(last=False)
        return known

    def _replayed(
        self,
        values: Mapping[str, float],
        run: GapRun,
        rows: Array,
        fed: list[Fed],
        windows: Sequence[Window],
    ) -> Array:
        """A replay in windows; the first is made twice, for a unit that does not start anew."""
        times = 1 if self._starts_anew else 2
        course, *others = self._in_windows(values, run, rows, fed, windows, times=times)
        for again in others:
            if not np.array_equal(course, again, equal_nan=True):
                place = np.argwhere(course != again)[0]
                raise FmiError(
                    f"unit {self.name} does not start anew: the second replay of run {run.name} is "
                    f"another one, in {list(self._map.channels)[place[0]]} from "
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
            given = {**start, **values}
            played, said = self._played(given, run.t_s[a:b], rows[a:b], fed, times)
            part = played[0]
            if not np.isfinite(part).all():
                k = a + int(np.argmin(np.isfinite(part).all(axis=0)))
                words = ", ".join(f"{name} = {value:.6g}" for name, value in given.items())
                last = f" ({said})" if said else ""
                why = why or f"run {run.name} at {run.t_s[k]:.6g} s, with {words}{last}"
            parts.append(played)
        if why:
            self.failures.failed += 1
            self.failures.why = self.failures.why or why
        return [np.concatenate(course, axis=1) for course in zip(*parts, strict=True)]

    def play(self, *arguments: Any) -> tuple[list[Array], str]:
        """Replays of the unit; see `Runner.replays`."""
        return self._runner.replays(*arguments)

    def _played(self, *arguments: Any) -> tuple[list[Array], str]:
        if self.processes is None:
            return self.play(*arguments)
        try:
            played: tuple[list[Array], str] = self.processes.called(*arguments)
        except RuntimeError as error:
            raise FmiError(
                f"unit {self.name} does not run in processes",
                value=str(error),
                action="leave processes out",
            ) from error
        return played

    def _windows(self, run: GapRun) -> list[Window]:
        """The windows of a run; its start is what the unit is set to before each."""
        read = {n: v for n, v in self._map.start.items() if isinstance(v, str)}
        fixed = {n: v for n, v in self._map.start.items() if not isinstance(v, str)}
        if not read or not run.outputs:
            return [Window(0, len(run.t_s), fixed, {})]
        out = []
        for w in self._read.of(run, self.window_s):
            start = {n: self._in_unit(c, w.start) for n, c in read.items()}
            off = {n: self._in_unit(c, w.moved(c).start) - start[n] for n, c in read.items()}
            out.append(w._replace(start=fixed | start, off=off))
        return out

    def seams(self, run: GapRun) -> list[int]:
        """The samples of a run, thinned or not, at which a window begins."""
        return [a for a, *_ in self._windows(run)]

    def _in_unit(self, of: str, shown: Mapping[str, float]) -> float:
        """A reading, or a rate of one, as the unit has it."""
        if of in self._map.channels:
            return (shown[of] - self._map.channels[of].offset) / self._map.channels[of].scale
        return shown[of] / self._map.channels[of.removesuffix("_rate")].scale

    def _driven(self, point: ModelPoint, run: GapRun) -> tuple[Array, list[Fed]]:
        """What the unit's inputs get, shape (n, inputs), and the terms that follow its outputs."""
        given = {}
        for name, row in self._map.inputs.items():
            column = transduced(run.inputs[name], point.effects, name, run.t_s)
            if (row.held or self._map.held) == "from" and run.whole is None:
                column = np.r_[column[:1], column[:-1]]
            given[name] = column
        rows = np.zeros((len(run.t_s), len(self._rows)))
        for name, row in self._map.inputs.items():
            rows[:, self._rows.index(row.variable)] += given[name]
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
                rows[:, place] += size * term.shaped(given[term.of])
            else:
                rows[:, place] += size
        return rows, fed

    def regimes(self, run: GapRun, side: str) -> dict[str, Mask]:
        """At rest until an input first moves; then by each input above and below its middle."""
        moved = np.zeros(len(run.t_s), dtype=bool)
        halves: dict[str, Mask] = {}
        for name, row in self._map.inputs.items():
            column = run.inputs[name]
            moved |= np.abs(column - column[0]) > _MOVED * (row.high - row.low)
            halves[f"{name} high"] = column > (row.low + row.high) / 2
        rest = np.cumsum(moved) == 0
        out = {"rest": rest}
        for name, high in halves.items():
            out[name] = high & ~rest
            out[name.replace(" high", " low")] = ~high & ~rest
        return out

    def close(self) -> None:
        """End the unit."""
        self._runner.close()


def effects_of_map(mapped: Map) -> list[Effect]:
    """Gain, zero and lag of each reading and drive, then the terms of the map."""
    effects: list[Effect] = []
    everything = tuple(mapped.channels)
    rows: dict[str, ChannelRow | InputRow] = {**mapped.channels, **mapped.inputs}
    for name, row in rows.items():
        drive = name in mapped.inputs
        signal = Transduced(
            name=name,
            unit=row.unit,
            low=row.low,
            high=row.high,
            lag_s=mapped.lag_s,
            drive=drive,
            signals=everything if drive else (name,),
            places=(f"{INPUT if drive else READING}{name}",),
        )
        effects += effects_of(signal, delay=False)
    drives = {row.variable: f"{INPUT}{name}" for name, row in mapped.inputs.items()}
    for name, term in mapped.terms.items():
        size = EffectParameter(
            name="size", unit=term.unit, typical=term.typical, low=term.low, high=term.high
        )
        f = {"power": "", "sign": "tanh", "deadband": "deadband"}[term.shape]
        raised = f"^{term.power:g}" if term.shape == "power" else ""
        what = f"{f}(({term.of} − {term.zero:g})/{term.width:g}){raised}" if term.of else "1"
        effects.append(
            Effect(
                name=name,
                title=term.title,
                parameters=(size,),
                signals=everything,
                equation=f"{term.variable} += size · {what}",
                places=(term.place or drives.get(term.variable, f"unit's {term.variable}"),),
            )
        )
    return effects


def _rows(mapped: Map) -> list[str]:
    """The unit's variables that are driven, each once."""
    rows = (*mapped.inputs.values(), *mapped.terms.values())
    return list(dict.fromkeys(r.variable for r in rows))


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
