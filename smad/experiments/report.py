"""The page of a campaign: the comparison with the paper, contradictions, and a section each."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from sim_device.plant.parameters import ParameterSet, parameters_text
from smad.experiments.base import Comparison
from smad.experiments.campaign import CampaignResult
from smad.experiments.contradictions import CONTRADICTIONS, reference
from smad.experiments.estimate import Estimate
from smad.files import write_named
from smad.report.page import Code, Fold, Page, Section, Table, Text, write_page


def comparison_table(result: CampaignResult) -> Table:
    """The paper's facts beside those of this bench, all experiments."""
    return Table(
        ("fact", "paper", "this bench", "note"),
        [
            (row.fact, row.paper, row.here, _note(row))
            for done in result.results
            for row in done.findings.comparisons
        ],
    )


def _note(row: Comparison) -> str:
    parts = [row.note, reference(row.contradiction) if row.contradiction else ""]
    return "; ".join(part for part in parts if part)


def recovery_table(
    estimates: Sequence[Estimate], model: ParameterSet, given: ParameterSet | None
) -> Table:
    """What the characterisations recovered; with `given`, against what the bench was given."""
    header = ["parameter", "found", "95 % interval", "from"]
    rows = []
    for estimate in estimates:
        entry = model.entry(estimate.name)
        row = [
            f"{entry.symbol} ({estimate.name})",
            entry.shown(estimate.value),
            f"{entry.shown(estimate.low)} to {entry.shown(estimate.high)}",
            estimate.source,
        ]
        if given is not None:
            truth = given[estimate.name]
            tolerance = estimate.tolerance
            allowed = f"{tolerance.share:.0%}" if tolerance.share else f"{tolerance.difference:g} K"
            row += [
                given.entry(estimate.name).shown(),
                f"within {allowed}" if estimate.holds(truth) else f"NOT within {allowed}",
            ]
        rows.append(row)
    if given is not None:
        header += ["given", "verdict"]
    return Table(header, rows)


def campaign_records(result: CampaignResult, given: ParameterSet | None) -> dict[str, Any]:
    """Both tables for a program: rows of texts, and estimates as numbers in SI."""
    return {
        "comparisons": [
            {"experiment": done.experiment.name, **asdict(row)}
            for done in result.results
            for row in done.findings.comparisons
        ],
        "estimates": [
            {
                "name": estimate.name,
                "unit": result.recovered.entry(estimate.name).unit,
                "value": estimate.value,
                "low": estimate.low,
                "high": estimate.high,
                "source": estimate.source,
                "given": None if given is None else given[estimate.name],
                "within_tolerance": None if given is None else estimate.holds(given[estimate.name]),
            }
            for estimate in result.estimates
        ],
    }


def write_campaign(
    result: CampaignResult,
    model: ParameterSet,
    page: Path,
    parameters: Path | None,
    *,
    given: ParameterSet | None,
    facts: Sequence[tuple[str, str]],
) -> dict[str, str]:
    """Write the page, and what was recovered as a parameter file; returns the files by name."""
    campaign = campaign_page(result, model, given=given, facts=facts)
    files = {"page": str(write_page(campaign, page))}
    if parameters is not None:
        write_named(parameters, parameters_text(result.recovered))
        files["parameters"] = str(parameters)
    return files


def campaign_page(
    result: CampaignResult,
    model: ParameterSet,
    *,
    given: ParameterSet | None,
    facts: Sequence[tuple[str, str]],
) -> Page:
    """The whole page. `given` are the parameters of the simulated bench, None on a real one."""
    digest = hashlib.sha256(parameters_text(model).encode()).hexdigest()[:12]
    sections = [Section("Comparison with the paper", (comparison_table(result),), "paper")]
    sections += [
        Section(
            done.experiment.title,
            (*done.findings.blocks, *([done.loops] if done.loops else [])),
            done.experiment.name,
        )
        for done in result.results
    ]
    sections.append(
        Section(
            "Contradictions in the paper",
            [Text(f"{k}. {text}") for k, text in enumerate(CONTRADICTIONS.values(), 1)],
            "contradictions",
        )
    )
    if result.estimates:
        sections.append(
            Section(
                "Recovered parameters",
                (
                    recovery_table(result.estimates, model, given),
                    Text(
                        "Intervals are from resampling the run and hold its random errors only, "
                        "not those of the sensors' calibration or of the model's form.",
                        "note",
                    ),
                    Fold("The parameter file", [Code(parameters_text(result.recovered))]),
                ),
                "recovered",
            )
        )
    return Page(
        "Experiments of the paper, repeated",
        sections,
        "Cheng et al., J. Intell. Mater. Syst. Struct. 28(16), 2017: each figure and "
        "characterisation repeated, with results beyond the paper beside it.",
        (("model", model.title), ("SHA-256 of its parameters", digest), *facts),
    )
