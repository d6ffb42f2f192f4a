"""The table, the page and the JSON of a campaign."""

import json
import math
from dataclasses import replace

from campaign.faults.report import (
    CampaignRun,
    by_fault,
    by_group,
    failure_lines,
    json_of,
    judged,
    page_of,
    percentile,
    table_of,
    verdict,
)
from smad.report.page import render
from smad.view.terminal.tables import in_full

from .test_oracle import STOPPED, WENT_ON

BAD = replace(STOPPED, energy_J=9.0, safe_after_s=0.9)


def run_of(*outcomes: object) -> CampaignRun:
    results = tuple(judged(outcome) for outcome in outcomes)  # type: ignore[arg-type]
    return CampaignRun(7, "2026-01-02 03:04 UTC", 12.0, "python -m campaign faults", results)


def test_a_row_counts_injections_passes_times_and_heat() -> None:
    (row,) = by_fault(run_of(STOPPED, replace(STOPPED, safe_after_s=0.1), BAD).results)
    assert (row.count, row.passed, row.stopped) == (3, 2, 3)
    assert (row.safe_p50_s, row.safe_p99_s, row.safe_max_s) == (0.1, 0.9, 0.9)
    assert (row.heat_max_J, row.budget_J, row.heat_over_budget) == (9.0, 3.0, 3.0)


def test_what_never_stopped_has_no_time_to_safe() -> None:
    (row,) = by_fault(run_of(WENT_ON).results)
    assert row.stopped == 0
    assert math.isnan(row.safe_p50_s)
    table = table_of([row])
    assert "–" in in_full(table.header, table.rows, table.numeric)


def test_pairs_share_a_row_and_groups_end_with_all() -> None:
    pair = replace(STOPPED, name="leak + echo", group="pair")
    other = replace(STOPPED, name="leak + stall", group="pair")
    run = run_of(pair, other, WENT_ON)
    assert [row.name for row in by_fault(run.results)] == ["two at once", "leak"]
    assert [(row.name, row.count) for row in by_group(run.results)] == [
        ("pair", 2),
        ("actuator", 1),
        ("all", 3),
    ]


def test_a_failure_is_told_with_what_was_injected() -> None:
    run = run_of(STOPPED, BAD)
    (line,) = failure_lines(run)
    assert line.startswith("leak@3.00: while heating: energy: 9.0 J")
    assert "1 broke the oracle" in verdict(run)
    assert "holds for every one" in verdict(run_of(STOPPED))


def test_page_and_json_hold_every_fault_and_failure() -> None:
    run = run_of(STOPPED, BAD, WENT_ON)
    page = render(page_of(run))
    assert "9.0\u00a0J went in after the onset" in page
    assert "http" not in page
    data = json.loads(json_of(run))
    assert data["seed"] == 7
    assert len(data["outcomes"]) == 3
    assert data["outcomes"][1]["violations"][0]["clause"] == "energy"
    assert data["outcomes"][2]["outcome"]["safe_after_s"] is None
    assert data["outcomes"][0]["outcome"]["expected"]["then"] == "STOPS"


def test_a_percentile_is_a_value_that_was_measured() -> None:
    values = [float(n) for n in range(1, 101)]
    assert (percentile(values, 0.5), percentile(values, 0.99)) == (50.0, 99.0)
    assert percentile([4.0], 0.99) == 4.0
    assert math.isnan(percentile([], 0.5))
