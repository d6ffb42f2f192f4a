"""A verdict in plain words: what a terminal shows.

The headline first, then the table of rivals, what it is and where, and where the gap goes. A page
shows the same, and more on demand.
"""

import math
import re
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

from smad.counted import counted, listed
from smad.diagnosis.plant import Effect
from smad.diagnosis.verdict import (
    AT_FLOOR,
    CAUSES,
    CHECK_UP,
    COLUMN_DOUBTED,
    PAIRED,
    PARAMETERS,
    REFUSED,
    UNEXPLAINED,
    Cause,
    Finding,
    ParameterMoved,
    RivalGap,
    SignalGap,
    Verdict,
)
from smad.progress import Say
from smad.units import in_words, with_unit

_FACTS = (
    "note", "gaps", "no reading", "repeated", "samples lost", "truncated", "channel missing",
    "channel empty", "channel not shared",
)  # fmt: skip
"""Kinds of findings that say what was read and done; all others are doubts."""
_NUMBER = re.compile(r"-?\d[\d.]*(e[-+]?\d+)?")
_PLURALS = {"holds": "hold", "is": "are", "stays": "stay", "jumps": "jump", "repeats": "repeat"}
"""Verbs that follow the name of a column, after several names."""
_RUNS = 6
_MOVED = 4
_UNSEEN = 4
_RIVALS = 5
_NO_BETTER = 0.99
_NAMES = 4
_LIKELY = 0.05


def lines(verdict: Verdict) -> list[str]:
    """The verdict in plain words, the headline first; lines that begin with a space are tables."""
    v = verdict
    out = [v.headline]
    out += finding_lines(v.findings, doubtful=True)
    facts = finding_lines(v.findings, doubtful=False)
    if v.outcome == REFUSED:
        return [*out, *v.notes, *facts]
    if steps := gap_by_cause(v):
        out += ["  floors left  with", *(f"  {gap:>11.3g}  {what}" for gap, what in steps)]
    for cause in v.causes:
        out += _cause_lines(cause)
    if not v.causes:
        out += _rival_lines(v.rivals)
    if v.outcome in (PARAMETERS, UNEXPLAINED) or v.question == CHECK_UP:
        out += _parameter_lines(v.parameters)
    out += budget_lines((*v.budget, v.whole) if v.whole else (), v.gaps_of)
    out += judged_lines(v)
    if v.unseen:
        out.append("these runs would not have shown (the page lists all of them)")
        out += [f"  {text}" for text in v.unseen[:_UNSEEN]]
    return [*out, *v.notes, *facts]


def finding_lines(findings: Sequence[Finding], *, doubtful: bool) -> list[str]:
    """Findings that refuse or doubt a run, or else those on what was read, done and left out.

    Findings that differ only in the run, or in the column that their text begins with, share a
    line; facts also if they differ in numbers.
    """
    groups: dict[tuple[str, str], list[Finding]] = {}
    for f in findings:
        if doubtful == (f.refuses or f.kind not in _FACTS):
            _, _, rest = f.text.partition(" ")
            alike = rest if doubtful else _NUMBER.sub("#", rest)
            groups.setdefault((f.kind, alike), []).append(f)
    order = sorted(groups.values(), key=lambda f: (not f[0].refuses, f[0].kind != COLUMN_DOUBTED))
    return [_line(alike) for alike in order]


def findings_to(say: Say) -> Callable[[Sequence[Finding]], None]:
    """A callback that passes the lines of findings to `say`, the doubtful ones first."""

    def say_all(findings: Sequence[Finding]) -> None:
        for doubtful in (True, False):
            for text in finding_lines(findings, doubtful=doubtful):
                say(text)

    return say_all


def _line(alike: Sequence[Finding]) -> str:
    """One line for findings that are alike: their runs, their columns, the numbers of the first."""
    runs = list(dict.fromkeys(f.run for f in alike))
    begins = list(dict.fromkeys(f.text.partition(" ")[0] for f in alike))
    rest = alike[0].text.partition(" ")[2]
    if len(begins) > 1:
        verb, _, more = rest.partition(" ")
        rest = f"{_PLURALS.get(verb, verb)} {more}"
    alone = len({f.text.partition(" ")[2] for f in alike}) == 1
    return f"{listed(runs, _RUNS)}: {', '.join(begins)} {rest}" + (
        "" if alone else f" (the first of {len(alike)} alike)"
    )


def gap_by_cause(v: Verdict) -> list[tuple[float, str]]:
    """Floors left with other parameters, and with each cause more; empty for a single cause."""
    if v.whole is None or len(v.causes) < 2:
        return []
    steps = [(v.whole.parameters, "parameters alone")]
    for k, cause in enumerate(v.causes):
        what = f"{cause.name} at the {cause.words}" if cause.name else cause.short
        steps.append((cause.gap, f"{'+ ' * (k > 0)}{what}"))
    return steps


def rival_heading(cause: Cause) -> str:
    """The heading of the column of rivals of a cause: beside what they were fitted, if anything."""
    beside = " and ".join(cause.beside)
    return f"rival, beside {beside}" if beside else "rival"


def _cause_lines(cause: Cause) -> list[str]:
    """One cause: its table of rivals, its values or its law, and how sure name and place are."""
    return [
        *_rival_lines(cause.rivals, rival_heading(cause), cause.named),
        *_entry("values", [v.text for v in cause.values if cause.refitted]),
        *_entry("law", cause.law_lines),
        *_entry("alike", list(dict.fromkeys(t.alike for t in cause.read if t.alike))),
        *_entry("name", [name_words(cause)]),
        *_entry("place", [place_words(cause)]),
    ]


def name_words(cause: Cause) -> str:
    """Which effect it is if the library has it, and how likely the library does not."""
    if not cause.names:
        return "no effect of the library comes near"
    first = [n for n, p in cause.names.items() if p >= _LIKELY][:_NAMES]
    shown = [n for n in cause.names if n in first or n in cause.named]
    likely = ", ".join(f"{n} {cause.names[n]:.2f}" for n in shown)
    if cause.outside > 0.5:
        return f"not in the library: {cause.outside:.2f}; if it is there, {likely}"
    return f"{likely}, if it is in the library; not in the library: {cause.outside:.2f}"


def place_words(cause: Cause) -> str:
    """The likely places."""
    likely = {n: p for n, p in cause.places.items() if p >= _LIKELY or n == cause.place}
    return ", ".join(f"{cause.place_words.get(n, n)} {p:.2f}" for n, p in likely.items())


def _rival_lines(
    rivals: Sequence[RivalGap], heading: str = "rival", named: Sequence[str] = ()
) -> list[str]:
    """The table of rivals: what each leaves of the judged runs, and its probability."""
    if not rivals:
        return []
    return [
        f"  floors left  probability  {heading}",
        *(
            f"  {r.gap:>11.3g}  {r.probability:>11.2f}  "
            + ", ".join((r.words, *(v.text for v in r.values)))
            for r in first_rivals(rivals, named)
        ),
    ]


def first_rivals(rivals: Sequence[RivalGap], named: Sequence[str]) -> list[RivalGap]:
    """The first rows of a table of rivals, those `named` elsewhere, and those without a part.

    Unlikely ones that leave as much as a rival without a part say nothing.
    """
    without = [r for r in rivals if r.kind in ("nothing", "parameters")]
    most = _NO_BETTER * min((r.gap for r in without), default=math.inf)
    telling = [r for r in rivals if r not in without and (r.gap < most or r.probability >= _LIKELY)]
    shown = [*without, *telling[:_RIVALS], *(r for r in rivals if r.name in named)]
    return [r for r in rivals if r in shown]


def _entry(title: str, rows: Sequence[str]) -> list[str]:
    """Rows under each other beside their title."""
    return [f"  {'' if k else title:<6} {row}" for k, row in enumerate(rows)]


def _parameter_lines(parameters: Sequence[ParameterMoved]) -> list[str]:
    """The parameters that moved most beside their standard deviation."""
    moved = [q for q in parameters if abs(q.after - q.before) > q.sd][:_MOVED]
    return _entry(
        "moved",
        [f"{q.name} from {q.before:.4g} to {with_unit(q.after, q.sd, q.unit)}" for q in moved],
    )


def budget_stages(gaps_of: str, causes: Sequence[str]) -> list[str]:
    """The name of each stage of gaps; `causes` are names."""
    return [
        "change" if gaps_of == PAIRED else "as it was",
        "parameters",
        *(f"+ {c}" for c in causes),
    ]


def budget_lines(rows: Sequence[SignalGap], gaps_of: str) -> list[str]:
    """Where the gap goes, for each signal that shows one, and over all: the last of the rows."""
    if not rows:
        return []
    *signals, whole = rows
    stages = budget_stages(gaps_of, [])
    stages += ["with cause" + "s"[: len(whole.causes) > 1]][: len(whole.causes)]
    above_floor = [s for s in signals if max(s.raw, s.parameters, s.final) > AT_FLOOR * s.floor]
    out = [f"  {'RMS of ' + gaps_of:<29}" + "".join(f" {x:>11}" for x in (*stages, "floor"))]
    for s in (*above_floor, whole):
        numbers = (*(s.raw, s.parameters, s.final)[: len(stages)], s.floor)
        row = "".join(f" {x:>11.3g}" for x in numbers)
        out.append(f"  {s.signal:<21} {in_words(s.unit):<7}{row}")
    if rest := len(signals) - len(above_floor):
        every = f"all {rest} signals" if rest > 1 else "the only signal"
        others = counted(rest, "other signal") if above_floor else every
        out.insert(-1, f"  {others} at the floor")
    return out


def verified_records(rows: Sequence[SignalGap]) -> list[dict[str, str | float]]:
    """What `smad gap verify` says of each signal, for a script."""
    return [
        {"signal": r.signal, "unit": r.unit, "before": r.raw, "after": r.final, "floor": r.floor}
        for r in rows
    ]


def verified_lines(rows: Sequence[SignalGap]) -> list[str]:
    """The same for a reader, the heading first."""
    return [
        f"{'RMS of measured − predicted':<29} {'before':>9} {'after':>9} {'floor':>9}",
        *(
            f"{r.signal:<21} {in_words(r.unit):<7} {r.raw:>9.3g} {r.final:>9.3g} {r.floor:>9.3g}"
            for r in rows
        ),
    ]


def library_lines(effect: Effect) -> list[str]:
    """An effect of the library: where it acts, its values, and what else looks like it."""
    parameters = []
    for q in effect.parameters:
        high = f"{q.high:g}" + (f" {q.unit}" if q.unit != "1" else "")
        span = f"{q.low:g} to {high}, typically {q.typical:g}"
        parameters.append(f"    {q.name}: {span}: {q.meaning}")
    return [
        f"{effect.name}  ({effect.sub_model}: {', '.join(effect.signals)})",
        f"    {effect.title}: {effect.equation}",
        f"    places: {', '.join(effect.places)}",
        *parameters,
        f"    confused with: {', '.join(effect.confused_with) or 'nothing known'}",
        f"    separated by: {effect.separates}",
        f"    source: {effect.reference}",
    ]


def judged_lines(v: Verdict) -> list[str]:
    """What the gaps were judged on."""
    if not v.by_run:
        return []
    most = max(v.by_run, key=lambda r: r.final)
    largest = f"; the largest gap left is in {most.run}" if len(v.by_run) > 1 else ""
    return [f"judged on {v.judged_on}{largest}"]


def advice(
    verdict: Verdict, arguments: str, json_path: Path | None = None, model_path: Path | None = None
) -> list[tuple[str, str]]:
    """What to do next: commands and why.

    `arguments` are the arguments as a shell takes them, a mapping of columns at their end, or the
    baseline of a check-up. The files are those that the verdict and the better model are written
    to.
    """
    v = verdict
    _, option, path = arguments.partition(" --map ")
    mapping = option + path
    if v.outcome == REFUSED:
        return [("", "correct what is refused above, and ask again")]
    undecided = any(len(c.credible_places) > 1 or len(c.credible_names) > 1 for c in v.causes)
    if v.question == CHECK_UP:
        same = "with the same --sim and --effect, or --bench and --axis"
        why = f"measure more until one cause is left, {same}"
        return [(f"smad gap investigate {arguments}", why)] if undecided else []
    out = []
    if undecided:
        out.append((f"smad gap next {arguments}", "which run would tell the rivals apart"))
    if v.models and v.outcome in (CAUSES, PARAMETERS):
        model = shlex.quote(str(model_path or "better.toml"))
        if model_path is None:
            apply = f"smad gap diagnose {arguments} --apply {model}"
            if json_path is not None:
                apply = f"smad gap apply {shlex.quote(str(json_path))} --out {model}"
            out.append((apply, "write the better model"))
        verify = f"smad gap verify NEW-RUNS --model {model}{mapping}"
        out.append((verify, "try it on runs it has not seen"))
    return out
