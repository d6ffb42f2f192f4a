"""A unit of FMI as a function of time, inputs, values and start (`declare.Replay`)."""

import contextlib
import ctypes
import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from smad.diagnosis.plant import Array
from smad.extras import part
from smad.fmi.errors import FmiError
from smad.fmi.map_file import InputRow, Map, TermRow, require_fit
from smad.fmi.unit_file import UnitFile

_OK_OR_WARNING = (0, 1)


class _Fed(NamedTuple):
    """A term that depends on an output: an input's row gets `size` times `term.shaped` of it."""

    row: int
    output: int
    size: float
    term: TermRow


class UnitModel:
    """Replays of one unit, one at a time from its start; see `Replay` for how it is called.

    The unit ends, and its parts leave the disk, with the last reference: the page of an answer
    replays after the diagnosis. Raises FmiError for a map that does not fit the unit.
    """

    def __init__(self, unit: UnitFile, mapped: Map) -> None:
        require_fit(mapped, unit)
        self._unit, self._map = unit, mapped
        self._fmi2 = part("fmpy.fmi2")
        # Raised for FMI 2 too; its home is the module of FMI 1.
        self._failed = part("fmpy.fmi1").FMICallException
        self._folder = Path(tempfile.mkdtemp(prefix="smad-unit-"))
        self._started: list[Any] = []
        """The instance that runs, or none."""
        weakref.finalize(self, _end, self._started, self._folder)
        unit.unpack(self._folder)
        self._logged: list[str] = []
        self._callbacks = _listening(self._logged)
        self._lock = Lock()
        self._references = {name: v.valueReference for name, v in unit.variables.items()}
        driven: tuple[InputRow | TermRow, ...] = (*mapped.inputs.values(), *mapped.terms.values())
        self._rows = list(dict.fromkeys(r.variable for r in driven))
        """The unit's variables that are driven, each once."""
        outputs = [self._references[row.variable] for row in mapped.channels.values()]
        self._in = (ctypes.c_uint * len(self._rows))(*[self._references[n] for n in self._rows])
        self._out = (ctypes.c_uint * len(outputs))(*outputs)

    def __call__(
        self,
        t: Array,
        inputs: Mapping[str, Array],
        values: Mapping[str, float],
        start: Mapping[str, float],
    ) -> dict[str, Array]:
        """Channels of the map at times `t`."""
        rows, fed = self._driven(inputs, values)
        set_values = {v: self._in_unit(of, start) for v, of in self._map.start.items()}
        set_values |= {row.variable: values[n] for n, row in self._map.parameters.items()}
        with self._lock:
            shown = self._replayed(set_values, t, rows, fed)
        channels = zip(self._map.channels.items(), shown, strict=True)
        return {name: row.scale * y + row.offset for (name, row), y in channels}

    def _driven(
        self, inputs: Mapping[str, Array], values: Mapping[str, float]
    ) -> tuple[Array, list[_Fed]]:
        """What the unit's inputs get, shape (n, inputs), and the terms that follow its outputs."""
        columns = {}
        for name, row in self._map.inputs.items():
            late = (row.held or self._map.held) == "from"
            columns[name] = np.r_[inputs[name][:1], inputs[name][:-1]] if late else inputs[name]
        rows = np.zeros((len(next(iter(columns.values()))), len(self._rows)))
        for name, row in self._map.inputs.items():
            rows[:, self._rows.index(row.variable)] += columns[name]
        fed = []
        for name, term in self._map.terms.items():
            size, place = values[name], self._rows.index(term.variable)
            if size != 0.0 and term.of in self._map.channels:
                fed.append(_Fed(place, list(self._map.channels).index(term.of), size, term))
            elif size != 0.0:
                rows[:, place] += size * (term.shaped(columns[term.of]) if term.of else 1.0)
        return rows, fed

    def _in_unit(self, of: float | str, start: Mapping[str, float]) -> float:
        """A number, or a reading or a rate of one as the unit has it."""
        if not isinstance(of, str):
            return of
        rate = of not in self._map.channels
        row = self._map.channels[of.removesuffix("_rate") if rate else of]
        return (start[of] - (0.0 if rate else row.offset)) / row.scale

    def _replayed(
        self, values: Mapping[str, float], t_s: Array, rows: Array, fed: Sequence[_Fed]
    ) -> Array:
        """Outputs at each time, shape (outputs, n); row k of `rows` (n, inputs) holds up to t_s[k].

        `values` are set before the start. NaN from where the unit gives up. Raises FmiError for one
        that cannot be started, or that logs why it stops.
        """
        n_in, n_out = len(self._in), len(self._out)
        out = np.full((n_out, len(t_s)), np.nan)
        self._logged.clear()
        slave = self._at_start(values, rows[0])
        # The library's functions themselves: fmpy's, which may log, take as long as a short step.
        unit, of = slave.component, slave.dll
        set_real, do_step, get_real = of.fmi2SetReal, of.fmi2DoStep, of.fmi2GetReal
        put, got = (ctypes.c_double * n_in)(), (ctypes.c_double * n_out)()
        t = t_s.tolist()
        put_view, got_view = np.ctypeslib.as_array(put), np.ctypeslib.as_array(got)
        worst = get_real(unit, self._out, n_out, got)
        out[:, 0] = got_view
        for k in range(1, len(t)):
            put_view[:] = rows[k]
            for fed_back in fed:
                shaped = fed_back.term.shaped(got_view[fed_back.output])
                put_view[fed_back.row] += fed_back.size * shaped
            worst = max(
                worst,
                set_real(unit, self._in, n_in, put),
                do_step(unit, t[k - 1], t[k] - t[k - 1], 1),
                get_real(unit, self._out, n_out, got),
            )
            if worst not in _OK_OR_WARNING:
                # Another one is made for the next run: the standard allows no call but for freeing.
                self._started.clear()
                if self._logged:
                    raise FmiError(f"it stops {t[k]:.6g} s after its start: {self._logged[-1]}")
                break
            out[:, k] = got_view
        return out

    def _at_start(self, values: Mapping[str, float], first: Array) -> Any:
        """The unit at its start. One that cannot be put back there is loaded anew."""
        try:
            if self._started:
                try:
                    self._started[0].reset()
                except self._failed:
                    self._started.clear()
            if not self._started:
                self._started.append(self._loaded())
            slave = self._started[0]
            slave.setupExperiment(startTime=0.0)
            slave.setReal([self._references[n] for n in values], list(values.values()))
            slave.enterInitializationMode()
            slave.setReal(list(self._in), first.tolist())
            slave.exitInitializationMode()
        except Exception as error:  # whatever somebody else's library does at its start
            self._started.clear()
            why = self._logged[-1] if self._logged else str(error)
            raise FmiError(
                f"{self._unit.path.name} cannot be started: {why}",
                action="run it in the program that exported it",
            ) from error
        return slave

    def _loaded(self) -> Any:
        slave = self._fmi2.FMU2Slave(
            guid=self._unit.described.guid,
            unzipDirectory=str(self._folder),
            modelIdentifier=self._unit.identifier,
            instanceName="smad",
        )
        slave.instantiate(callbacks=self._callbacks)
        return slave

    def pause(self) -> None:
        """End the instance that runs; the next replay makes another."""
        _end(self._started, None)


def _listening(logged: list[str]) -> Any:
    """What a unit logs is kept in `logged` for an error, not printed over a command's answer."""
    fmi2, fmpy = part("fmpy.fmi2"), part("fmpy")

    def hear(*words: Any) -> None:
        _, _, status, _, message = words[:5]
        if status not in _OK_OR_WARNING and message:
            logged[:] = [" ".join(message.decode(errors="replace").split())]

    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(hear)
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    return callbacks


def _end(started: list[Any], folder: Path | None) -> None:
    """End an instance and remove its folder; holds no `UnitModel`, which would then never go."""
    for slave in started:
        with contextlib.suppress(Exception):
            slave.terminate()
            slave.freeInstance()
    started.clear()
    if folder is not None:
        shutil.rmtree(folder, ignore_errors=True)
