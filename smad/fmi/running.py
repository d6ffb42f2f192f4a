"""A unit in this process, run once for each replay, from its start and one run at a time."""

from __future__ import annotations

import contextlib
import ctypes
import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from smad.diagnosis.plant import Array
from smad.extras import part
from smad.fmi.errors import FmiError
from smad.fmi.map_file import TermRow
from smad.fmi.unit_file import UnitFile

_OK_OR_WARNING = (0, 1)


@dataclass(frozen=True, kw_only=True)
class Fed:
    """A term that depends on an output: an input's row gets `size` times `term.shaped` of it."""

    row: int
    output: int
    size: float
    term: TermRow


class Runner:
    """Replays through one unit; not safe to call from two threads at once.

    inputs, outputs: names of variables, in the order of the rows of what `replay` takes and gives.
    The unit ends, and its parts leave the disk, with `close` or with the last reference: the page
    of an answer replays after the diagnosis.
    """

    def __init__(self, unit: UnitFile, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        self._unit = unit
        self._fmi2 = part("fmpy.fmi2")
        # Raised for FMI 2 too; its home is the module of FMI 1.
        self._failed = part("fmpy.fmi1").FMICallException
        self._folder = Path(tempfile.mkdtemp(prefix="smad-unit-"))
        self._started: list[Any] = []
        """The instance that runs, or none."""
        self._end = weakref.finalize(self, _end, self._started, self._folder)
        unit.unpack(self._folder)
        self._logged: list[str] = []
        self._callbacks = _listening(self._logged)
        references = {name: v.valueReference for name, v in unit.variables.items()}
        self._references = references
        self._n_in, self._n_out = len(inputs), len(outputs)
        self._in = (ctypes.c_uint * len(inputs))(*[references[n] for n in inputs])
        self._out = (ctypes.c_uint * len(outputs))(*[references[n] for n in outputs])

    def replay(
        self, values: Mapping[str, float], t_s: Array, rows: Array, fed: Sequence[Fed] = ()
    ) -> Array:
        """Outputs at each time, shape (outputs, n); row k of `rows` (n, inputs) holds up to t_s[k].

        `values` are set before the start. NaN from where the unit gives up. Raises FmiError when it
        cannot even be started.
        """
        out = np.full((self._n_out, len(t_s)), np.nan)
        slave = self._at_start(values, rows[0])
        # The library's functions themselves: fmpy's, which may log, take as long as a short step.
        unit, of = slave.component, slave.dll
        set_real, do_step, get_real = of.fmi2SetReal, of.fmi2DoStep, of.fmi2GetReal
        put, got = (ctypes.c_double * self._n_in)(), (ctypes.c_double * self._n_out)()
        t = (t_s - t_s[0]).tolist()
        put_view, got_view = np.ctypeslib.as_array(put), np.ctypeslib.as_array(got)
        worst = get_real(unit, self._out, self._n_out, got)
        out[:, 0] = got_view
        for k in range(1, len(t)):
            put_view[:] = rows[k]
            for fed_back in fed:
                shaped = fed_back.term.shaped(got_view[fed_back.output])
                put_view[fed_back.row] += fed_back.size * shaped
            worst = max(
                worst,
                set_real(unit, self._in, self._n_in, put),
                do_step(unit, t[k - 1], t[k] - t[k - 1], 1),
                get_real(unit, self._out, self._n_out, got),
            )
            if worst not in _OK_OR_WARNING:
                # Another one is made for the next run: the standard allows no call but for freeing.
                self._started.clear()
                break
            out[:, k] = got_view
        return out

    def replays(
        self, values: Mapping[str, float], t_s: Array, rows: Array, fed: Sequence[Fed], times: int
    ) -> tuple[list[Array], str]:
        """The same replay so many times, and what the unit logged last."""
        return [self.replay(values, t_s, rows, fed) for _ in range(times)], self.last_log

    @property
    def last_log(self) -> str:
        """What the unit logged last as an error or a warning."""
        return self._logged[-1] if self._logged else ""

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
            why = self.last_log or str(error)
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

    def close(self) -> None:
        """End the unit, and remove its parts from the disk."""
        self._end()


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


def _end(started: list[Any], folder: Path) -> None:
    """End an instance and remove its folder; holds no `Runner`, which would then never go."""
    for slave in started:
        with contextlib.suppress(Exception):
            slave.terminate()
            slave.freeInstance()
    started.clear()
    shutil.rmtree(folder, ignore_errors=True)
