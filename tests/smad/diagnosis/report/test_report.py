"""What is said and shown of a verdict: every outcome, and only what the verdict holds."""

from __future__ import annotations

import re
from typing import Any

import msgspec
import pytest

from smad.diagnosis import Answer, diagnose
from smad.diagnosis.report import figures
from smad.diagnosis.report.page import page_of
from smad.diagnosis.report.words import advice, lines
from smad.diagnosis.verdict import (
    CHANGED,
    CONTRADICTING,
    DIFFERS,
    OUTCOMES,
    PARAMETERS,
    PLACES,
    QUIET,
    REFUSED,
    UNPLACED,
    Finding,
    PlaceShare,
    PlaceTold,
    Repeated,
    RunGap,
    SignalGap,
    TermTold,
    Verdict,
    change_headline,
)
from smad.report.page import render
from tests.smad.diagnosis.cases import GAIN, OTHER, bank
from tests.smad.diagnosis.heater_plant import HeaterPlant

TERM = TermTold(name="velocity", state="velocity", words="velocity", slopes={"x": 0.2, "y": -0.1},
                sd={"x": 0.01, "y": 0.02}, unit="N/(m/s)")  # fmt: skip
ALWAYS = TermTold(name="constant", state="", words="always", slopes={"both": 1.0},
                  sd={"both": 0.1}, unit="N")  # fmt: skip
PLACE = PlaceTold(
    place="friction", side="both", words="friction, X and Y", share=0.42,
    near=["film, X", "b", "c", "d", "e"], near_places=["friction", "film", "b", "c", "d", "e"],
    probabilities=[0.4, 0.3, 0.1, 0.05, 0.05, 0.02], terms=[TERM, ALWAYS],
    largest=0.3, unit="N", in_simulator=True,
)  # fmt: skip
SIGNAL = SignalGap(signal="rod_um", unit="um", floor=0.2, raw=3.0, parameters=2.0, places=[0.5])
WHOLE = SignalGap(signal="all signals", unit="floors", floor=1.0, raw=9.0, parameters=7.0,
                  places=[2.0])  # fmt: skip


def verdict(outcome: str, question: str = DIFFERS, **changes: Any) -> Verdict:
    run = RunGap(run="odd one", raw=9.0, parameters=7.0, final=2.0, apart=0.6,
                 contradicts=outcome == CONTRADICTING)  # fmt: skip
    full: dict[str, Any] = {"places": [PLACE] if outcome == PLACES else []}
    if outcome != REFUSED:
        full |= {"budget": [SIGNAL], "whole": WHOLE, "by_run": [run]}
    return Verdict(
        question=question, outcome=outcome, headline=f"it is {outcome}",
        judged_on="2 runs", parameters_take=0.25, **(full | changes),
    )  # fmt: skip


@pytest.mark.parametrize("question", [DIFFERS, CHANGED])
@pytest.mark.parametrize("outcome", OUTCOMES)
def test_every_outcome_is_said_headline_first(outcome: str, question: str) -> None:
    said = lines(verdict(outcome, question))
    assert said[0] == f"it is {outcome}"
    text = "\n".join(said)
    assert ("rod_um" in text) == (outcome != REFUSED)
    assert ("friction, X and Y: 42 %" in text) == (outcome == PLACES)
    assert ("ask without them" in text) == (outcome == CONTRADICTING)
    takes = "other values take 25 % of the gap"
    assert (takes in text) == (question == DIFFERS and outcome not in (QUIET, REFUSED))


def test_a_place_is_said_with_its_law_its_rivals_and_its_name() -> None:
    text = "\n".join(lines(verdict(PLACES)))
    assert "velocity: X +0.2 ± 0.01, Y -0.1 ± 0.02 N/(m/s)" in text
    # Beside another term a constant depends on where the middle of its states lies.
    assert "always" not in text
    assert "on runs left out; probability 0.40" in text
    assert "or film, X, probability 0.30" in text
    assert "or 2 more places" in text
    assert "none: no effect of the library acts there" in text
    named = msgspec.structs.replace(
        PLACE,
        name="rubs",
        values={"rubs": {"coulomb_N": 0.15}},
        takes=0.93,
        in_simulator=False,
        names={"rubs": 0.8, "sticks": 0.1},
    )
    text = "\n".join(lines(verdict(PLACES, places=[named])))
    assert "rubs (coulomb_N = 0.15), probability 0.80, or sticks 0.10; it takes 93 %" in text
    assert "read it as a hint" in text
    nearest = msgspec.structs.replace(PLACE, nearest="rubs", takes=0.4, names={"rubs": 0.3})
    text = "\n".join(lines(verdict(PLACES, places=[nearest])))
    assert "none that is sure; the nearest there, rubs, probability 0.30, takes 40 %" in text


def test_why_a_run_was_refused_is_said_and_what_was_only_noted_is_not() -> None:
    found = [Finding("a", "too short", "3 s long", True), Finding("b", "gaps", "two", False)]
    said = lines(verdict(REFUSED, findings=found))
    assert said == ["it is refused", "a: 3 s long"]


def test_what_runs_say_that_repeat_good_ones_is_said_beside() -> None:
    pairs = Repeated(lines=["a as b"], repeats=1, outcome=QUIET, headline="nothing new")
    text = "\n".join(lines(verdict(QUIET, CHANGED, repeated=pairs)))
    assert "the 1 runs that repeat known-good ones, as a check-up: nothing new" in text


def test_a_change_that_no_place_takes_is_said() -> None:
    assert change_headline(UNPLACED, [], "") == "changed, and no place takes enough of it"
    assert change_headline(PLACES, [PLACE, PLACE], "") == (
        "changed: friction, X and Y, by up to 0.3 N, and 1 more"
    )


def test_what_to_do_next_goes_with_the_outcome() -> None:
    models = {"models": ["a", "b"]}
    commands = {o: [c for c, _ in advice(verdict(o, **models), "r.mcap")] for o in OUTCOMES}
    assert commands[QUIET] == commands[CONTRADICTING] == []
    assert commands[REFUSED] == [""]
    better = ["smad gap diagnose r.mcap --apply better.toml",
              "smad gap verify NEW-RUNS --model better.toml"]  # fmt: skip
    assert commands[PARAMETERS] == better
    assert commands[PLACES] == ["smad gap next r.mcap", *better]


@pytest.fixture(scope="module")
def answers() -> dict[str, Answer]:
    plant, gain = HeaterPlant(), bank(OTHER, GAIN)[:2]
    return {
        QUIET: diagnose(bank()[:2], plant=plant),
        PARAMETERS: diagnose(bank({"c_J_K": 34.0})[:2], plant=plant),
        PLACES: diagnose(gain, plant=plant),
        CHANGED: diagnose(bank(OTHER, GAIN), plant=plant, good=bank(OTHER, seed=40)),
        REFUSED: diagnose([r.part(0, 30) for r in gain], plant=plant),
    }


@pytest.mark.parametrize("kind", [QUIET, PARAMETERS, PLACES, CHANGED, REFUSED])
def test_every_outcome_has_a_page_with_its_answer(kind: str, answers: dict[str, Answer]) -> None:
    answer = answers[kind]
    before = answer.verdict.to_json()
    html = render(page_of(answer, "r.mcap"))
    v = answer.verdict
    assert v.outcome == (PLACES if kind == CHANGED else kind)
    assert v.headline[1:] in html.replace("&amp;", "&")
    assert ('id="laws"' in html) == bool(v.places)
    assert ('id="budget"' in html) == (kind != REFUSED)
    assert all(p.words in html for p in v.places)
    assert all(r.name in html for r in v.runs)
    assert not re.search(r"\bnan\b", html)
    assert v.to_json() == before


def test_bars_begin_at_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Any] = []
    monkeypatch.setattr(
        "smad.report.plots.svg_of", lambda figure, title: shown.append(figure) or ""
    )
    figures.places_map(
        [PlaceShare(place=n, side="both", words=n, share=s) for n, s in (("a", 0.9), ("b", 0.85))]
    )
    figures.budget(["rod"], [0.1], [("raw", [0.9]), ("parameters", [0.8])])
    for figure in shown:
        (axes,) = figure.axes
        assert axes.get_xlim()[0] == 0.0
        assert all(bar.get_x() == 0.0 for bar in axes.patches)
        assert [bar.get_width() for bar in axes.patches] == pytest.approx(
            [0.9, 0.85] if len(axes.patches) == 2 and "a" in
            [t.get_text() for t in axes.get_yticklabels()] else [9.0, 8.0]
        )  # fmt: skip
    assert len(shown) == 2
