"""A verdict in plain words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from smad.gap.compare.nextexp import enough
from smad.gap.compare.verdict import Evidenced, Unexplained, stands_out
from smad.gap.fit.judge import shrink
from smad.gap.plant import Effect, PlantModel
from smad.gap.records import ExperimentRecord, Outcome, ValueRecord


def words(
    outcome: Outcome,
    e: Evidenced,
    plant: PlantModel,
    *,
    p: float,
    sub_model: str,
    regimes: Sequence[str],
    outputs: Sequence[str],
    values: Sequence[ValueRecord],
    experiments: Sequence[ExperimentRecord],
    wanted: float,
    unseen: bool,
) -> str:
    """The verdict as a paragraph; `wanted` is the d² from which on two causes are told apart.

    `unseen`: it was judged on runs that were not fitted to.
    """
    title = {x.name: x for x in plant.effects}
    gap = e.whole
    said = [gap_sentence(e)]
    if outcome in (Outcome.NO_GAP, Outcome.PARAMETERS, Outcome.NO_EXCITATION):
        said.append(_quiet(outcome, e))
        said += _instead(e, title)
        if experiments:
            said.append(next_sentence(experiments, wanted))
        return " ".join(said)
    place = f"in {' and '.join(regimes)}" if regimes else "in all regimes"
    said.append(f"It lies in the {sub_model} part, {place}, in {_listing(outputs)}.")
    if outcome is Outcome.UNKNOWN:
        said.append(_unknown_sentence(e, title, p))
        said += _instead(e, title)
    else:
        said.append(_cause_sentence(outcome, e, title, values, p))
        low, high = gap.interval
        judged = "runs it was not" if unseen else "the run it was"
        said.append(
            f"On {judged} fitted to, the gap falls from {gap.gap_refit:.1f}× to "
            f"{gap.gap_final:.1f}× (S = {gap.shrink:.2f} [{low:.2f}, {high:.2f}]; ceiling "
            f"{gap.ceiling:.2f})."
        )
        if outcome is Outcome.PLUS_REST:
            said.append("A rest remains that no effect of the library explains.")
        confused = [f"{n} or {' or '.join(g)}" for n, g in e.groups.items() if g]
        if e.imitated:
            confused.append("cause or other parameters")
        said.append(f"Not told apart: {'; '.join(confused) if confused else 'nothing'}.")
    open_question = outcome is Outcome.UNKNOWN or e.imitated
    said.append(next_sentence(experiments, wanted, settled=not open_question))
    return " ".join(said)


def next_sentence(
    experiments: Sequence[ExperimentRecord], wanted: float, *, settled: bool = True
) -> str:
    """The experiments that together should tell the causes apart, or that they should not.

    Where there is nothing to tell apart, whether the question is `settled` by that.
    """
    if not experiments and not settled:
        return "Next experiment: none to propose; the catalogue tells causes of the library apart."
    if not experiments:
        return "Next experiment: none needed."
    several = enough([x.counted or 0.0 for x in experiments], wanted)
    runs = [f"{x.title} ({x.duration_s:.0f} s)" for x in experiments[: several or None]]
    d2 = f"{experiments[len(runs) - 1].together or 0.0:.1f}"
    if several is None:
        return (
            f"Next experiment: {runs[0]}, but not even the {len(runs)} best of the catalogue "
            f"together are likely to tell them apart (d² ≈ {d2} of the {wanted:.0f} needed)."
        )
    return f"Next experiment: {', then '.join(runs)}; separation d² ≈ {d2}."


def gap_sentence(e: Evidenced) -> str:
    """How large the gap is, and what the parameters alone make of it."""
    subject = "Change since the known-good runs" if e.since_good else "Gap"
    if e.gap_raw <= 0.05 and not stands_out(e):
        return f"{subject}: not above the noise floor."
    if e.tied:
        said = f"{subject} {e.gap_raw:.1f}× the noise floor."
        if e.imitated:
            said += (
                f" Other values of the parameters hide it down to {e.gap_free:.1f}× and predict "
                "runs not fitted to as well as the best of the library, or better: these runs do "
                "not tell the two apart."
            )
        elif e.effects and e.gap_free < 0.7 * e.whole.gap_refit:
            said += (
                f" Other values of the parameters would hide it down to {e.gap_free:.1f}×, "
                "but predict less, or not what the cause predicts beside them."
            )
        return said
    removed = shrink(e.whole.gap_refit, e.gap_raw)
    if removed < 0.005:
        return f"{subject} {e.gap_raw:.1f}× the noise floor; a refit removes none of it."
    return (
        f"{subject} {e.gap_raw:.1f}× the noise floor; refitting the parameters removes "
        f"{removed:.0%}."
    )


def _quiet(outcome: Outcome, e: Evidenced) -> str:
    if outcome is Outcome.NO_EXCITATION:
        return (
            f"These runs would show only {e.visible:.0%} of the effects at their typical strength: "
            "they do not excite the plant enough to answer."
        )
    if outcome is Outcome.NO_GAP:
        return f"No gap: what is left ({e.whole.gap_refit:.2f}×) is {_little(e)}."
    what = "the refit of parameters and laws" if e.since_good else "the refit"
    return (
        f"Parameters only: after {what} {e.whole.gap_refit:.2f}× is left, which is {_little(e)}. "
        "No effect is needed."
    )


def _little(e: Evidenced) -> str:
    if e.since_good and e.whole.gap_refit > e.threshold:
        return (
            "more than is significant by its size, but does not stand out of what known-good runs "
            "leave"
        )
    return "within the floor"


def _unknown_sentence(e: Evidenced, title: Mapping[str, Effect], p: float) -> str:
    best = ""
    if e.effects:
        best = (
            f" The best of the library, {title[e.effects[0]].title}, removes only "
            f"{max(0.0, e.touched.shrink):.0%} of it where a flexible correction removes "
            f"{max(0.0, e.touched.ceiling):.0%}."
        )
    return (
        f"Cause: unknown (probability {p:.2f}); it is not in the library.{best}"
        f"{'' if e.effects else _unexplained(e.unexplained)}"
    )


def _unexplained(u: Unexplained | None) -> str:
    if u is None:
        return ""
    if u.run:
        return (
            f" In {u.run}, {u.channel} is far beyond what any known-good run leaves "
            f"({u.run_deficit:.0f} nats a cell worse)."
        )
    if u.output:
        return (
            f" In {u.channel} these runs differ from known-good ones by {u.spreads:.0f} times what "
            "those differ from one another."
        )
    return f" These runs score {u.deficit:.1f} nats a cell worse than known-good ones."


def _instead(e: Evidenced, title: Mapping[str, Effect]) -> list[str]:
    """What is not named, since other values of the parameters predict better, or as well."""
    if not e.instead:
        return []
    names = " and ".join(f"{title[n].title} [{n}]" for n in e.instead)
    how = "better" if e.instead_better else "as well"
    return [
        f"With the parameters of the known-good runs, {names} would leave {e.gap_instead:.2f}×; "
        f"it is not named, because other values of the parameters predict {how} and leave "
        f"{e.gap_free:.2f}×."
    ]


def _cause_sentence(
    outcome: Outcome,
    e: Evidenced,
    title: Mapping[str, Effect],
    values: Sequence[ValueRecord],
    p: float,
) -> str:
    parts = []
    for name in e.effects:
        own = [v for v in values if v.effect == name]
        numbers = ", ".join(_value(v) for v in own)
        parts.append(f"{title[name].title} [{name}] ({numbers})" if numbers else title[name].title)
    kind = "Causes" if len(parts) > 1 else "Cause"
    either = " (one of a group)" if outcome is Outcome.AMBIGUOUS else ""
    return f"{kind}{either}: {'; and '.join(parts)}; probability {p:.2f}."


def _value(v: ValueRecord) -> str:
    unit = f" {v.unit}" if v.unit and v.unit != "1" else ""
    digits = _digits(v)
    text = f"{v.name} {v.value:.{digits}g}{unit} [{v.low:.{digits}g}, {v.high:.{digits}g}]"
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


def _listing(names: Sequence[str]) -> str:
    shown = list(names)[:4]
    return ", ".join(shown) if shown else "no single channel"
