"""Where the excess error is: sub-model × side × regime, early and late, and the worst windows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smad.gap.fit.lsq import Problem
from smad.gap.plant import Array
from smad.gap.records import WindowRecord

_REGIMES = 2
_WINDOWS = 6


@dataclass(frozen=True)
class HeatMap:
    """Excess gap over the floor, by sub-model, side and regime; `by_sub_model` over all regimes.

    `windows` are the stretches of one run and output that carry most of it.
    """

    cells: dict[tuple[str, str, str], float]
    windows: list[WindowRecord]
    by_sub_model: dict[str, float]

    @property
    def worst_sub_model(self) -> str:
        """The sub-model with the largest excess; "" when there is none."""
        if not self.by_sub_model or max(self.by_sub_model.values()) <= 0:
            return ""
        return max(sorted(self.by_sub_model), key=lambda k: self.by_sub_model[k])

    def worst_regimes(self, sub_model: str) -> list[str]:
        """Regimes with the largest excess in a sub-model, largest first; early and late apart."""
        best: dict[str, float] = {}
        for (where, _, regime), excess in self.cells.items():
            if where == sub_model and regime not in ("early", "late") and excess > 0:
                best[regime] = max(best.get(regime, 0.0), excess)
        return sorted(best, key=lambda k: (-best[k], k))[:_REGIMES]


def _root_excess(squares: Array) -> float:
    return float(np.sqrt(max(0.0, float(np.mean(squares)) - 1.0))) if len(squares) else 0.0


def localise(problem: Problem, predicted: Array) -> HeatMap:
    """Heat map of the excess error of a prediction."""
    ev = problem.dataset
    squares = np.square(problem.scaled(predicted))
    regimes = dict(ev.regime_masks)
    early = np.zeros(ev.n, dtype=bool)
    for seg in ev.segments:
        t = ev.t_s[seg.rows]
        early[seg.rows] = t < t[-1] / 2
    regimes |= {"early": early, "late": ~early}
    cells = {}
    for sub_model, side in dict.fromkeys((s.sub_model, s.side) for s in ev.segments):
        here = np.zeros(ev.n, dtype=bool)
        for seg in ev.segments:
            if (seg.sub_model, seg.side) == (sub_model, side):
                here[seg.rows] = True
        for name, mask in regimes.items():
            rows = here & mask & ev.valid
            if rows.sum() >= 10:
                cells[sub_model, side, name] = _root_excess(squares[rows])
    grouped: dict[str, list[float]] = {}
    model_of = {s.key: s.sub_model for s in ev.segments}
    for key in ev.keys:
        excess = _root_excess(ev.valid_rows(key, squares))
        grouped.setdefault(model_of[key], []).append(excess**2)
    by_sub_model = {k: float(np.sqrt(np.mean(v))) for k, v in grouped.items()}
    return HeatMap(cells, _windows(problem, squares), by_sub_model)


def _windows(problem: Problem, squares: Array) -> list[WindowRecord]:
    ev = problem.dataset
    over = np.maximum(ev.cell_sum(np.where(ev.valid, squares - 1.0, 0.0)), 0.0)
    total = float(over.sum())
    if total <= 0:
        return []
    found = []
    for c in np.argsort(-over, kind="stable")[:_WINDOWS]:
        seg = ev.segments[ev.cell_segment[c]]
        a, b = ev.cell_starts[c], ev.cell_stops[c] - 1
        found.append(
            WindowRecord(
                ev.runs[seg.run].name,
                seg.key,
                seg.channel,
                float(ev.t_s[a]),
                float(ev.t_s[b]),
                float(over[c] / total),
            )
        )
    return found
