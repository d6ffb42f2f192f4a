"""A unit loaded in this process, with the calls of a co-simulation master, FMI 2.0 or 3.0."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave


class Loaded:
    """An instance of a unit, and what it logged."""

    def __init__(self, path: Path, folder: Path) -> None:
        described = fmpy.read_model_description(str(path))
        self.said: list[str] = []
        self.references = {v.name: v.valueReference for v in described.modelVariables}
        given = {
            "guid": described.guid,
            "unzipDirectory": fmpy.extract(str(path), str(folder)),
            "modelIdentifier": described.coSimulation.modelIdentifier,
            "instanceName": "tested",
        }
        if described.fmiVersion.startswith("3"):
            self.slave: Any = FMU3Slave(**given)
            self._log3 = fmpy.fmi3.fmi3LogMessageCallback(self._hear)
            self.slave.instantiate(loggingOn=True, logMessage=self._log3)
        else:
            self.slave = FMU2Slave(**given)
            # Kept, or ctypes would call what is no longer there.
            self._callbacks = fmpy.fmi2.fmi2CallbackFunctions()
            self._callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(self._hear)
            self._callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
            self._callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
            self.slave.instantiate(callbacks=self._callbacks, loggingOn=True)
            self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()

    def _hear(self, *words: Any) -> None:
        self.said += [word.decode() for word in words if isinstance(word, bytes)]

    def put(self, values: Mapping[str, float]) -> None:
        put = getattr(self.slave, "setFloat64", None) or self.slave.setReal
        put([self.references[n] for n in values], [float(v) for v in values.values()])

    def get(self, names: list[str]) -> list[float]:
        get = getattr(self.slave, "getFloat64", None) or self.slave.getReal
        return list(get([self.references[n] for n in names]))

    def run(
        self, t_s: np.ndarray, inputs: Mapping[str, np.ndarray], outputs: list[str]
    ) -> np.ndarray:
        """Outputs at `t_s`, shape (n, outputs); row k of the inputs is in force up to t_s[k]."""
        self.put({name: column[0] for name, column in inputs.items()})
        self.slave.exitInitializationMode()
        rows = [self.get(outputs)]
        for k in range(1, len(t_s)):
            self.put({name: column[k] for name, column in inputs.items()})
            self.slave.doStep(t_s[k - 1], t_s[k] - t_s[k - 1])
            rows.append(self.get(outputs))
        return np.array(rows)


@contextmanager
def loaded(path: Path, folder: Path) -> Iterator[Loaded]:
    unit = Loaded(path, folder)
    yield unit
    unit.slave.terminate()
    unit.slave.freeInstance()
