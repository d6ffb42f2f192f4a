"""The figures of the scores, each as SVG text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from smad.gap.check.score import Bin
from smad.report.plots import label, new_figure, svg_of
from tests.withheld.goals import Scored

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_OURS, _RIGHT, _FAINT = "#0b5cad", "#1f7a4d", "#8b949e"


def strengths(curves: Mapping[str, Sequence[Scored]]) -> str:
    """Each score against the gap's size, with its interval."""
    figure, axes = new_figure(1, len(curves), width_in=9.0, height_in=2.8)
    for ax, (name, rows) in zip(axes, curves.items(), strict=True):
        have = [(i, r) for i, r in enumerate(rows) if r.value is not None]
        at = [i for i, _ in have]
        values = np.array([r.value for _, r in have], dtype=float)
        below = values - np.array([r.low for _, r in have], dtype=float)
        above = np.array([r.high for _, r in have], dtype=float) - values
        ax.errorbar(at, values, np.clip([below, above], 0.0, 1.0), fmt="o-", color=_OURS, capsize=3)
        for i, r in have:
            ax.annotate(f"n={r.count}", (i, 0.02), ha="center", fontsize=7, color=_FAINT)
            if r.bound is not None:
                ax.plot([i - 0.2, i + 0.2], [r.bound, r.bound], color=_RIGHT, linewidth=1.5)
        ax.set_xticks(range(len(rows)), [r.name for r in rows])
        ax.set_xlim(-0.4, len(rows) - 0.6)
        ax.set_ylim(0.0, 1.04)
        label(ax, "gap over the floor", "share of cases", name, legend=False)
    return svg_of(figure, "Scores by the strength of the gap")


def reliability(bins: Sequence[Bin]) -> str:
    """Share of right answers against the probability that was said."""
    figure, axes = new_figure(1, 1, width_in=4.2, height_in=3.4)
    ax = axes[0]
    ax.plot([0, 1], [0, 1], color=_FAINT, linewidth=1.0, linestyle="--")
    ax.plot([b.said for b in bins], [b.was for b in bins], "-", color=_OURS, linewidth=0.8)
    for b in bins:
        ax.plot(b.said, b.was, "o", color=_OURS, markersize=3.0 + b.count**0.5)
        ax.annotate(
            str(b.count), (b.said, b.was), textcoords="offset points", xytext=(6, -9), fontsize=7
        )
    ax.set_xlim(0.0, 1.04)
    ax.set_ylim(-0.04, 1.04)
    label(ax, "probability of the first answer", "share of them right", legend=False)
    return svg_of(figure, "Calibration")


def confusion(matrix: Mapping[str, Mapping[str, int]], right: Mapping[str, str], title: str) -> str:
    """Truth (rows) against what was said (columns); `right` names the right column of each row."""
    rows = list(matrix)
    said = {s for counts in matrix.values() for s in counts}
    columns = [right[r] for r in dict.fromkeys(rows) if right[r] in said]
    columns = list(dict.fromkeys(columns)) + sorted(said - set(columns))
    figure, axes = new_figure(
        1, 1, width_in=min(13.0, 3.0 + 0.28 * len(columns)), height_in=2.0 + 0.22 * len(rows)
    )
    ax = axes[0]
    for i, row in enumerate(rows):
        total = sum(matrix[row].values())
        for s, count in matrix[row].items():
            _cell(ax, columns.index(s), i, count, count / total, hit=s == right[row])
    ax.set_xticks(range(len(columns)), columns, rotation=90, fontsize=7)
    ax.set_yticks(range(len(rows)), rows, fontsize=7)
    ax.set_xlim(-0.5, len(columns) - 0.5)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    label(ax, "said", "truth", title, legend=False)
    return svg_of(figure, title)


def _cell(ax: Axes, x: int, y: int, count: int, part: float, *, hit: bool) -> None:
    from matplotlib.patches import Rectangle

    colour = _RIGHT if hit else "#c4432b"
    shade = Rectangle((x - 0.5, y - 0.5), 1, 1, color=colour, alpha=0.15 + 0.6 * part, linewidth=0)
    ax.add_patch(shade)
    ax.text(x, y, str(count), ha="center", va="center", fontsize=7)
