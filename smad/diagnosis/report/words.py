"""A verdict in plain words: what a terminal shows."""

from __future__ import annotations

from collections.abc import Sequence

from smad.diagnosis.verdict import (
    CHECK_UP,
    DIFFERS,
    PARAMETERS,
    PLACES,
    QUIET,
    REFUSED,
    ParameterTold,
    PlaceTold,
    SignalGap,
    Verdict,
)

_NEAR = 3
_MOVED = 4
_UNSEEN = 4


def lines(verdict: Verdict) -> list[str]:
    """The verdict in plain words, the headline first; lines that begin with a space are tables."""
    v = verdict
    out = [v.headline]
    out += [f"{f.run}: {f.text}" for f in v.findings if f.refuses or f.run == "all runs"]
    if v.outcome == REFUSED:
        return out
    if v.outcome != QUIET and v.question == DIFFERS:
        out.append(f"  parameters: other values take {100 * v.parameters_take:.0f} % of the gap")
    if v.question == CHECK_UP:
        out += parameter_lines(v.parameters)
    for place in v.places:
        out += place_lines(place, _of(v))
    out += budget_lines((*v.budget, *([v.whole] if v.whole else [])), v.question)
    if v.by_run and (apart := [r.run for r in v.by_run if r.contradicts]):
        out.append(f"of another state than the other runs: {', '.join(apart)}; ask without them")
    if v.whole is not None and v.budget:
        most = max(v.by_run, key=lambda r: r.final)
        out.append(f"judged on {v.judged_on}; the largest gap that is left is in {most.run}")
    if v.repeated is not None:
        out += repeated_lines(v)
    if v.unseen:
        shown = v.unseen[:_UNSEEN]
        out.append("these runs would not have shown (all of it on the page)")
        out += [f"  {text}" for text in shown]
    return [*out, *v.notes]


def _of(verdict: Verdict) -> str:
    return "what the parameters leave" if verdict.question == DIFFERS else "the change"


def parameter_lines(parameters: Sequence[ParameterTold]) -> list[str]:
    """The parameters that moved most, beside their deviation."""
    return [
        f"  {'moved' if not k else '':<6} {q.name} {q.before:.4g} -> {q.after:.4g} ± {q.sd:.2g} "
        f"{'' if q.unit == '1' else q.unit}".rstrip()
        for k, q in enumerate(parameters[:_MOVED])
    ]


def place_lines(told: PlaceTold, of: str = "the change") -> list[str]:
    """One answer in words: where, which law, what name."""
    out = [
        f"  where  {told.words}: {100 * told.share:.0f} % of {of}, on runs left out; "
        f"probability {told.probability:.2f}"
    ]
    rivals = list(zip(told.near, told.probabilities[1:], strict=True))
    out += [f"         or {near}, probability {p:.2f}" for near, p in rivals[:_NEAR]]
    if len(told.near) > _NEAR:
        out.append(f"         or {len(told.near) - _NEAR} more places")
    for k, term in enumerate(told.read):
        out.append(f"  {'law' if not k else '':<5}  {term.text}")
    if not told.in_simulator:
        out.append("         in the simulator it does not bring the runs nearer: read it as a hint")
    return [*out, f"  name   {name_words(told)}"]


def name_words(told: PlaceTold) -> str:
    """What a place's law is called, and how far that goes."""
    takes = f"takes {100 * min(told.takes, 1.0):.0f} % of what the law takes"
    if told.name:
        values = ", ".join(f"{q} = {x:.3g}" for q, x in told.values[told.name].items())
        return f"{told.name} ({values}){_likely(told, told.name)}; it {takes}"
    if told.nearest:
        near = f"{told.nearest}{_likely(told, told.nearest)}"
        return f"none that is sure; the nearest there, {near}, {takes}"
    return "none: no effect of the library acts there"


def _likely(told: PlaceTold, name: str) -> str:
    """The probability of a name, and the other effects that it may be."""
    if name not in told.names:
        return ""
    others = [f"{n} {p:.2f}" for n, p in told.names.items() if n != name][:_NEAR]
    beside = f", or {', '.join(others)}" if others else ""
    return f", probability {told.names[name]:.2f}{beside}"


def budget_stages(question: str) -> tuple[str, str]:
    """What a question's budget is of, and what its second column has less."""
    if question == CHECK_UP:
        return "now − then", "less days"
    return "measured − predicted", "parameters"


def budget_lines(rows: Sequence[SignalGap], question: str) -> list[str]:
    """Where the gap goes, signal by signal."""
    if not rows:
        return []
    (of, less), laws = budget_stages(question), bool(rows[0].places)
    head = f"  {'RMS of ' + of:<29} {'raw':>9} {less:>10}"
    head += f" {'and laws':>9}" * laws + f" {'floor':>9}"
    out = [head]
    for s in rows:
        line = f"  {s.signal:<21} {s.unit:<7} {s.raw:>9.3g} {s.parameters:>10.3g}"
        line += f" {s.final:>9.3g}" * laws + f" {s.floor:>9.3g}"
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
        return [("", "mend what is refused above, and ask again")]
    out = []
    if any(p.near for p in v.places) and v.question == DIFFERS:
        out.append((f"smad gap next {asked}", "which run would tell places apart"))
    if v.models and v.outcome in (PLACES, PARAMETERS):
        out.append((f"smad gap diagnose {asked} --apply better.toml", "write the better model"))
        out.append(
            ("smad gap verify NEW-RUNS --model better.toml", "try it on runs it has not seen")
        )
    return out
