"""Windows: how far a model predicts, and a length from which its replays are begun anew.

Multiple shooting (Bock and Plitt 1984): a run that is only predictable for a while is replayed in
windows that begin from its readings. Between windows nothing is fitted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from smad.diagnosis.data.admission import row_of_admitted_s
from smad.diagnosis.data.columns import filled, up_to_first_hole, with_lost
from smad.diagnosis.data.grid import row_length_s
from smad.diagnosis.numerics.threads import each
from smad.diagnosis.plant import Array, Mask, ModelPoint, moved_parameters, nominal_point, traits_of
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import Finding
from smad.simulators.errors import SimulatorError
from smad.simulators.plant import SimulatedPlant
from smad.units import in_words

_FOLLOWS = 0.25
"""Error over the signal's standard deviation up to which a model follows a run, as configured."""
_FITTED = 0.1
"""The same with the best parameters: beyond, what is missing has moved the phase."""
_GROWS = 2.0
"""Times the error within a window that a whole run's must be, or windows help nothing."""
_FORGOTTEN = 0.1
"""Of a signal's standard deviation: what another start may change at the end of a run."""
_ROUNDS = 6
_SAMPLES = 400
_STEP = 0.05
_LEAST_ROWS = 10
_HALVINGS = 8
_PRIOR = 0.01
_LOST = 10.0
"""Error over the signal's standard deviation where a model gives no number."""
_MOST_RUNS = 4
_BEGINS_OFF, _COMES_NEAR = 0.1, 0.5
"""Of what a reading goes through, that a model begins off it; of that, what is left at the end."""
_FIRST = 5
"""Samples in which a run begins."""


def choose_window(
    plant: SimulatedPlant, runs: Sequence[GapRun], window_s: float | None
) -> tuple[float, str]:
    """The length of a window in s, 0 for whole runs, and why in words.

    A length that is given is taken; None chooses: whole runs, unless the model loses them with the
    best parameters, then the longest windows that it does not lose.
    """
    runs = [_usable(plant, run) for run in runs if len(run.t_s) > 1]
    if not runs:
        return window_s or 0.0, ""
    if window_s is not None:
        return _validated(plant, runs, window_s)
    used, start = runs[:_MOST_RUNS], nominal_point(plant)
    before = lost_by(plant, start, used, 0.0)
    lengths = _lengths(plant, runs)
    if before <= _FOLLOWS or not lengths:
        return 0.0, ""
    if all(forgets_its_start(plant, run) for run in used):
        return 0.0, ""
    point = fitted(plant, start, used, lengths[len(lengths) // 2])
    if lost_by(plant, point, used, 0.0) <= _FITTED:
        return 0.0, ""
    good = [
        w
        for w in lengths
        if lost_by(plant, start, used, w) <= _FOLLOWS and lost_by(plant, point, used, w) <= _FITTED
    ]
    chosen = max(good, default=lengths[-1])
    after = lost_by(plant, start, used, chosen)
    if before < _GROWS * after:
        return 0.0, ""
    return chosen, (
        f"replayed in windows of {chosen:.3g} s that begin from the readings: over a whole run the "
        f"prediction error grows to {before:.2f} of the signal, within a window to {after:.2f} "
        "(window_s = 0 asks for whole runs)"
    )


def _usable(plant: SimulatedPlant, run: GapRun) -> GapRun:
    """A run as it will be admitted: up to its first hole, without NaN."""
    row_s = row_of_admitted_s([run], plant)
    used = filled(with_lost(up_to_first_hole(run, row_s, lambda *_, **__: None)))
    return replace(used, outputs={n: y for n, y in used.outputs.items() if np.isfinite(y).all()})


def _validated(plant: SimulatedPlant, runs: Sequence[GapRun], window_s: float) -> tuple[float, str]:
    if not window_s >= 0.0:
        raise SimulatorError("window_s is not a length", value=window_s, action="give s, or 0")
    if window_s == 0.0:
        return 0.0, ""
    least = _LEAST_ROWS * row_length_s(runs, plant)
    if window_s < least:
        raise SimulatorError(
            "windows are too short for what is measured",
            value=f"{window_s:g} s",
            limit=f"at least {least:.3g} s",
            action="give longer ones, or leave window_s out",
        )
    base, elsewhere = _begun_elsewhere(plant, runs[0])
    if all(np.array_equal(base[n], elsewhere[n], equal_nan=True) for n in base):
        raise SimulatorError(
            f"{plant.name} does not begin from its readings, so no window can",
            action="use start['NAME'] and start['NAME_rate'] as the initial state",
        )
    return window_s, f"replayed in windows of {window_s:.3g} s that begin from the readings"


def forgets_its_start(plant: SimulatedPlant, run: GapRun) -> bool:
    """Whether the model shows the same at the end of a run wherever the readings have it begin.

    Then errors do not grow, and a window would add that of its start.
    """
    base, elsewhere = _begun_elsewhere(plant, run)
    quarter = max(len(run.t_s) // 4, 1)
    for name, y in run.outputs.items():
        late = y[-quarter:]
        off = np.where(np.isnan(base[name]), 0.0, np.abs(elsewhere[name] - base[name]))
        if not np.max(off[-quarter:]) <= _FORGOTTEN * np.std(late):
            return False
    return True


def other_starts(plant: SimulatedPlant, runs: Sequence[GapRun]) -> list[Finding]:
    """What is asked of each channel that the model, as configured, begins far from what was read
    and comes near only later, as it does from another state."""
    used = [(run, _usable(plant, run)) for run in runs[:_MOST_RUNS] if len(run.t_s) > 1]
    used = [(read, run) for read, run in used if len(run.t_s) > 4 * _FIRST]
    models = _replayed(plant, nominal_point(plant), [run for _, run in used], plant.window_s)
    found: dict[str, tuple[float, Finding]] = {}
    for (read, run), model in zip(used, models, strict=True):
        late = _late(run, plant.window_s if plant.window_s < run.duration_s else 0.0)
        for c in (c for c in plant.channels if c.name in run.outputs):
            if not np.isfinite(read.outputs[c.name][:_FIRST]).all():
                continue
            y, shown = run.outputs[c.name], model[c.name]
            begins, begun = float(np.median(y[:_FIRST])), float(np.median(shown[:_FIRST]))
            off, left = abs(begins - begun), float(np.sqrt(np.mean((y - shown)[late] ** 2)))
            least = max(_BEGINS_OFF * float(np.ptp(y)), found.get(c.name, (0.0,))[0])
            asked = off > least and left < _COMES_NEAR * off
            if asked and _begins_elsewhere(plant, run, c.name, shown):
                text = (
                    f"{c.name} begins at {begins:.4g} {in_words(c.unit)}, in the model at "
                    f"{begun:.4g}, and the two meet only later: let the model begin in the run's "
                    "state (start of a function, [start] of an FMI map), or record from rest"
                )
                found[c.name] = off, Finding(run.name, "other start", text, refuses=False)
    return [finding for _, finding in found.values()]


def _begins_elsewhere(plant: SimulatedPlant, run: GapRun, name: str, shown: Array) -> bool:
    """Whether a replay of what is left of a run begins elsewhere than the model was there. One that
    only follows its inputs has no state to begin in: its sensor may be slow."""
    k = int(np.argmax(np.abs(shown[: -4 * _FIRST] - shown[0])))
    rest = run.part(k, len(run.t_s))
    (anew,) = _replayed(plant, nominal_point(plant), [rest], plant.window_s)
    off = np.median(anew[name][:_FIRST]) - np.median(shown[k : k + _FIRST])
    return bool(abs(off) > _BEGINS_OFF * np.ptp(run.outputs[name]))


def _begun_elsewhere(
    plant: SimulatedPlant, run: GapRun
) -> tuple[Mapping[str, Array], Mapping[str, Array]]:
    """What the model predicts of a whole run, from its start and from quite another one."""
    moved = {
        n: y + np.ptp(y) * (0.3 + 0.1 * (run.t_s - run.t_s[0]) / max(run.duration_s, 1e-9))
        for n, y in run.outputs.items()
    }
    point = nominal_point(plant)
    (base,), (elsewhere,) = (
        _replayed(plant, point, [r], 0.0) for r in (run, run.with_columns(outputs=moved))
    )
    return base, elsewhere


def lost_by(
    plant: SimulatedPlant, point: ModelPoint, runs: Sequence[GapRun], window_s: float
) -> float:
    """Prediction error over the signal's standard deviation, both over all runs: of the worst
    channel, the larger of the whole and of the last quarter of each window (or run)."""
    square: dict[str, Array] = {}
    for run, model in zip(runs, _replayed(plant, point, runs, window_s), strict=True):
        late = _late(run, window_s)
        for name, y in run.outputs.items():
            e = np.where(run.good, y - model[name], 0.0)
            variance = len(y) * float(np.nanvar(y))
            parts = np.array([e @ e, variance, e[late] @ e[late], variance * float(np.mean(late))])
            square[name] = square.get(name, np.zeros(4)) + parts
    ratios = [
        np.sqrt(max(a / max(b, 1e-300), c / max(d, 1e-300))) for a, b, c, d in square.values()
    ]
    return float(max((r if np.isfinite(r) else np.inf for r in ratios), default=0.0))


def _late(run: GapRun, window_s: float) -> Mask:
    into = run.t_s - run.t_s[0]
    length = window_s or max(run.duration_s, 1e-9)
    late: Mask = np.mod(into, length) >= 0.75 * length
    return late


def _replayed(
    plant: SimulatedPlant, point: ModelPoint, runs: Sequence[GapRun], window_s: float
) -> list[dict[str, Array]]:
    before, plant.window_s = plant.window_s, window_s
    try:
        return each(lambda run: plant.simulate(point, run), runs, traits_of(plant).together)
    finally:
        plant.window_s = before


def _lengths(plant: SimulatedPlant, runs: Sequence[GapRun]) -> list[float]:
    """Lengths that windows may have, longest first: halves of a run, down to a few rows."""
    longest = float(np.median([r.duration_s for r in runs])) / 2.0
    least = _LEAST_ROWS * row_length_s(runs, plant)
    # A row of means has its own length; a window begins where a row does.
    out = [longest / 2.0**k for k in range(_HALVINGS)]
    return [float(f"{w:.2g}") for w in out if w >= least]


def fitted(
    plant: SimulatedPlant, start: ModelPoint, runs: Sequence[GapRun], window_s: float
) -> ModelPoint:
    """The parameters that predict best in windows, by least squares with priors."""

    def residuals(moved: Array) -> Array:
        x = moved - 1.0
        point = ModelPoint(moved_parameters(plant, start, x))
        rows = [_PRIOR * x]
        for run, model in zip(runs, _replayed(plant, point, runs, window_s), strict=True):
            every = max(len(run.t_s) // _SAMPLES, 1)
            for name, y in run.outputs.items():
                e = np.where(run.good, y - model[name], 0.0)[::every] / (float(np.nanstd(y)) or 1.0)
                rows.append(np.where(np.isfinite(e), e, _LOST) / np.sqrt(len(e)))
        return np.concatenate(rows)

    # Around 1, since a step of the slopes is a share of where it is made.
    begin = np.ones(len(plant.parameters))
    if not len(begin):
        return start
    solution = least_squares(residuals, begin, diff_step=_STEP, ftol=1e-3, max_nfev=_ROUNDS).x
    return ModelPoint(moved_parameters(plant, start, solution - 1.0))
