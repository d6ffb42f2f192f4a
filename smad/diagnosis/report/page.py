"""An answer as one HTML page: headline, rivals and one figure; laws below; the rest on demand."""

from collections.abc import Sequence
from pathlib import Path

from smad.diagnosis.answer import Answer
from smad.diagnosis.report import figures
from smad.diagnosis.report.words import (
    advice,
    budget_stages,
    finding_lines,
    first_rivals,
    gap_by_cause,
    judged_lines,
    name_words,
    place_words,
    rival_heading,
)
from smad.diagnosis.verdict import CHECK_UP, DIFFERS, Cause, RivalGap, Verdict
from smad.report.page import Beside, Block, Code, Page, Section, Table, Text, write_page
from smad.units import in_words, labelled, with_unit

_QUESTIONS = {
    DIFFERS: "what the simulator lacks",
    CHECK_UP: "what has changed, with the same inputs",
}
_CHANGED = "what is new since the good runs"
_FLOORS = {
    DIFFERS: "the noise of a reading and 0.1 % of its swing",
    CHECK_UP: "the difference between good repeats",
}


def page_of(
    answer: Answer,
    arguments: str = "",
    facts: Sequence[tuple[str, str]] = (),
    files: tuple[Path | None, Path | None] = (None, None),
) -> Page:
    """The page. `arguments` are the arguments as a shell takes them, `facts` files and the like;
    `files` are those of verdict and model, if they are written."""
    v, search = answer.verdict, answer.search
    every = [r for c in v.causes for r in c.rivals] or v.rivals
    cells: list[Sequence[Block]] = [_answer(v)]
    more = None
    if search is not None:
        course = figures.Course.of(answer, search)
        cells.append([figures.largest_gap(course), *figures.laws(answer, search)])
        more = figures.more_signals(course)
    sections = [Section("", [Beside(cells)])]
    folded: list[tuple[str, Sequence[Block]]] = [
        ("The gap by signal", [_budget(v)] if v.budget else []),
        ("Each rival, signal by signal", [_by_signal(v, every)] if every else []),
        ("More signals", [more] if more else []),
        ("Parameters", [_parameters(v)] if v.parameters else []),
        ("What these runs would not have shown", [_unseen(v)] if v.unseen else []),
        ("Runs", _runs(v)),
        ("What to do next", _next(advice(v, arguments, *files) if arguments else ())),
    ]
    sections += [Section(title, blocks, folded=True) for title, blocks in folded if blocks]
    all_facts = [
        ("question", _QUESTIONS.get(v.question, _CHANGED)),
        ("plant", f"{v.plant} {v.plant_version}"),
        ("computing time", f"{v.seconds:.0f} s" if v.seconds else ""),
        *facts,
    ]
    title, _, gap = (v.headline[:1].upper() + v.headline[1:]).partition("; ")
    lead = gap and f"{gap[0].upper()}{gap[1:]}."
    return Page(title, sections, lead, [(n, x) for n, x in all_facts if x])


def write_report(answer: Answer, path: Path | str) -> Path:
    """Write the page of an answer to a file; returns its path."""
    return write_page(page_of(answer), Path(path))


def _answer(v: Verdict) -> list[Block]:
    out: list[Block] = [Text(line, "warning") for line in finding_lines(v.findings, doubtful=True)]
    floor = _FLOORS.get(
        v.question, "the difference between good runs, or the gap that the simulator leaves in them"
    )
    judged = f"{''.join(judged_lines(v))}. A floor is {floor}."
    caption = f"Each rival is fitted together with the parameters, and {judged}"
    if steps := gap_by_cause(v):
        rows = [(f"{gap:.3g}", what) for gap, what in steps]
        together = "Everything in a row and above it is fitted together with the parameters."
        out.append(Table(("floors left", "with"), rows, together, frozenset((0,))))
    for k, cause in enumerate(v.causes):
        of_step = _moved_since(cause, last=cause is v.causes[-1])
        words = " ".join(filter(None, ("" if k else caption, of_step)))
        heading = rival_heading(cause)
        out += [_rivals(cause.rivals, words, heading, cause.named), _cause(cause)]
    if not v.causes and v.rivals:
        out.append(_rivals(v.rivals, caption))
    return out + [Text(line, "note") for line in v.notes]


def _moved_since(cause: Cause, *, last: bool) -> str:
    """A sentence on what later fits have changed since the table of a cause; empty: nothing."""
    final = ["the values below"] if cause.values and cause.refitted else []
    if last and cause.rival and f"{cause.rival.gap:.3g}" != f"{cause.gap:.3g}":
        final.append(f"{cause.gap:.3g} floors")
    led = "The table is of the step that compared these rivals; later fits led to"
    return f"{led} {' and '.join(final)}." if final else ""


def _rivals(
    rows: Sequence[RivalGap], caption: str, heading: str = "rival", named: Sequence[str] = ()
) -> Table:
    """The table of rivals: what each leaves of the judged runs, its probability, and its values
    where one has any."""
    first = first_rivals(rows, named)
    header = ["floors left", "probability", heading, "values"]
    columns = len(header) if any(r.values for r in first) else len(header) - 1
    table = []
    for r in first:
        title, values = f"{r.words}: {r.title}".removesuffix(": "), (v.text for v in r.values)
        row = (f"{r.gap:.3g}", f"{r.probability:.2f}", title, ", ".join(values))
        table.append(row[:columns])
    return Table(header[:columns], table, caption, frozenset((0, 1)))


def _cause(cause: Cause) -> Table:
    """The final values of a cause, or its law, and how sure its name and its place are."""
    values = [v.text for v in cause.values if cause.refitted]
    rows = [("" if k else "values", text) for k, text in enumerate(values)]
    rows += [("" if k else "law", text) for k, text in enumerate(cause.law_lines)]
    rows += [("name", name_words(cause)), ("place", place_words(cause))]
    return Table(("cause", f"{cause.name or 'a law'} at the {cause.words}"), rows)


def _by_signal(v: Verdict, rows: Sequence[RivalGap]) -> Table:
    """What each rival leaves of each signal, in floors."""
    signals = [s for s in v.budget if any(s.signal in r.by_signal for r in rows)]
    table = [(r.words, *(f"{r.by_signal.get(s.signal, 0.0):.3g}" for s in signals)) for r in rows]
    header = ("floors left", *(s.label for s in signals))
    return Table(header, table, numeric=frozenset(range(1, len(header))))


def _budget(v: Verdict) -> Table:
    """Where the gap goes, signal by signal."""
    stages = budget_stages(v.gaps_of, [c.name or "a law" for c in v.causes])
    rows = [
        (
            labelled(s.label, s.unit),
            *(f"{x:.3g}" for x in (s.raw, s.parameters, *s.causes, s.floor)),
        )
        for s in (*v.budget, *([v.whole] if v.whole else []))
    ]
    header = (f"RMS of {v.gaps_of}", *stages, "floor")
    return Table(header, rows, numeric=frozenset(range(1, len(header))))


def _parameters(v: Verdict) -> Table:
    """The parameters before the fit and in the reported model."""
    rows = [
        (
            q.words or q.name,
            q.name,
            f"{q.before:.5g} {in_words(q.unit)}".rstrip(),
            with_unit(q.after, q.sd, q.unit),
            "at the end of its range" if q.at_bound else "",
        )
        for q in v.parameters
    ]
    header = ("parameter", "name", "as it was", "fitted ± standard deviation", "")
    caption = "The standard deviation is computed from the scatter of these runs."
    return Table(header, rows, caption, frozenset((2, 3)))


def _unseen(v: Verdict) -> Table:
    """For each effect the strength below which these runs would not have shown it."""
    return Table(("effect", "strength"), [tuple(text.rsplit(": ", 1)) for text in v.unseen])


def _runs(v: Verdict) -> list[Block]:
    gaps = {r.run: r for r in v.by_run}
    records = {r.name: r for r in v.runs}
    rows = []
    for name in records or gaps:
        gap, record = gaps.get(name), records.get(name)
        numbers = [f"{x:.1f}" for x in (gap.raw, gap.parameters, gap.final)] if gap else [""] * 3
        about = (
            (record.role, f"{record.duration_s:.0f} s", record.sha256[:16]) if record else ("",) * 3
        )
        rows.append((name, *about[:2], *numbers, about[2]))
    if not rows:
        return []
    stages = budget_stages(v.gaps_of, [])
    header = ("run", "role", "length", *stages, "with cause", "SHA-256")
    table = Table(header, rows, "Gaps in floors, of runs that were judged.", frozenset((3, 4, 5)))
    return [table, *(Text(line, "note") for line in finding_lines(v.findings, doubtful=False))]


def _next(steps: Sequence[tuple[str, str]]) -> list[Block]:
    lines = [f"{command}    # {why}" if command else f"# {why}" for command, why in steps]
    return [Code("\n".join(lines))] if lines else []
