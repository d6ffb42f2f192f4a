"""The numbers behind a verdict, a line each: what it is, and how large."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from smad.gap.compare.nextexp import enough
from smad.gap.compare.verdict import Evidenced
from smad.gap.plant import Effect
from smad.gap.records import NAMED, ExperimentRecord, Outcome, ValueRecord
from smad.gap.report.terms import with_unit

Line = tuple[str, str]


def numbers(
    outcome: Outcome,
    e: Evidenced,
    effects: Sequence[Effect],
    *,
    p: float,
    where: str,
    values: Sequence[ValueRecord],
    unseen: bool,
) -> list[Line]:
    """Name and value of what the verdict rests on; `effects` are those of the library.

    `where` is the part, the regimes and the channels of a gap. `unseen`: it was judged on runs that
    were not fitted to.
    """
    title = {x.name: x.title for x in effects}
    lines = [("gap", gap(e))]
    if outcome is Outcome.NO_EXCITATION:
        lines += [("shown", f"{e.visible:.0%} of the effects, at their typical strength")]
    if outcome is Outcome.UNKNOWN or outcome in NAMED:
        lines += [("where", where)]
    if outcome in NAMED:
        fitted = {n: ", ".join(_value(v) for v in values if v.effect == n) for n in e.effects}
        lines += [(n, f"{title[n]}; {told}".rstrip("; ")) for n, told in fitted.items()]
        lines += [("probability", f"{p:.2f}"), _taken(e, unseen=unseen), _not_told_apart(e)]
    elif outcome is Outcome.UNKNOWN:
        lines += [("probability", f"{p:.2f}, that it is not in the library"), *_unknown(e, title)]
    return lines + _instead(e, title)


def gap(e: Evidenced) -> str:
    """How large the gap is at first, and what other values of the parameters make of it."""
    since = " since the known-good runs" if e.since_good else ""
    said = f"{e.gap_raw:.1f}× the noise floor{since}"
    left = e.gap_free if e.tied else e.whole.gap_refit
    said += f"; other values of the parameters leave {left:.2f}×"
    if e.imitated:
        said += ", and predict runs not fitted to as well as the cause"
    elif e.tied and e.effects and left < 0.7 * e.whole.gap_refit:
        said += ", but predict less"
    return said


def _taken(e: Evidenced, *, unseen: bool) -> Line:
    whole, (low, high) = e.whole, e.whole.interval
    judged = "runs it was not fitted to" if unseen else "the run it was fitted to"
    shrink = f"{whole.shrink:.2f} [{low:.2f}, {high:.2f}]"
    gaps = f"from {whole.gap_refit:.1f}× to {whole.gap_final:.1f}× on {judged}"
    return "shrink", f"{shrink}, {gaps}; ceiling {whole.ceiling:.2f}"


def _not_told_apart(e: Evidenced) -> Line:
    confused = [f"{n} or {' or '.join(group)}" for n, group in e.groups.items() if group]
    if e.imitated:
        confused.append("cause or other parameters")
    return "not told apart", "; ".join(confused) or "nothing"


def _unknown(e: Evidenced, title: Mapping[str, str]) -> list[Line]:
    if e.effects:
        name, worth = e.effects[0], e.touched
        takes = f"{title[name]} [{name}] takes {max(0.0, worth.shrink):.0%}"
        return [("best entry", f"{takes}, a flexible correction {max(0.0, worth.ceiling):.0%}")]
    if found := e.stands_out:
        far = f"{found.channel}, by {found.spreads:.0f} times what known-good runs differ in it"
        return [("stands out", far)]
    return []


def _instead(e: Evidenced, title: Mapping[str, str]) -> list[Line]:
    """What is not named, since other values of the parameters predict better."""
    if not e.instead:
        return []
    names = " and ".join(f"{title[n]} [{n}]" for n in e.instead)
    said = (
        f"{names} would leave {e.gap_instead:.2f}× with the parameters of the known-good runs; "
        f"other values of the parameters predict better and leave {e.gap_free:.2f}×"
    )
    return [("not named", said)]


def next_line(experiments: Sequence[ExperimentRecord], wanted: float, *, settled: bool) -> Line:
    """The experiments that together should tell causes apart, or that they should not.

    `wanted` is the d² from which on two causes are told apart. Where there is nothing to tell
    apart, whether the question is `settled` by that.
    """
    label = "next experiment"
    if not experiments:
        nothing = "none to propose: the catalogue tells causes of the library apart"
        return label, "none needed" if settled else nothing
    several = enough([x.counted or 0.0 for x in experiments], wanted)
    runs = [f"{x.title} ({x.duration_s:.0f} s)" for x in experiments[: several or None]]
    d2 = f"{experiments[len(runs) - 1].together or 0.0:.1f}"
    if several is None:
        return label, (
            f"{runs[0]}, but not even the {len(runs)} best of the catalogue together are likely to "
            f"tell them apart (d² ≈ {d2} of the {wanted:.0f} needed)"
        )
    return label, f"{', then '.join(runs)}; separation d² ≈ {d2}"


def _value(v: ValueRecord) -> str:
    digits = _digits(v)
    value = with_unit(f"{v.value:.{digits}g}", v.unit)
    text = f"{v.name} {value} [{v.low:.{digits}g}, {v.high:.{digits}g}]"
    if v.at_bound:
        text += " at its bound"
    elif not v.identifiable:
        text += " not told by these runs"
    return text


def _digits(v: ValueRecord) -> int:
    """Digits that show the width of the interval, two of them at least and five at most."""
    width = max(v.high - v.low, 1e-12)
    size = max(abs(v.low), abs(v.high), width)
    return int(np.clip(np.ceil(np.log10(size / width)) + 1, 2, 5))
