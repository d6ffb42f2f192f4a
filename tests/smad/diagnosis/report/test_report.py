"""What is said and shown of a verdict: every outcome, and only what the verdict holds."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from smad.diagnosis import Answer, diagnose
from smad.diagnosis.report.figures import Course, largest_gap
from smad.diagnosis.report.page import page_of
from smad.diagnosis.report.words import advice, lines, verified_lines, verified_records
from smad.diagnosis.rivals.describe import alike
from smad.diagnosis.verdict import (
    CAUSES,
    CHANGED,
    CHECK_UP,
    DIFFERS,
    OUTCOMES,
    PARAMETERS,
    QUIET,
    REFUSED,
    UNEXPLAINED,
    Cause,
    EffectValue,
    Finding,
    LawTerm,
    RivalGap,
    RunGap,
    SignalGap,
    Verdict,
    headline_of,
)
from smad.report.page import render
from smad.units import unparted, with_unit
from tests.smad.diagnosis.cases import GAIN, OTHER, bank
from tests.smad.diagnosis.heater_plant import HeaterPlant

LAG = EffectValue(name="tau_s", value=0.6, sd=0.004, unit="s")
TERM = LawTerm(
    name="velocity",
    state="velocity",
    words="velocity",
    slopes={"x": 0.2, "y": -0.1},
    sd={"x": 0.01, "y": 0.02},
    unit="N/(m/s)",
)
ALWAYS = LawTerm(
    name="constant", state="", words="always", slopes={"both": 1.0}, sd={"both": 0.1}, unit="N"
)


def rival(kind: str, name: str, gap: float, probability: float, **more: Any) -> RivalGap:
    return RivalGap(
        kind=kind,
        name=name,
        words=name,
        places=[],
        gap=gap,
        probability=probability,
        by_signal={"rod_um": gap},
        **more,
    )


RIVALS = [
    rival("effect", "lag", 1.0, 0.93, title="a slow sensor", values=[LAG]),
    *(rival("effect", f"near-{k}", 5.0 + k, 0.01) for k in range(5)),
    rival("parameters", "parameters alone", 29.5, 0.0),
    rival("nothing", "the simulator as configured", 40.0, 0.0),
]
EFFECT = Cause(
    kind="effect",
    name="lag",
    place="reading",
    words="reading of the rod",
    probability=0.97,
    names={"lag": 0.96, "near-0": 0.03},
    outside=0.2,
    credible_names=["lag"],
    credible_places=["reading"],
    places={"reading": 0.97, "room": 0.02},
    place_words={"reading": "reading of the rod"},
    values=[LAG],
    terms=[],
    unit="um",
    gap=1.0,
    rivals=RIVALS,
)
LAW = msgspec.structs.replace(
    EFFECT,
    kind="law",
    name="",
    values=[],
    terms=[TERM, ALWAYS],
    names={},
    credible_names=[],
    rivals=[rival("law", "reading", 2.0, 0.6)],
)
SIGNAL = SignalGap(
    signal="rod_um",
    words="length of the rod",
    unit="um",
    floor=0.2,
    raw=3.0,
    parameters=2.0,
    causes=[0.5],
)
SILENT = SignalGap(
    signal="room_degC", unit="degC", floor=0.2, raw=0.1, parameters=0.1, causes=[0.1]
)
WHOLE = SignalGap(
    signal="all signals", unit="floors", floor=1.0, raw=40.0, parameters=29.5, causes=[1.0]
)


def verdict(outcome: str, question: str = DIFFERS, **changes: Any) -> Verdict:
    run = RunGap(run="odd one", raw=40.0, parameters=29.5, final=1.0)
    full: dict[str, Any] = {"causes": [EFFECT] if outcome == CAUSES else []}
    if outcome != REFUSED:
        full |= {"budget": [SIGNAL, SILENT], "whole": WHOLE, "by_run": [run], "rivals": RIVALS}
    full |= changes
    headline = "no run can be used"
    if outcome != REFUSED:
        headline = headline_of(question, outcome, full["causes"], full["whole"])
    return Verdict(
        question=question, outcome=outcome, headline=headline, judged_on="2 runs", **full
    )


@pytest.mark.parametrize("question", [DIFFERS, CHANGED, CHECK_UP])
@pytest.mark.parametrize("outcome", OUTCOMES)
def test_every_outcome_is_said_headline_first_with_the_table_of_rivals(
    outcome: str, question: str
) -> None:
    v = verdict(outcome, question)
    first, *rest = lines(v)
    assert first == v.headline
    text = "\n".join(rest)
    for part in ("rod_um", "floors left  probability  rival", "parameters alone"):
        assert (part in text) == (outcome != REFUSED)
    assert ("place  reading of the rod 0.97" in text) == (outcome == CAUSES)


def test_of_many_likely_names_a_headline_has_the_first_and_a_small_drop_is_shown() -> None:
    many = msgspec.structs.replace(EFFECT, credible_names=["lag", *(f"near-{k}" for k in range(5))])
    small = msgspec.structs.replace(WHOLE, parameters=0.78, causes=[0.77])
    headline = verdict(CAUSES, CHECK_UP, causes=[many], whole=small).headline
    assert "lag or one of 5 others" in headline
    assert headline.endswith("from 0.78 to 0.77 floors")


def test_a_headline_says_that_parameters_imitate_a_cause_only_by_unlikely_values() -> None:
    for left in (0.5, 0.602):
        imitated = msgspec.structs.replace(WHOLE, raw=4.43, parameters=left, causes=[0.6])
        goes = f"from 4.4 to 0.6 floors; unlikely values of the parameters leave {left:.1f}"
        assert verdict(CAUSES, CHANGED, whole=imitated).headline.endswith(goes)


def test_the_headline_says_where_what_how_sure_and_how_far_the_gap_goes() -> None:
    assert verdict(CAUSES).headline == (
        "the simulator lacks something at the reading of the rod: lag, tau_s = 0.600 ± 0.004 s, "
        "probability 0.93; the gap goes from 29.5 to 1.0 floors"
    )
    torn = msgspec.structs.replace(EFFECT, credible_names=["lag", "near-0"])
    headline = verdict(CAUSES, causes=[torn]).headline
    assert "lag or near-0, probability 0.93 for the first" in headline
    assert verdict(CAUSES, CHANGED, causes=[LAW, EFFECT]).headline.startswith(
        "something has changed at the reading of the rod: a law, no effect of the library fits, "
        "probability 0.60, and lag;"
    )
    near = msgspec.structs.replace(LAW, credible_names=["lag"], outside=0.6)
    assert ": a law or lag, probability 0.60 for the first; the gap" in (
        verdict(CAUSES, causes=[near]).headline
    )
    far = msgspec.structs.replace(near, outside=1.0)
    assert "a law, no effect of the library fits, probability 0.60;" in (
        verdict(CAUSES, causes=[far]).headline
    )
    assert ", probability 0.93, and a law at the reading of the rod, and lag; the gap" in (
        verdict(CAUSES, causes=[EFFECT, LAW, EFFECT]).headline
    )
    assert verdict(PARAMETERS).headline.endswith(
        "from 40.0 to 29.5 floors, 29.5 floors stay unexplained"
    )
    assert (
        "40.0 floors are left, 29.5 with other values of the parameters"
        in verdict(UNEXPLAINED).headline
    )
    assert verdict(QUIET).headline.startswith("nothing is missing")


def test_of_several_causes_a_table_says_what_each_leaves_and_beside_what_it_was_asked() -> None:
    nearer = msgspec.structs.replace(LAW, gap=0.5, beside=["lag"])
    several = verdict(CAUSES, causes=[EFFECT, nearer])
    text = "\n".join(lines(several))
    assert (
        "  floors left  with\n"
        "         29.5  parameters alone\n"
        "            1  lag at the reading of the rod\n"
        "          0.5  + a law at the reading of the rod\n"
        "  floors left  probability  rival\n"
    ) in text
    assert "\n  floors left  probability  rival, beside lag\n" in text
    assert "  floors left  with" not in lines(verdict(CAUSES))


def test_every_effect_that_a_headline_names_has_a_row_and_a_probability_of_its_name() -> None:
    unlikely = rival("effect", "unlikely", 29.4, 0.04)
    torn = msgspec.structs.replace(
        EFFECT,
        names={"lag": 0.95, "unlikely": 0.04},
        credible_names=["lag", "unlikely"],
        rivals=[*RIVALS[:-2], unlikely, *RIVALS[-2:]],
    )
    v = verdict(CAUSES, causes=[torn])
    assert "lag or unlikely, probability" in v.headline
    text = "\n".join(lines(v))
    assert re.search(r"^ +29\.4 +0\.04  unlikely$", text, re.MULTILINE)
    assert "name   lag 0.95, unlikely 0.04, if" in text
    assert "unlikely" in render(page_of(Answer(verdict=v))).partition("Each rival, signal")[0]
    several = msgspec.structs.replace(torn, credible_names=["lag", "a", "b", "c", "unlikely"])
    assert several.named == ["lag"]


def test_a_page_has_the_final_values_and_says_of_which_step_its_table_is() -> None:
    final = msgspec.structs.replace(LAG, value=0.651)
    moved = msgspec.structs.replace(EFFECT, values=[final], gap=0.8)
    html = render(page_of(Answer(verdict=verdict(CAUSES, causes=[moved]))))
    shown, folded, _ = html.partition("The gap by signal")
    assert folded
    for words in ("tau_s = 0.600 ± 0.004 s", "<td>values</td>", "tau_s = 0.651 ± 0.004 s"):
        assert unparted(words) in shown
    assert unparted("later fits led to the values below and 0.8 floors") in shown
    as_in_table = render(page_of(Answer(verdict=verdict(CAUSES))))
    assert "later fits" not in as_in_table
    assert "<td>values</td>" not in as_in_table


def test_a_law_says_which_states_the_runs_do_not_tell_apart() -> None:
    t = np.linspace(0.0, 1.0, 50)
    runs = [{"velocity": t - 0.5, "force": 2.0 - 3.0 * t, "flow": t**8, "still": 0.0 * t}] * 2
    assert alike("velocity", runs) == ["force"]
    assert alike("", runs) == []
    law = msgspec.structs.replace(
        LAW, terms=[msgspec.structs.replace(TERM, alike="velocity is like force"), ALWAYS]
    )
    assert "  alike  velocity is like force" in lines(verdict(CAUSES, causes=[law]))
    assert not any("alike" in line for line in lines(verdict(CAUSES, causes=[LAW])))


def test_the_table_has_what_each_rival_leaves_beside_its_values() -> None:
    text = "\n".join(lines(verdict(CAUSES)))
    assert re.search(r"^ +1 +0\.93  lag, tau_s = 0\.600 ± 0\.004 s$", text, re.MULTILINE)
    assert re.search(r"^ +40 +0\.00  the simulator as configured$", text, re.MULTILINE)
    assert "near-3" in text
    # Of the others the page tells.
    assert "near-4" not in text
    useless = rival("effect", "useless", 29.4, 0.0)
    cause = msgspec.structs.replace(EFFECT, rivals=[RIVALS[0], useless, *RIVALS[-2:]])
    assert "useless" not in "\n".join(lines(verdict(CAUSES, causes=[cause])))
    assert "lag 0.96, if it is in the library; not in the library: 0.20" in text


def test_a_law_is_said_by_its_slopes() -> None:
    text = "\n".join(lines(verdict(CAUSES, causes=[LAW])))
    assert "velocity: X +0.20 ± 0.01, Y -0.10 ± 0.02 N/(m/s)\n         and a constant\n" in text
    # Beside another term a constant depends on where the middle of its states lies.
    assert "always" not in text
    alone = msgspec.structs.replace(LAW, terms=[ALWAYS])
    assert alone.law_lines == ["always: +1.0 ± 0.1 N"]
    assert "no effect of the library comes near" in text


def test_a_signal_at_its_floor_is_only_counted() -> None:
    text = "\n".join(lines(verdict(CAUSES)))
    assert "room_degC" not in text
    assert "1 other signal at the floor" in text


@pytest.mark.parametrize(
    ("value", "sd", "unit", "said"),
    [
        (0.6, 0.004, "s", "0.600 ± 0.004 s"),
        (1234.5, 20.0, "N", "1234 ± 20 N"),
        (9.5e9, 3e7, "Pa", "(9.50 ± 0.03)e+09 Pa"),
        (1.3e-7, 2e-9, "m3/s", "(1.30 ± 0.02)e-07 m3/s"),
        (0.0005503, 2e-6, "m", "(5.50 ± 0.02)e-04 m"),
        (5.8e7, 9e4, "Pa", "(5.800 ± 0.009)e+07 Pa"),
        (9.9999e7, 9e4, "Pa", "(1.0000 ± 0.0009)e+08 Pa"),
        (3.0, 2e5, "", "(0 ± 2)e+05"),
        (-1e-5, 2e-4, "1", "0.0000 ± 0.0002"),
        (0.5, 0.0096, "s", "0.50 ± 0.01 s"),
        (0.2, 0.0, "1", "0.2 ± 0"),
        (25.0, np.inf, "degC", "25 ± inf °C"),
    ],
)
def test_a_value_has_the_decimals_that_its_deviation_leaves(
    value: float, sd: float, unit: str, said: str
) -> None:
    assert with_unit(value, sd, unit) == said


def test_why_runs_were_refused_is_said_once_and_then_what_was_left_out_of_them() -> None:
    found = [
        Finding("a", "saturated channel", "at its end: not used", False),
        Finding("a", "no channel", "none is left", True),
        Finding("b", "no channel", "none is left", True),
    ]
    assert lines(verdict(REFUSED, findings=found)) == [
        "no run can be used", "a, b: none is left", "a: at its end: not used",
    ]  # fmt: skip


def test_what_holds_for_several_columns_is_said_of_them_in_the_plural() -> None:
    said = [Finding("r", "out of range", f"i_{s}_A holds 0 to 4000", refuses=True) for s in "xy"]
    assert "r: i_x_A, i_y_A hold 0 to 4000" in lines(verdict(REFUSED, findings=said))
    assert "r: i_x_A holds 0 to 4000" in lines(verdict(REFUSED, findings=said[:1]))


def test_what_to_do_next_goes_with_the_outcome() -> None:
    models = {"models": ["a", "b"]}
    commands = {o: [c for c, _ in advice(verdict(o, **models), "r.mcap")] for o in OUTCOMES}
    assert commands[QUIET] == commands[UNEXPLAINED] == []
    assert commands[REFUSED] == [""]
    better = ["smad gap diagnose r.mcap --apply better.toml",
              "smad gap verify NEW-RUNS --model better.toml"]  # fmt: skip
    assert commands[PARAMETERS] == commands[CAUSES] == better
    torn = msgspec.structs.replace(EFFECT, credible_places=["reading", "room"])
    undecided = advice(verdict(CAUSES, causes=[torn], **models), "r.mcap")
    assert [c for c, _ in undecided] == ["smad gap next r.mcap", *better]
    changed = advice(verdict(CAUSES, causes=[torn], question=CHANGED), "r.mcap --good g.mcap")
    assert [c for c, _ in changed] == ["smad gap next r.mcap --good g.mcap"]
    of_table = advice(verdict(CAUSES, causes=[torn], **models), "t.csv --map m.toml")
    commands_of_table = [c for c, _ in of_table]
    assert commands_of_table[0] == "smad gap next t.csv --map m.toml"
    assert commands_of_table[-1].endswith("--model better.toml --map m.toml")


def test_after_an_undecided_check_up_an_investigation_is_next() -> None:
    torn = msgspec.structs.replace(EFFECT, credible_names=["rtd_lag", "channel_delay"])
    undecided, decided = (
        advice(verdict(CAUSES, causes=[c], models=["a"], question=CHECK_UP), "--baseline b")
        for c in (torn, EFFECT)
    )
    assert [c for c, _ in undecided] == ["smad gap investigate --baseline b"]
    assert decided == []


def test_what_to_do_next_begins_with_the_files_that_are_written() -> None:
    v = verdict(CAUSES, models=["a", "b"])
    with_json = advice(v, "r.mcap", json_path=Path("my gap.json"))
    assert with_json[0][0] == "smad gap apply 'my gap.json' --out better.toml"
    (with_model,) = advice(v, "r.mcap", Path("gap.json"), Path("mine.toml"))
    assert with_model[0] == "smad gap verify NEW-RUNS --model mine.toml"
    page = page_of(Answer(verdict=v), "r.mcap", files=(Path("gap.json"), None))
    assert "smad gap apply gap.json --out better.toml" in render(page)


def test_verify_says_units_as_an_answer_does() -> None:
    degrees = msgspec.structs.replace(SIGNAL, unit="degC")
    assert "°C " in verified_lines([degrees])[1]
    assert verified_records([degrees])[0]["unit"] == "degC"


@pytest.fixture(scope="module")
def answers() -> dict[str, Answer]:
    plant, gain = HeaterPlant(), bank(OTHER, GAIN)[:2]
    return {
        QUIET: diagnose(bank()[:2], plant=plant),
        CAUSES: diagnose(gain, plant=plant, hold_out=bank(OTHER, GAIN, seed=20)[:1]),
        "law": diagnose(gain, plant=plant, candidates=["backlash"]),
        CHANGED: diagnose(bank(OTHER, GAIN), plant=plant, good=bank(OTHER, seed=40)),
        REFUSED: diagnose([r.part(0, 30) for r in gain], plant=plant),
    }


@pytest.mark.parametrize("kind", [QUIET, CAUSES, "law", CHANGED, REFUSED])
def test_a_page_opens_with_headline_rivals_and_one_figure(
    kind: str, answers: dict[str, Answer]
) -> None:
    answer = answers[kind]
    v = answer.verdict
    before = v.to_json()
    html = render(page_of(answer, "r.mcap"))
    shown = re.sub(r"<section>\s*<details>.*?</section>", "", html, flags=re.DOTALL)
    text = shown.replace("&amp;", "&").replace("&#39;", "'")
    title, _, gap = unparted(v.headline).partition("; ")
    assert title[1:] in text
    assert gap[1:] in text
    laws = sum(c.kind == "law" for c in v.causes)
    assert (laws > 0) == ("Law at the" in shown) == (kind == "law")
    assert shown.count("<svg") == (kind != REFUSED) + laws
    assert ("floors left" in shown) == (kind != REFUSED)
    assert ("The gap by signal" in html) == (kind != REFUSED)
    assert all(r.name in html for r in v.runs)
    assert not re.search(r"\bnan\b", html)
    assert v.to_json() == before


def test_a_signal_without_a_unit_has_none_on_its_axis() -> None:
    one = np.ones((4, 1))
    course = Course(
        run="a",
        t_s=np.arange(4.0),
        measured=one,
        before=0.0 * one,
        after=None,
        floors=one,
        order=(0,),
        labels=("valve, share open",),
        units=("1",),
        paired=False,
        drifts="",
    )
    assert ">measured − simulated<" in largest_gap(course).svg


def test_the_figure_is_of_the_signal_with_the_largest_gap_and_what_is_told_brings_it_nearer(
    answers: dict[str, Answer],
) -> None:
    answer = answers[CAUSES]
    assert answer.search is not None
    course = Course.of(answer, answer.search)
    assert course.after is not None
    in_floors = [
        np.sqrt(np.nanmean(((course.measured - y) / course.floors) ** 2, axis=0))
        for y in (course.before, course.after)
    ]
    assert np.argmax(in_floors[0]) == course.order[0]
    assert in_floors[0][course.order[0]] > 5.0
    assert in_floors[1].max() < 1.5
    assert course.run == answer.verdict.by_run[0].run
