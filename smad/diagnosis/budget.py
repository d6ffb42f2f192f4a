"""Where the gap goes: what models leave of runs, stage by stage, by signal and by run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.gap import rms
from smad.diagnosis.plant import Array, Channel, Mask
from smad.diagnosis.verdict import SignalGap


@dataclass(frozen=True, kw_only=True)
class Budget:
    """RMS by signal in its unit, over all signals in floors, and `by_run` (stages, runs) in floors.

    Stages are: the model before, with other values of the parameters, and after each place.
    """

    signals: list[SignalGap]
    whole: SignalGap
    by_run: Array

    @property
    def rows(self) -> list[SignalGap]:
        """The signals, and all of them together."""
        return [*self.signals, self.whole]


def budget_of(
    channels: Sequence[Channel],
    stages: Sequence[Sequence[Array]],
    valid: Sequence[Mask],
    floors: Sequence[Array],
    judged: Sequence[int] | None = None,
) -> Budget:
    """The budget of what is left (stage, run) of readings (bins, channels), where they are valid.

    `floors` are standard deviations of each run's readings, of its channels or of each reading.
    Signals and their whole are of the runs `judged`, None: of all.
    """
    kept = range(len(valid)) if judged is None else judged
    own = [valid[k] for k in kept]
    floor = rms([np.broadcast_to(floors[k], valid[k].shape) for k in kept], own)
    table = np.array([rms([stage[k] for k in kept], own) for stage in stages])
    there: Mask = np.concatenate(own).sum(axis=0) > 0
    signals = [
        _gap(c.name, c.words, c.unit, floor[i], table[:, i]) for i, c in enumerate(channels) if there[i]
    ]
    by_run = np.array([
        [_in_floors(x / f, v) for x, f, v in zip(stage, floors, valid, strict=True)]
        for stage in stages
    ])  # fmt: skip
    sizes = np.array([float(v.sum()) for v in own])
    total = np.sqrt((by_run[:, list(kept)] ** 2 @ sizes) / sizes.sum())
    return Budget(signals=signals, whole=_gap("all signals", "", "floors", 1.0, total), by_run=by_run)


def _gap(signal: str, words: str, unit: str, floor: float, left: Array) -> SignalGap:
    raw, parameters, *causes = map(float, left)
    return SignalGap(signal=signal, words=words, unit=unit, floor=float(floor), raw=raw,
                     parameters=parameters, causes=causes)  # fmt: skip


def _in_floors(scaled: Array, valid: Mask) -> float:
    square = (np.where(valid, scaled, 0.0) ** 2).sum()
    return float(np.sqrt(square / max(int(valid.sum()), 1)))
