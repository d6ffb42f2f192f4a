"""What a campaign found: a row for each fault, as a terminal table, a page and JSON."""

from __future__ import annotations

import dataclasses
import enum
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from campaign.faults.oracle import CLAUSES, Outcome, Violation, judge
from smad.report.page import Page, Section, Table, Text
from smad.version import VERSION

_HEADER = (
    "fault", "group", "injections", "passed", "stopped",
    "safe p50 s", "safe p99 s", "safe max s", "heat max J", "budget J", "closest", "wire max °C",
)  # fmt: skip
_NUMERIC = frozenset(range(2, len(_HEADER)))
_PAIR = "pair"


@dataclass(frozen=True)
class Judged:
    """An outcome and the clauses it breaks."""

    outcome: Outcome
    violations: tuple[Violation, ...]


@dataclass(frozen=True)
class Summary:
    """All injections of one fault, or of one group. Times in s; NaN where nothing stopped."""

    name: str
    group: str
    count: int
    passed: int
    stopped: int
    safe_p50_s: float
    safe_p99_s: float
    safe_max_s: float
    heat_max_J: float
    budget_J: float
    """Budget of the injection that came closest to its own."""
    heat_over_budget: float
    """Largest share of its budget that an injection used."""
    hottest_degC: float
    """The hottest that a wire was."""


@dataclass(frozen=True)
class CampaignRun:
    """One run of the campaign: what was asked for, when, how long it took, and every outcome."""

    seed: int
    when: str
    took_s: float
    command: str
    results: tuple[Judged, ...]

    @property
    def failures(self) -> tuple[Judged, ...]:
        """Those that break a clause."""
        return tuple(result for result in self.results if result.violations)


def judged(outcome: Outcome) -> Judged:
    """An outcome with the oracle's verdict."""
    return Judged(outcome, tuple(judge(outcome)))


def percentile(values: Sequence[float], share: float) -> float:
    """The smallest value that at least `share` of all are not above; NaN for none."""
    if not values:
        return math.nan
    ordered = sorted(values)
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)]


def summary_of(name: str, group: str, results: Sequence[Judged]) -> Summary:
    """The row of some results; `results` must not be empty."""
    outcomes = [result.outcome for result in results]
    safe_s = [o.safe_after_s for o in outcomes if o.safe_after_s is not None]
    closest = max(outcomes, key=lambda o: o.energy_J / o.expected.budget_J)
    return Summary(
        name=name,
        group=group,
        count=len(results),
        passed=sum(not result.violations for result in results),
        stopped=len(safe_s),
        safe_p50_s=percentile(safe_s, 0.50),
        safe_p99_s=percentile(safe_s, 0.99),
        safe_max_s=max(safe_s, default=math.nan),
        heat_max_J=max(o.energy_J for o in outcomes),
        budget_J=closest.expected.budget_J,
        heat_over_budget=closest.energy_J / closest.expected.budget_J,
        hottest_degC=max(o.hottest_degC for o in outcomes),
    )


def by_fault(results: Sequence[Judged]) -> list[Summary]:
    """A row for each fault, in the order they were run; all pairs in one row."""
    by_fault: dict[tuple[str, str], list[Judged]] = {}
    for result in results:
        outcome = result.outcome
        name = "two at once" if outcome.group == _PAIR else outcome.name
        by_fault.setdefault((name, outcome.group), []).append(result)
    return [summary_of(name, group, some) for (name, group), some in by_fault.items()]


def by_group(results: Sequence[Judged]) -> list[Summary]:
    """A row for each group of faults, and one for all."""
    by_group: dict[str, list[Judged]] = {}
    for result in results:
        by_group.setdefault(result.outcome.group, []).append(result)
    rows = [summary_of(group, group, some) for group, some in by_group.items()]
    return [*rows, summary_of("all", "", results)] if rows else []


def table_of(summaries: Sequence[Summary], caption: str = "") -> Table:
    """The rows as a table."""
    return Table(_HEADER, [_cells(row) for row in summaries], caption, _NUMERIC)


def failure_lines(run: CampaignRun) -> list[str]:
    """What failed, one line each, with all that is needed to run it again."""
    return [
        f"{r.outcome.injected} while {r.outcome.scene}: "
        + "; ".join(f"{v.clause}: {v.reason}" for v in r.violations)
        for r in run.failures
    ]


def verdict(run: CampaignRun) -> str:
    """The run in one line."""
    count, failed = len(run.results), len(run.failures)
    text = f"{count} injections, seed {run.seed}, {run.took_s:.0f} s: "
    return text + (f"{failed} broke the oracle" if failed else "the oracle holds for every one")


def page_of(run: CampaignRun) -> Page:
    """The report as a page."""
    failed = failure_lines(run)
    sections = [
        Section("By class", [table_of(by_group(run.results))], "class"),
        Section("By fault", [table_of(by_fault(run.results), _CAPTION)], "fault"),
        Section(
            "What failed",
            [Text(line, "warning") for line in failed] or [Text("Nothing.")],
            "failed",
        ),
        Section("The oracle", [Text(f"Clauses: {', '.join(CLAUSES)}."), Text(_ORACLE)], "oracle"),
    ]
    facts = [("smad", VERSION), ("date", run.when), ("command", run.command)]
    return Page("Fault campaign", sections, verdict(run), facts)


def json_of(run: CampaignRun) -> str:
    """Everything, as JSON text; a time that does not exist is null."""
    data = {
        "smad": VERSION,
        "seed": run.seed,
        "when": run.when,
        "took_s": run.took_s,
        "command": run.command,
        "groups": [_plain(dataclasses.asdict(row)) for row in by_group(run.results)],
        "faults": [_plain(dataclasses.asdict(row)) for row in by_fault(run.results)],
        "outcomes": [_plain(dataclasses.asdict(result)) for result in run.results],
    }
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


_CAPTION = (
    "Time to safe is from the onset until the gate is off. Heat is what went into both springs "
    "from the onset until then, or, where nothing had to stop, until the end of watching. "
    "Closest: the largest share of its budget that an injection used; the budget is that one's."
)
_ORACLE = (
    "Heat after the onset stays below the budget; no wire gets hotter than tube and cement stand; "
    "the first fault names the cause, or there is "
    "none where none is due; nothing heats again by itself, but out of HOLD within half a second; "
    "the run log can be read with every flushed sample; exit status and last line of the daemon "
    "tell the truth; who must be refused is."
)


def _cells(row: Summary) -> tuple[str, ...]:
    return (
        row.name,
        row.group,
        str(row.count),
        str(row.passed),
        str(row.stopped),
        _number(row.safe_p50_s, 2),
        _number(row.safe_p99_s, 2),
        _number(row.safe_max_s, 2),
        _number(row.heat_max_J, 1),
        _number(row.budget_J, 1),
        f"{row.heat_over_budget:.0%}",
        _number(row.hottest_degC, 0),
    )


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"


def _plain(value: Any) -> Any:
    match value:
        case dict():
            return {key: _plain(item) for key, item in value.items()}
        case list() | tuple():
            return [_plain(item) for item in value]
        case enum.Enum():
            return value.name
        case float() if not math.isfinite(value):
            return None
        case _:
            return value
