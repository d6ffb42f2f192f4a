"""Checks of the runs as a whole: recordings given twice, too few runs, runs beyond the good ones.

A recording is recognised by its samples, not by its name: a renamed copy, or one with other
rounding, is the same.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from smad.diagnosis.plant import Array, PlantModel, nominal_replay
from smad.diagnosis.runs import GapRun, ranges_of
from smad.diagnosis.verdict import Finding

FIT, HOLD_OUT, GOOD = "fit", "hold-out", "good"
FURTHER = "further than good"
"""Kind of the finding that runs in question go where no known-good run was."""
_ROUNDING = 1e-5
_FURTHER_SHARE = 0.5
"""Share of the range of known-good runs that others must exceed it by."""
_MOVING_SHARE = 0.03
"""Least excess as a share of the channel's range: less may be a drift of the room."""
_WHY_NOT = {
    (FIT, FIT): "it would only count twice",
    (HOLD_OUT, HOLD_OUT): "it would only count twice",
    (GOOD, GOOD): "known-good runs would seem to repeat better than they do",
    (FIT, HOLD_OUT): "a model cannot be judged on what it was fitted to",
    (FIT, GOOD): "a run that is in question cannot say what is good",
    (HOLD_OUT, GOOD): "a run that is in question cannot say what is good",
}


def without_repeats(
    groups: Mapping[str, Sequence[GapRun]],
) -> tuple[dict[str, list[GapRun]], dict[str, list[Finding]]]:
    """The groups (fit, hold-out, good) with each recording once, in the first that has it.

    Also returns the findings on the runs left out of each group, which are refused.
    """
    once: dict[str, list[GapRun]] = {role: [] for role in groups}
    findings: dict[str, list[Finding]] = {role: [] for role in groups}
    for role, runs in groups.items():
        for run in runs:
            earlier = next(
                ((r, k) for r, of_role in once.items() for k in of_role if same_recording(k, run)),
                None,
            )
            if earlier is None:
                once[role].append(run)
            else:
                findings[role].append(_repeated(run, role, *earlier))
    return once, findings


def _repeated(run: GapRun, role: str, earlier_role: str, earlier: GapRun) -> Finding:
    role_words, other = "", ""
    if role != earlier_role:
        role_words, other = f"given as {role}, ", f", given as {earlier_role}"
    why = _WHY_NOT[earlier_role, role]
    text = f"{role_words}holds the same samples as {earlier.name}{other}; left out, since {why}"
    return Finding(run.name, "given twice", text, refuses=True)


def same_recording(run: GapRun, other: GapRun) -> bool:
    """Whether two runs hold the same samples, up to rounding and the start of their clocks."""
    if len(run.t_s) != len(other.t_s) or not len(run.t_s):
        return False
    shared = run.outputs.keys() & other.outputs.keys()
    if run.inputs.keys() != other.inputs.keys() or not shared:
        return False
    columns = [(run.t_s - run.t_s[0], other.t_s - other.t_s[0])]
    columns += [(run.outputs[name], other.outputs[name]) for name in shared]
    columns += [(run.inputs[name], other.inputs[name]) for name in run.inputs]
    return all(_alike(a, b) for a, b in columns)


def _alike(a: Array, b: Array) -> bool:
    size = float(np.max(np.abs(a), initial=0.0, where=np.isfinite(a)))
    return np.allclose(a, b, rtol=0.0, atol=_ROUNDING * size, equal_nan=True)


def too_few(groups: Mapping[str, Sequence[GapRun]]) -> list[Finding]:
    """Findings on groups of admitted runs that are too few for a reliable verdict."""
    texts = []
    if len(groups[FIT]) == 1 and not groups[HOLD_OUT]:
        texts.append(
            "a single run to fit and none held out: every figure is of the fitted run itself; "
            "give a second run, or one to --hold-out"
        )
    if len(groups[GOOD]) == 1:
        texts.append(
            "a single known-good run: the spread between good runs is unknown, and any difference "
            "counts as a change; give two or more of different kinds"
        )
    return [Finding("all runs", "few runs", text, refuses=False) for text in texts]


def goes_further(
    runs: Sequence[GapRun], good: Sequence[GapRun], plant: PlantModel
) -> list[Finding]:
    """A finding if `runs` in question drive the bench further than known-good ones do.

    The nominal predictions are compared, so that no effect counts as excitation.
    """
    in_question = _ranges(runs, plant)
    channels = {c.name: c for c in plant.channels}
    further = []
    for name, (low, high) in _ranges(good, plant).items():
        a, b = in_question.get(name, (low, high))
        channel, beyond = channels[name], max(low - a, b - high)
        least = _FURTHER_SHARE * (high - low)
        if beyond > max(least, _MOVING_SHARE * (channel.high - channel.low)):
            further.append(
                f"{name} from {a:.3g} to {b:.3g} {channel.unit}, the known-good ones only from "
                f"{low:.3g} to {high:.3g} {channel.unit}"
            )
    if not further:
        return []
    text = (
        f"by their inputs they should drive {'; '.join(further)}: errors of the model out there "
        "count as changes; give known-good runs that go as far"
    )
    return [Finding("the runs in question", FURTHER, text, refuses=False)]


def _ranges(runs: Sequence[GapRun], plant: PlantModel) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each channel that the nominal model predicts of some runs."""
    return ranges_of(
        {c: y[np.isfinite(y)] for c, y in nominal_replay(run, plant).items() if c in run.outputs}
        for run in runs
    )
