"""The diagnosis as one HTML page. Everything shown is in the JSON file too."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from smad.gap.records import Budget, Diagnosis, Outcome, ParameterRecord, ValueRecord
from smad.gap.report import figures
from smad.gap.report.advice import Asked, advice
from smad.gap.report.plain import repeated_lines
from smad.gap.report.terms import TERMS, agreement_table, budget_remarks, budget_table, with_unit
from smad.gap.settings import enough_d2
from smad.report.page import Block, Code, Page, Picture, Section, Table, Text, text_table

_TITLES = {
    Outcome.NO_GAP: "No gap",
    Outcome.PARAMETERS: "Parameters only",
    Outcome.EFFECT: "Cause found",
    Outcome.AMBIGUOUS: "Cause not separable with these runs",
    Outcome.PLUS_REST: "Cause found, with an unexplained rest",
    Outcome.UNKNOWN: "Unknown cause",
    Outcome.NO_EXCITATION: "Not enough excitation",
    Outcome.REFUSED: "Runs refused",
    Outcome.CONTRADICTING: "Runs contradict each other",
}
_SETTLED = (Outcome.NO_GAP, Outcome.PARAMETERS, Outcome.EFFECT)


def page_of(d: Diagnosis, asked: Asked | None = None) -> Page:
    """The whole report: answer, what to do next, numbers, evidence; and its terms.

    `asked` says how the diagnosis was asked for, so that commands can be copied.
    """
    kind = "note" if d.verdict.outcome in _SETTLED else "warning"
    answer = [Text(d.verdict.plain, kind), *map(Text, repeated_lines(d))]
    sections = [
        Section("Answer", answer, "answer"),
        Section("What to do next", _next(d, asked), "next"),
        Section("The numbers", _verdict(d), "numbers"),
    ]
    if d.waterfall:
        sections += [
            Section("How much goes at each step", _waterfall(d), "waterfall"),
            Section("Where it is", _place(d), "where"),
            Section("Measured and simulated, on runs held out", [*figures.overlays(d)], "overlays"),
            Section("Candidates", _candidates(d), "candidates"),
            Section("Parameters", _parameters(d), "parameters"),
            Section("What is left in the residuals", _residuals(d), "residuals"),
        ]
    sections += [
        Section("Runs, and what was refused", _runs(d), "runs"),
        Section("Limits, settings and versions", _limits(d), "limits"),
        Section("Terms of this page", [Table(("term", "meaning"), TERMS)], "terms"),
    ]
    facts = [
        ("plant", f"{d.plant} {d.plant_version}"),
        ("question", d.question),
        ("judged on", d.judged_on),
        ("time", f"{d.seconds:.0f} s"),
    ]
    return Page(f"Gap diagnosis: {_TITLES[d.verdict.outcome]}", sections, "", facts)


def _next(d: Diagnosis, asked: Asked | None) -> list[Block]:
    steps = advice(d, asked)
    if not steps:
        return [Text("Nothing needs to be done.")]
    lines = [f"{s.command}    # {s.why}" if s.command else f"# {s.why}" for s in steps]
    return [Code("\n".join(lines))]


def _verdict(d: Diagnosis) -> list[Block]:
    limit = enough_d2(d.settings["odds"])
    return [
        *_table("The gap of each run to fit, before pooling", *agreement_table(d.agreement)),
        *([] if d.budget is None else _budget(d.budget)),
        *_table("The numbers behind it", ("", ""), _numbers(d.verdict.text)),
        *_table(
            "Parameters of the cause, fitted together with those of the model",
            ("effect", "parameter", "value", "fit interval", ""),
            [
                (x.effect, x.name, with_unit(f"{x.value:.4g}", x.unit), _interval(x), _remark(x))
                for x in d.values
            ],
            {2, 3},
        ),
        *_table(
            "Experiments that would tell the remaining causes apart, best first; "
            f"{limit:.0f} is {limit**0.5:.1f} standard errors. Of the d² that the models predict "
            "only a part can be counted on, by how much more than they say the runs vary along it; "
            "together is that of this experiment and those above it",
            ("experiment", "duration", "d² predicted", "counted", "together", "run it"),
            [
                (x.title, f"{x.duration_s:.0f} s", f"{x.separation:.0f}",
                 _number(x.counted, ".1f"), _number(x.together, ".1f"), x.command)
                for x in d.experiments
            ],
            {1, 2, 3, 4},
        ),
    ]  # fmt: skip


def _numbers(text: str) -> list[tuple[str, str]]:
    """Name and value of every line; all of a text without names is a value."""
    parts = [line.partition(": ") for line in text.splitlines()]
    return [(name, what) if what else ("", name) for name, _, what in parts]


def _table(
    caption: str,
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    numeric: Iterable[int] = (),
) -> list[Block]:
    """A table, or nothing where it has no rows."""
    return [Table(header, rows, caption, frozenset(numeric))] if rows else []


def _budget(budget: Budget) -> list[Block]:
    by_run = [*budget.runs, budget.median] if budget.median else []
    return [
        budget_table(
            budget,
            "Where the gap goes, on the runs judged. Gaps are in noise floors; the shares of the "
            "gap at first add up to 100 %. The noise itself is 1 floor in every signal.",
        ),
        *_table(
            "The same, run by run",
            ("run", "gap at first", "after the parameters", "at last"),
            [(r.run, *(f"{x:.2f}×" for x in (r.raw, r.refit, r.final))) for r in by_run],
            {1, 2, 3},
        ),
        *(Text(line) for line in budget_remarks(budget)),
    ]


def _interval(x: ValueRecord | ParameterRecord) -> str:
    return f"{x.low:.4g} … {x.high:.4g}"


def _remark(x: ValueRecord) -> str:
    if x.at_bound:
        return "at the bound of its range"
    return "" if x.identifiable else "not told by these runs"


def _waterfall(d: Diagnosis) -> list[Block]:
    rows = [r for r in d.waterfall if r.view == "open loop"]
    width = max((len(r.effects) for r in rows), default=0)
    labels = [f"with {' + '.join(names)}" for names in d.steps]
    return [
        Text(
            "The gap of a signal is the root of its excess mean square error over the noise floor, "
            f"in floors, on {d.judged_on}. The refit moves the parameters of the "
            "model only: what it removes is not credited to any effect."
        ),
        Picture(
            figures.waterfall(d),
            "All signals together: as configured, after the refit, after each effect.",
        ),
        Table(
            ("signal", "floor", "raw", "after refit", *labels[:width]),
            [
                (
                    r.output or "all",
                    f"{r.floor:.3g} {r.unit}" if r.output else "",
                    *(f"{gap:.2f}×" for gap in (r.raw, r.refit, *r.effects)),
                )
                for r in rows
            ],
            "The whole simulator, open loop: recorded inputs only. Each sub-model alone, fed with "
            "measured neighbours, is what was fitted and judged, and what the numbers above tell",
            frozenset(range(1, 4 + width)),
        ),
    ]


def _place(d: Diagnosis) -> list[Block]:
    return [
        Text(
            "Excess error by sub-model, side and regime, in floors, after the refit and after the "
            "best model; early and late are the halves of each run."
        ),
        Picture(figures.heat_map(d), "Heat map before and after."),
        *_table(
            "The stretches that carry most of it, after the refit",
            ("run", "signal", "window", "share of all excess error"),
            [
                (w.run, w.output, f"{w.start_s:.1f} – {w.stop_s:.1f} s", f"{w.share:.0%}")
                for w in d.windows
            ],
            {3},
        ),
    ]


def _number(x: float | None, form: str) -> str:
    return "–" if x is None else format(x, form)


def _candidates(d: Diagnosis) -> list[Block]:
    return [
        Text(
            "Gain is a rise in log-likelihood. Masked is the share of an effect's signature that "
            "the refitted parameters can imitate on these runs; visible is what is left of it at "
            "its typical strength, in floors: under about 4 these runs could not show it."
        ),
        Table(
            (
                "effect", "part", "screened gain", "masked", "visible", "held-out gain",
                "S on its signals", "probability",
            ),
            [
                (
                    f"{c.title} [{c.name}]",
                    c.sub_model,
                    f"{c.screen_gain:.0f}",
                    f"{c.masked:.0%}",
                    f"{c.visible:.0f}",
                    "–" if c.gain is None else f"{c.gain:.0f} ± {c.gain_se or 0.0:.0f}",
                    _number(c.shrink, ".2f"),
                    _number(c.probability, ".2f"),
                )
                for c in d.candidates
            ],
            "The library, best first; the part below the fitted ones was not worth a fit",
            frozenset(range(2, 9)),
        ),
    ]  # fmt: skip


def _parameters(d: Diagnosis) -> list[Block]:
    said = (
        "Profiles: rise of the negative log-likelihood with all else refitted; the dashed "
        "line is the 95 % level. A flat profile means that the runs do not fix the value."
    )
    profiled = any(len(v.profile) > 1 for v in d.values)
    return [
        *([Picture(figures.profiles(d), said)] if profiled else []),
        *_table(
            "Parameters of the model; intervals by bootstrap over runs, blocks and priors",
            ("parameter", "before", "after refit", "with the effects", "fit interval", ""),
            [
                (p.name, f"{p.before:.4g}", f"{p.refit:.4g}", with_unit(f"{p.final:.4g}", p.unit),
                 _interval(p), "at its bound" if p.at_bound else "")
                for p in d.parameters
            ],
            {1, 2, 3, 4},
        ),
        *_table(
            "Laws that the known-good runs ask for; they move with a refit that replaces them",
            ("law", "value", "in the known-good runs", "now"),
            [
                (x.law, x.name, f"{x.before:.4g}", with_unit(f"{x.after:.4g}", x.unit))
                for x in d.laws
            ],
            {2, 3},
        ),
    ]  # fmt: skip


def _residuals(d: Diagnosis) -> list[Block]:
    return [
        Text(
            "Diagnostics, not the verdict: when the true law differs in form from the one in the "
            "library, residuals stay coloured after a correct attribution."
        ),
        Table(
            ("signal", "test", "statistic", "p"),
            [
                (t.output, t.test, f"{t.statistic:.3g}", f"{t.p_value:.2g}")
                for t in d.residual_tests
            ],
            "Residuals of the final model on the longest run",
            frozenset({2, 3}),
        ),
    ]


def _runs(d: Diagnosis) -> list[Block]:
    missing = "Switched off for want of a signal: " + "; ".join(d.missing) + "."
    return [
        *_table(
            "",
            ("run", "used as", "duration", "SHA-256 of its data"),
            [(r.name, r.role, f"{r.duration_s:.1f} s", r.sha256[:16]) for r in d.runs],
            {2},
        ),
        *_table(
            "Findings of the admission",
            ("run", "finding", "what", "consequence"),
            [
                (f.run, f.kind, f.text, "refused" if f.refuses else "used with care")
                for f in d.findings
            ],
        ),
        *([Text(missing)] if d.missing else []),
        *_table(
            "Noise floor of each channel, after averaging to the analysis grid",
            ("channel", "noise floor", "from"),
            [(f.channel, f"{f.sigma:.3g} {f.unit}", f.source) for f in d.floors],
            {1},
        ),
    ]


def _limits(d: Diagnosis) -> list[Block]:
    facts = [f"{k} {v}" for k, v in d.versions.items()]
    facts += [f"{k} = {v}" for k, v in d.settings.items()]
    return [*map(Text, d.limits), Code("\n".join(facts))]


def summary_lines(d: Diagnosis, asked: Asked | None = None) -> Sequence[str]:
    """The verdict for a terminal: headline, answer, next steps, budget, numbers, findings.

    Lines that begin with two spaces keep their form; the others may be wrapped.
    """
    v = d.verdict
    lines = [_TITLES[v.outcome], v.plain, *repeated_lines(d)]
    lines += [f"{f.run}: {f.kind}: {f.text}" for f in d.findings if f.kind != "channel missing"]
    steps = advice(d, asked)
    if steps:
        lines += ["", "Next:"]
    for step in steps:
        lines += [f"  # {step.why}", *([f"  {step.command}"] if step.command else [])]
    if len(d.agreement) > 1:
        header, rows = agreement_table(d.agreement)
        by_run = text_table(Table(header, rows, "", frozenset({1})))
        lines += ["", "Gap by run, before they are pooled, in noise floors:"]
        lines += [f"  {line}" for line in by_run.splitlines()]
    if d.budget is not None:
        table = text_table(budget_table(d.budget))
        lines += ["", f"Where the gap goes, on {d.judged_on}, in noise floors:"]
        lines += [f"  {line}" for line in table.splitlines()]
        lines += budget_remarks(d.budget)
    return [*lines, "", *v.text.splitlines()]
