"""A verdict in plain words: what a terminal shows."""

from __future__ import annotations

from collections.abc import Sequence

from smad.diagnosis.verdict import (
    CAUSES,
    CHECK_UP,
    DIFFERS,
    PARAMETERS,
    REFUSED,
    UNEXPLAINED,
    Cause,
    ParameterMoved,
    RivalGap,
    SignalGap,
    Verdict,
)

_OTHERS = 3
_MOVED = 4
_UNSEEN = 4
_RIVALS = 5
_NAMED = 0.05


def lines(verdict: Verdict) -> list[str]:
    """The verdict in plain words, the headline first; lines that begin with a space are tables."""
    v = verdict
    out = [v.headline]
    out += [f"{f.run}: {f.text}" for f in v.findings if f.refuses or f.run == "all runs"]
    if v.outcome == REFUSED:
        return out
    for cause in v.causes:
        out += cause_lines(cause)
    if not v.causes:
        out += rival_lines(v.rivals)
    if v.outcome in (PARAMETERS, UNEXPLAINED) or v.question == CHECK_UP:
        out += parameter_lines(v.parameters)
    out += budget_lines((*v.budget, *([v.whole] if v.whole else [])), v.question)
    if v.by_run:
        most = max(v.by_run, key=lambda r: r.final)
        out.append(f"judged on {v.judged_on}; the largest gap that is left is in {most.run}")
    if v.repeated is not None:
        out += repeated_lines(v)
    if v.unseen:
        out.append("these runs would not have shown (the page lists all of them)")
        out += [f"  {text}" for text in v.unseen[:_UNSEEN]]
    return [*out, *v.notes]


def cause_lines(cause: Cause) -> list[str]:
    """One cause: its table of rivals, its law if it is one, and what it may be instead."""
    out = rival_lines(cause.rivals)
    for k, term in enumerate(cause.read):
        out.append(f"  {'law' if not k else '':<6} {term.text}")
    for k, value in enumerate(cause.values):
        out.append(f"  {'values' if not k else '':<6} {value.text}")
    out.append(f"  where  {cause.words}: probability {cause.probability:.2f}{_elsewhere(cause)}")
    out.append(f"  name   {name_words(cause)}")
    return out


def name_words(cause: Cause) -> str:
    """Which effect it is if it is one of the library, and how likely it is none."""
    if not cause.names:
        return "no effect of the library was near"
    likely = [f"{n} {p:.2f}" for n, p in cause.names.items() if p >= _NAMED][: 1 + _OTHERS]
    return (
        f"{', '.join(likely)} of those in the library; {cause.outside:.2f} that it is none of them"
    )


def _elsewhere(cause: Cause) -> str:
    others = [
        f"{place} {p:.2f}" for place, p in cause.places.items() if place != cause.place
    ]  # fmt: skip
    shown = [text for text in others if not text.endswith(" 0.00")][:_OTHERS]
    return f"; else {', '.join(shown)}" if shown else ""


def rival_lines(rivals: Sequence[RivalGap]) -> list[str]:
    """The table of rivals: what each leaves of the judged runs, and its probability."""
    if not rivals:
        return []
    out = [f"  {'rival':<46} {'gap left':>9} {'probability':>12}"]
    always = {"nothing", "parameters"}
    for k, r in enumerate(rivals):
        if k < _RIVALS or r.kind in always:
            out.append(f"  {r.words:<46} {r.gap:>9.3g} {r.probability:>12.2f}")
    return out


def parameter_lines(parameters: Sequence[ParameterMoved]) -> list[str]:
    """The parameters that moved most, beside their deviation."""
    moved = [q for q in parameters if abs(q.after - q.before) > q.sd]
    return [
        f"  {'moved' if not k else '':<6} {q.name} {q.before:.4g} -> {q.after:.4g} ± {q.sd:.2g} "
        f"{'' if q.unit == '1' else q.unit}".rstrip()
        for k, q in enumerate(moved[:_MOVED])
    ]


def budget_stages(question: str) -> tuple[str, str]:
    """What a question's gaps are of, and the name of its first column."""
    if question == CHECK_UP:
        return "now − then", "then"
    return "measured − predicted", "raw" if question == DIFFERS else "as good"


def budget_lines(rows: Sequence[SignalGap], question: str) -> list[str]:
    """Where the gap goes, signal by signal."""
    if not rows:
        return []
    (of, first), causes = budget_stages(question), bool(rows[0].causes)
    head = f"  {'RMS of ' + of:<29} {first:>9} {'parameters':>10}"
    head += f" {'and causes':>10}" * causes + f" {'floor':>9}"
    out = [head]
    for s in rows:
        line = f"  {s.signal:<21} {s.unit:<7} {s.raw:>9.3g} {s.parameters:>10.3g}"
        line += f" {s.final:>10.3g}" * causes + f" {s.floor:>9.3g}"
        out.append(line)
    return out


def repeated_lines(verdict: Verdict) -> list[str]:
    """What runs say that repeat known-good ones."""
    r = verdict.repeated
    if r is None:
        return []
    if not r.outcome:
        why = r.headline or ("compare them with smad gap checkup once each is recorded good twice")
        return [f"{len(r.lines)} runs repeat known-good ones: {why}"]
    return [f"the {len(r.lines)} runs that repeat known-good ones, as a check-up: {r.headline}"]


def advice(verdict: Verdict, asked: str) -> list[tuple[str, str]]:
    """What to do next: commands and why; `asked` are the arguments as a shell takes them."""
    v = verdict
    if v.outcome == REFUSED:
        return [("", "correct what is refused above, and ask again")]
    out = []
    confused = any(len(c.credible_places) > 1 or len(c.credible_names) > 1 for c in v.causes)
    if confused and v.question == DIFFERS:
        out.append((f"smad gap next {asked}", "which run would tell the rivals apart"))
    if v.models and v.outcome in (CAUSES, PARAMETERS):
        out.append((f"smad gap diagnose {asked} --apply better.toml", "write the better model"))
        out.append(
            ("smad gap verify NEW-RUNS --model better.toml", "try it on runs it has not seen")
        )
    return out
