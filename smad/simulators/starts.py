"""Where a replay begins: values and rates of the readings at a sample, by a local parabola."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from smad.diagnosis.plant import Array
from smad.diagnosis.runs import GapRun
from smad.simulators.columns import correlation_time_s

_OF_CORRELATION = 0.3
_DEGREE = 3
_FEWEST = 4
_MOST = 20


class Starts:
    """Of one run: what its outputs show at any sample, smoothed; 0 for an output that it lacks."""

    def __init__(self, run: GapRun, outputs: tuple[str, ...]) -> None:
        self._run = run
        self._outputs = outputs
        dt_s = run.dt_s
        self._half = {
            n: int(np.clip(
                _OF_CORRELATION * correlation_time_s(run.t_s, run.outputs[n]) / dt_s, _FEWEST, _MOST
            ))
            for n in outputs if n in run.outputs
        }  # fmt: skip

    def at(self, k: int) -> Mapping[str, float]:
        """NAME and NAME_rate of every output at sample k."""
        out: dict[str, float] = {}
        for name in self._outputs:
            value, rate = self._local(name, k) if name in self._half else (0.0, 0.0)
            out[name], out[f"{name}_rate"] = value, rate
        return out

    def _local(self, name: str, k: int) -> tuple[float, float]:
        run, half = self._run, self._half[name]
        part = slice(max(k - half, 0), min(k + half + 1, len(run.t_s)))
        good = run.good[part] & np.isfinite(run.outputs[name][part])
        t: Array = (run.t_s[part] - run.t_s[k])[good]
        if len(t) <= _DEGREE + 1:
            return float(np.nan_to_num(run.outputs[name][k])), 0.0
        scale = float(np.abs(t).max())
        (value, rate, *_) = np.polynomial.polynomial.polyfit(
            t / scale, run.outputs[name][part][good], _DEGREE
        )
        return float(value), float(rate / scale)
