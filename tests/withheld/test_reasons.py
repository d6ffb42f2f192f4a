"""Every reason for a name that was not given, from numbers that lead to it."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from smad.gap import Settings
from smad.gap.check.key import CaseKey, TrueEffect
from smad.gap.check.score import Pair
from smad.gap.check.verdicts import CaseVerdict, Hypothesis
from smad.gap.records import Outcome
from smad.report.page import text_table
from tests.withheld.entry import Apart, EntryRecord, Fit, Rival, Standing
from tests.withheld.reason_tables import case_table, count_table
from tests.withheld.reasons import (
    ABSENT,
    REASONS,
    Told,
    Way,
    counts,
    explained,
    in_background,
    parting,
    reasons_of,
    told,
)

SETTINGS = Settings()
CLEAR = Fit(
    values={"tau_s": 0.4}, output="rtd:x", size_floors=12.0, size_background=4.0, d2_known=900.0,
    d2_nothing=400.0, d2_free=90.0, gain=500.0, gain_se=100.0, asked=3.0,
    excess_before=2.0, regime_gain=90.0, shows=True, enters=True,
)  # fmt: skip
NAMED = Standing(
    outcome=Outcome.EFFECT, outcome_asked=Outcome.EFFECT, unknown=0.1, gap_raw=4.0, gap_refit=3.0,
    gap_free=2.0, threshold=0.5, ceiling=0.7, tied=True, free_answers=False, free_gain=-200.0,
    free_gain_se=50.0,
)  # fmt: skip
ENTRY = EntryRecord(
    name="rtd_lag", screen_gain=300.0, masked=0.3, visible=20.0, background={"rtd_x_degC": 0.1},
    standing=NAMED, fit=CLEAR, rivals=[],
)  # fmt: skip
MISSED = Told(
    case="case-001", cause="rtd_lag", strength=3.0, outcome="no_gap", said=[], given=[],
    credit=0.0, true_floors=3.1, true_background=1.5, entry=ENTRY, judged=1.5,
)  # fmt: skip
WRONG = msgspec.structs.replace(
    MISSED, outcome="effect", said=["channel_delay"], given=["channel_delay"]
)
LEFT = {"outcome": Outcome.UNKNOWN, "outcome_asked": Outcome.UNKNOWN}
QUIET = {"outcome": Outcome.NO_GAP, "outcome_asked": Outcome.NO_GAP}
OUT = {"shows": False, "enters": False, "gain": 100.0}


def a_case(
    of: Told = MISSED,
    *,
    standing: dict[str, Any] | None = None,
    fit: dict[str, Any] | None = None,
    entry: dict[str, Any] | None = None,
    **numbers: Any,
) -> Told:
    """A case that nothing stands in the way of, but for the numbers given."""
    change = msgspec.structs.replace
    record = change(
        ENTRY, standing=change(NAMED, **(standing or {})), fit=change(CLEAR, **(fit or {}))
    )
    return change(of, entry=change(record, **(entry or {})), **numbers)


def rival(d2: float | None, odds: float | None) -> dict[str, Any]:
    return {"rivals": [Rival("channel_delay", d2, odds, 400.0)]}


TABLE: list[tuple[str, Told, str]] = [
    ("the right name was given", a_case(credit=1.0, said=["rtd_lag"]), "named rightly"),
    ("a gap is left that it does not take", a_case(standing=LEFT, fit=OUT), "no entry fits"),
    ("it takes too little of the gap", a_case(standing=LEFT), "no entry fits"),
    (
        "a gap that the effect is too small for",
        a_case(standing=LEFT, fit=OUT, true_background=0.4),
        "below the background",
    ),
    (
        "an entry that came in takes too little of it, however small the effect",
        a_case(standing=LEFT, true_background=0.4),
        "no entry fits",
    ),
    (
        "the free refit predicts better",
        a_case(standing={"outcome": Outcome.PARAMETERS, "free_answers": True}),
        "masked by the refit",
    ),
    (
        "the free refit answers, and the effect was too small to show",
        a_case(standing=QUIET | {"free_answers": True}, fit=OUT, true_background=0.4),
        "below the background",
    ),
    (
        "parameters follow the fitted effect",
        a_case(standing=QUIET, fit=OUT | {"d2_nothing": 9.0}),
        "masked by the refit",
    ),
    (
        "parameters have taken the strength, as they would a typical one's",
        a_case(
            standing=QUIET,
            fit=OUT | {"d2_known": 1.0, "d2_nothing": 0.5},
            entry={"masked": 0.99, "visible": 3.0},
        ),
        "masked by the refit",
    ),
    (
        "parameters imitate a typical effect, and nothing was left to fit",
        a_case(standing=QUIET, entry={"fit": None, "masked": 0.99, "visible": 3.0}),
        "masked by the refit",
    ),
    ("too small a gain", a_case(standing=QUIET, fit=OUT), "below the background"),
    (
        "not apart from nothing, and not for the parameters",
        a_case(standing=QUIET, fit=OUT | {"d2_known": 12.0, "d2_nothing": 8.0}),
        "below the background",
    ),
    (
        "a gain of the parameters, the entry fitted to nothing",
        a_case(fit={"d2_known": 0.0, "d2_nothing": 0.0}),
        "below the background",
    ),
    (
        "parameters follow an effect that gains",
        a_case(fit={"d2_nothing": 9.0}),
        "masked by the refit",
    ),
    ("nothing to fit", a_case(standing=QUIET, entry={"fit": None}), "below the background"),
    ("the good runs ask for it too", a_case(standing=QUIET, fit={"enters": False}), "there before"),
    ("the given one is as near", a_case(WRONG, entry=rival(9.0, 50.0)), "not separable"),
    ("the odds are even", a_case(WRONG, entry=rival(80.0, 4.0)), "not separable"),
    ("the given one is far behind", a_case(WRONG, entry=rival(80.0, 0.01)), "passed over"),
    ("the given one is far ahead", a_case(WRONG, entry=rival(80.0, 1000.0)), "passed over"),
    ("the given one could not be compared", a_case(WRONG, entry=rival(None, None)), "passed over"),
    (
        "two were named, one of them rightly",
        a_case(WRONG, said=["channel_delay", "rtd_lag"], entry=rival(80.0, 0.01)),
        "named with another",
    ),
    ("alone it is named, but nothing was", a_case(), "passed over"),
    ("called unknown", a_case(outcome="unknown"), "passed over"),
]


@pytest.mark.parametrize(
    ("case", "reason"), [row[1:] for row in TABLE], ids=[row[0] for row in TABLE]
)
def test_the_numbers_of_a_case_lead_to_one_reason(case: Told, reason: str) -> None:
    assert reasons_of(case, SETTINGS)[0] == reason


def test_every_reason_is_met_by_some_numbers() -> None:
    assert {row[2] for row in TABLE} == {r.name for r in REASONS}


def test_a_cause_without_an_entry_has_that_for_its_reason() -> None:
    assert reasons_of(msgspec.structs.replace(MISSED, entry=None), SETTINGS) == [ABSENT.name]


def test_later_reasons_are_told_beside_the_first() -> None:
    case = a_case(
        standing=LEFT | {"free_answers": True}, fit=OUT | {"d2_nothing": 9.0}, entry=rival(9.0, 1.0)
    )
    assert reasons_of(case, SETTINGS) == [
        "no entry fits",
        "masked by the refit",
        "below the background",
        "not separable",
    ]


def test_only_what_nothing_else_explains_counts_as_a_failure_of_the_method() -> None:
    for _, case, reason in TABLE:
        found = reasons_of(case, SETTINGS)
        assert ("passed over" in found) == (found == ["passed over"]) == (reason == "passed over")


TRUTH = CaseKey(
    "single", [TrueEffect("rtd_lag", "sensors")], 3.1,
    gap={"rtd_x_degC": 3.1, "force_N": 0.2, "v_x_V": 5.0},
    floor={"rtd_x_degC": 0.05, "force_N": 0.01},
)  # fmt: skip


def test_the_true_size_is_told_in_what_each_channel_is_trusted_to() -> None:
    assert in_background(TRUTH, {"rtd_x_degC": 0.1, "force_N": 0.001}) == pytest.approx(2.0)
    assert in_background(TRUTH, {"rtd_x_degC": 0.1, "force_N": 0.01}) == pytest.approx(1.55)
    assert in_background(TRUTH, {}) == 0.0


def test_names_that_were_given_beside_the_right_one_are_told_apart() -> None:
    group = CaseVerdict(
        outcome="ambiguous",
        causes=[Hypothesis(["channel_delay"], 0.5), Hypothesis(["rtd_lag"], 0.4)],
        group=["channel_delay", "rtd_lag"],
    )
    of_group = told(Pair("case-001", TRUTH, group), ENTRY, 1.5)
    assert of_group.given == ["channel_delay"]
    assert of_group.said == ["channel_delay", "rtd_lag"]
    assert of_group.credit == 0.5
    assert of_group.true_background == pytest.approx(1.55)
    silent = CaseVerdict(outcome="no_gap", causes=[Hypothesis(["rtd_lag"], 0.4)])
    assert told(Pair("case-001", TRUTH, silent), ENTRY, 1.5).said == []


def test_the_tables_hold_a_line_a_case_and_the_counts_by_strength() -> None:
    missed = [row[1] for row in TABLE]
    cases = explained([*missed, msgspec.structs.replace(MISSED, entry=None, strength=10.0)],
                      SETTINGS)  # fmt: skip
    assert [x.reason for x in cases] == sorted(
        (x.reason for x in cases), key=[ABSENT.name, *(r.name for r in REASONS)].index
    )
    lines = text_table(case_table(cases)).splitlines()
    assert len(lines) == len(cases) + 2
    assert max(map(len, lines)) < 200
    assert counts(cases)[ABSENT.name] == {"1×": 0, "3×": 0, "10×": 1}
    total = count_table(cases, SETTINGS).rows[-1]
    assert total == ["all", "0", str(len(missed)), "1", str(len(cases)), "0"]


def test_a_case_is_parted_from_the_name_given_or_else_from_none() -> None:
    far, near = [Apart("edges", 400.0, 40.0)], [Apart("one side", 20.0, 2.0)]
    beside_none = a_case(entry={"apart": far})
    beside_name = a_case(
        WRONG,
        entry={"apart": far, "rivals": [Rival("channel_delay", 4.0, 2.0, 400.0, near)]},
    )
    cases = explained([beside_none, beside_name], SETTINGS)
    assert [row[-1] for row in case_table(cases).rows] == ["one side 2.00 of 20", "edges 40 of 400"]
    assert count_table(cases, SETTINGS).rows[-1][-2:] == ["2", "1"]
    assert parting(a_case(), SETTINGS) is None


@pytest.mark.parametrize(
    ("d2", "several", "errors", "enough"),
    [((4800.0, 50.0), 1, 3.0, True), ((2400.0, 2400.0, 1.0), 2, 3.0, True),
     ((1000.0, 800.0), 2, 2.0, False)],
)  # fmt: skip
def test_experiments_are_added_until_a_gain_comes_to_what_is_asked(
    d2: tuple[float, ...], several: int, errors: float, enough: bool
) -> None:
    # 400 of separation in four runs are 600 in the six that are judged: 4800 more triple the gain.
    weak = {"gain": 100.0, "gain_se": 100.0, "asked": 3.0}
    apart = [Apart(f"experiment {i}", x, 0.1 * x) for i, x in enumerate(d2)]
    way = parting(a_case(fit=weak, entry={"apart": apart}), SETTINGS)
    assert way is not None
    assert way.experiments == [a.experiment for a in apart[:several]]
    assert (way.errors, way.enough) == (pytest.approx(errors), enough)
    assert way.counted == pytest.approx(0.1 * sum(d2[:several]))


def test_a_clear_gain_is_parted_from_a_name_where_two_causes_are_told_apart() -> None:
    def way_of(*counted: float) -> Way:
        near = [Apart(f"experiment {i}", 10.0 * c, c) for i, c in enumerate(counted)]
        beside = {"rivals": [Rival("channel_delay", 4.0, 2.0, 9.0, near)]}
        way = parting(a_case(WRONG, entry=beside), SETTINGS)
        assert way is not None
        return way

    assert (way_of(16.0, 1.0).experiments, way_of(16.0, 1.0).enough) == (["experiment 0"], True)
    assert len(way_of(9.0, 7.0, 5.0).experiments) == 2
    assert not way_of(7.0, 6.9).enough
