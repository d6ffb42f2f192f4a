"""The page of a campaign: one table "paper against here", contradictions, and a section each."""

from __future__ import annotations

from collections.abc import Sequence

import smad
from sim_device.plant.parameters import ParameterSet, parameters_text
from smad.experiments.campaign import CampaignResult
from smad.experiments.estimate import Estimate
from smad.report.page import Code, Page, Section, Table, Text

CONTRADICTIONS: Sequence[str] = (
    "The printed thermal model with water at 300 K, and motion at ≤ 4 A: with it 1 A ends at 301 K "
    "and 4 A at 309 K, below every transformation temperature (Fig. 10).",
    "A resistivity of 0.44 µΩ·m with all the tube water warming, and the 7 s tracking of Fig. 11: "
    "the heat does not suffice. Set B therefore lets a quarter of the water warm.",
    "An amplitude of 12 mm in Fig. 12 and a full stroke of ±10 mm in Fig. 9. A sinusoid cut at "
    "10 mm still scores R² = 0.989.",
    "G_A/G_M = 2.55 of Brinson's table, and ξ_X = 0.27 at 10 mm in Fig. 9, which needs 1.99.",
    "Eq. (13a) below M_S, and step 4 of the cycle: the condition T > M_S is missing in print.",
    "Bi ≤ 0.1 as stated, and Eq. (14) with the paper's own numbers, which gives 0.34 to 0.39; the "
    "stated values need the length d_s/4.",
    "Conservation of energy, and C_s 466/260 J/kgK with L 12 188/4 138 J/kg for heating and "
    "cooling: switching between them makes or destroys heat. The plant books that apart.",
)
"""Facts of the paper that cannot hold together."""


def comparison_table(result: CampaignResult) -> Table:
    """The table "paper against here", all experiments."""
    return Table(
        ("fact", "paper", "here", "note"),
        [
            (row.fact, row.paper, row.here, row.note)
            for one in result.results
            for row in one.findings.comparisons
        ],
    )


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


def campaign_page(
    result: CampaignResult,
    model: ParameterSet,
    *,
    given: ParameterSet | None,
    facts: Sequence[tuple[str, str]],
) -> Page:
    """The whole page. `given` are the parameters of the simulated bench, None on a real one."""
    sections = [
        Section("Paper against here", (comparison_table(result),), "paper"),
        Section(
            "What cannot hold together in the paper",
            tuple(Text(f"{k}. {text}") for k, text in enumerate(CONTRADICTIONS, 1)),
            "contradictions",
        ),
    ]
    sections += [
        Section(one.experiment.title, one.findings.blocks, one.experiment.name)
        for one in result.results
    ]
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
                    Code(parameters_text(result.recovered)),
                ),
                "recovered",
            )
        )
    return Page(
        "Experiments of the paper, repeated",
        sections,
        "Cheng et al., J. Intell. Mater. Syst. Struct. 28(16), 2017: each figure and "
        "characterisation run again, and what goes beyond the paper beside it.",
        (("smad", smad.__version__), ("model", model.title), *facts),
    )
