"""The scorer on made-up verdicts whose scores are known by hand."""

import json
import math
from pathlib import Path
from typing import Any

import msgspec
import pytest
from smad.gap.records import Outcome

from smad.cli import execute
from smad.diagnosis.bank import score
from smad.diagnosis.bank.errors import KeyMismatchError, VerdictError
from smad.diagnosis.bank.intervals import bootstrap, wilson
from smad.diagnosis.bank.key import FORMAT, CaseKey, Key, file_digest, read_key
from smad.diagnosis.bank.names import ALIASES, CAUSES, OUTCOMES, canonical
from smad.diagnosis.bank.score import Mistake, Scores, scores
from smad.diagnosis.bank.verdicts import (
    CaseVerdict,
    Estimate,
    Hypothesis,
    Short,
    VerdictFile,
    in_bank_names,
    read_verdicts,
    write_verdicts,
)
from smad.diagnosis.spring_pair import SmaPlant

SHA = "a" * 64


def _entry(kind: str, *effects: tuple[str, str], gap: float = 3.0) -> dict[str, Any]:
    quantity = {"rtd_lag": 0.5}
    return {
        "kind": kind,
        "gap_worst": gap,
        "effects": [{"name": n, "subsystem": s, "quantity": quantity.get(n)} for n, s in effects],
        "shrink_exact_law": 0.9,
    }


def _key(cases: dict[str, Any], bank: str = "x") -> Key:
    return Key(FORMAT, bank, msgspec.convert(cases, dict[str, CaseKey]))


LAG = ("rtd_lag", "sensors")
FRICTION = ("tube_friction", "mechanics")


def _named(*causes: str, p: float = 0.9, **more: Any) -> CaseVerdict:
    more.setdefault("subsystem", "sensors")
    return CaseVerdict(outcome="effect", causes=[Hypothesis(list(causes), p)], **more)


def _rows(key: dict[str, Any], verdicts: dict[str, CaseVerdict]) -> dict[str, score.Row]:
    file = VerdictFile(format="smad-verdicts-1", bank="x", key_sha256=SHA, verdicts=verdicts)
    return {r.name: r for r in score.table(score.matched(file, _key(key), SHA))}


def test_the_right_name_counts_one_and_a_group_counts_its_share() -> None:
    key = {c: _entry("single", LAG) for c in "abcd"}
    group = CaseVerdict(
        outcome="ambiguous",
        causes=[Hypothesis(["channel_delay"], 0.5), Hypothesis(["rtd_lag"], 0.4)],
        group=["rtd_lag", "channel_delay"],
        subsystem="sensors",
    )
    rows = _rows(
        key,
        {
            "a": _named("rtd_lag"),
            "b": group,
            "c": _named("rtd_offset"),
            "d": CaseVerdict(outcome="no_gap"),
        },
    )
    name = rows["right name first, of the detected"]
    assert name.value == pytest.approx(0.5)
    assert name.count == 3
    assert rows["right name in the first three"].value == pytest.approx(2 / 3)
    assert rows["right subsystem, of the detected"].value == 1.0
    assert rows["mean probability on the truth"].value == pytest.approx((0.9 + 0.4 + 0.0) / 3)
    assert rows["detected at 3× the floor"].value == 0.75


def test_a_group_without_the_truth_counts_nothing() -> None:
    verdict = CaseVerdict(outcome="ambiguous", group=["rtd_offset", "rtd_stem_error"])
    rows = _rows({"a": _entry("single", LAG)}, {"a": verdict})
    assert rows["right name first, of the detected"].value == 0.0


def test_false_alarms_are_claims_where_there_is_no_structural_gap() -> None:
    key = {"a": _entry("none"), "b": _entry("parameters"), "c": _entry("none"), "d": _entry("none")}
    verdicts = {
        "a": CaseVerdict(outcome="no_gap"),
        "b": CaseVerdict(outcome="parameters_only"),
        "c": CaseVerdict(outcome="unknown"),
        "d": CaseVerdict(outcome="not_enough_excitation"),
    }
    row = _rows(key, verdicts)["false alarms on none"]
    assert (row.value, row.count) == (0.25, 4)


def test_runs_of_one_state_that_are_said_to_contradict_are_counted_and_are_no_silence() -> None:
    key = {"a": _entry("none"), "b": _entry("single", LAG)}
    apart = CaseVerdict(outcome=OUTCOMES[Outcome.CONTRADICTING])
    rows = _rows(key, {"a": apart, "b": _named("rtd_lag")})
    assert rows["runs of one state said to contradict each other"].value == 0.5
    assert rows["false alarms on none"].value == 1.0


def test_without_good_runs_the_first_cause_of_the_budget_is_the_answer() -> None:
    key = {c: _entry("differs", LAG, gap=10.0) for c in "abc"} | {"d": _entry("differs")}
    verdicts = {
        "a": CaseVerdict(
            outcome="unknown", budget={"parameters": 0.5, "rtd_lag": 0.2, "rest": 0.3}
        ),
        "b": _named("rtd_lag", budget={"parameters": 0.1, "rtd_offset": 0.5, "rtd_lag": 0.4}),
        "c": CaseVerdict(outcome="parameters_only", budget={"parameters": 0.9, "rest": 0.1}),
        "d": CaseVerdict(outcome="unknown", budget={"parameters": 0.9, "rtd_lag": 0.1}),
    }
    file = VerdictFile(
        format="smad-verdicts-1", bank="x", key_sha256=SHA,
        verdicts={c: in_bank_names(v) for c, v in verdicts.items()},
    )  # fmt: skip
    rows = {r.name: r for r in score.table(score.matched(file, _key(key), SHA))}
    row = rows["differs: right entry first in the budget"]
    assert (row.value, row.count) == (pytest.approx(1 / 3), 3)
    row = rows["differs: right entry in the budget"]
    assert (row.value, row.count) == (pytest.approx(2 / 3), 3)


def test_unknown_effects_must_be_called_unknown() -> None:
    key = {c: _entry("unknown", ("coil_contact", "mechanics")) for c in "abcd"}
    verdicts = {
        "a": CaseVerdict(outcome="unknown", subsystem="mechanics"),
        "b": _named("tube_friction", subsystem="mechanics"),
        "c": CaseVerdict(outcome="no_gap"),
        "d": CaseVerdict(outcome="unknown", subsystem="phase"),
    }
    rows = _rows(key, verdicts)
    assert rows["unknown effects rejected, of the detected"].value == pytest.approx(2 / 3)
    assert rows["unknown effects named as a known one"].value == 0.25
    assert rows["unknown effects: right subsystem, of the detected"].value == pytest.approx(2 / 3)


def test_strengths_are_told_apart_by_the_gap_that_was_reached() -> None:
    key = {c: _entry("single", LAG, gap=g) for c, g in zip("abc", (1.1, 2.9, 12.0), strict=True)}
    verdicts = {"a": CaseVerdict(outcome="no_gap"), "b": _named("rtd_lag"), "c": _named("rtd_lag")}
    rows = _rows(key, verdicts)
    assert [rows[f"detected at {s}× the floor"].value for s in (1, 3, 10)] == [0.0, 1.0, 1.0]


def test_pairs_are_exact_only_with_both_names_and_no_more() -> None:
    key = {c: _entry("pair", LAG, FRICTION) for c in "abc"}
    verdicts = {
        "a": _named("tube_friction", "rtd_lag"),
        "b": _named("rtd_lag"),
        "c": _named("rtd_lag", "tube_friction", "driver_gain"),
    }
    assert _rows(key, verdicts)["pairs: exact"].value == pytest.approx(1 / 3)


def test_coverage_and_what_is_said_with_the_cause_left_out() -> None:
    key = {c: _entry("single", LAG) for c in "ab"}
    verdicts = {
        "a": _named(
            "rtd_lag",
            quantities={"rtd_lag": Estimate(0.52, 0.45, 0.6)},
            left_out={"rtd_lag": Short("unknown")},
        ),
        "b": _named(
            "rtd_lag",
            quantities={"rtd_lag": Estimate(0.7, 0.6, 0.8)},
            left_out={"rtd_lag": Short("effect", ["rtd_stem_error"])},
        ),
    }
    rows = _rows(key, verdicts)
    assert rows["95 % intervals cover"].value == 0.5
    assert rows["leave one effect out: rejected"].value == 0.5


def test_calibration_is_the_mean_distance_of_said_and_right() -> None:
    key = {c: _entry("single", LAG) for c in "abcd"}
    right, wrong = _named("rtd_lag", p=0.75), _named("rtd_offset", p=0.75)
    rows = _rows(key, {"a": right, "b": right, "c": right, "d": wrong})
    assert rows["calibration error"].value == pytest.approx(0.0)
    rows = _rows(key, dict.fromkeys("abcd", wrong))
    assert rows["calibration error"].value == pytest.approx(0.75)


def test_special_answers_count_as_right_for_cases_without_a_listed_cause() -> None:
    key = {"a": _entry("none"), "b": _entry("unknown", ("coil_contact", "mechanics"))}
    verdicts = {
        "a": CaseVerdict(outcome="no_gap", causes=[Hypothesis(["none"], 1.0)]),
        "b": CaseVerdict(outcome="unknown", causes=[Hypothesis(["unknown"], 1.0)]),
    }
    assert _rows(key, verdicts)["calibration error"].value == 0.0


def test_a_case_without_a_verdict_is_not_detected_and_is_counted() -> None:
    rows = _rows({"a": _entry("single", LAG), "b": _entry("single", LAG)}, {"a": _named("rtd_lag")})
    assert rows["detected at 3× the floor"].value == 0.5


def test_a_check_of_a_part_of_a_bank_can_be_scored_on_that_part() -> None:
    file = VerdictFile(
        format="smad-verdicts-1", bank="x", key_sha256=SHA, verdicts={"a": _named("rtd_lag")}
    )
    key = _key({"a": _entry("single", LAG), "b": _entry("single", LAG)})
    whole, part = (score.matched(file, key, SHA, answered_only=only) for only in (False, True))
    assert [p.case for p in whole] == ["a", "b"]
    assert [p.case for p in part] == ["a"]
    rows = {r.name: r for r in score.table(part)}
    assert rows["detected at 3× the floor"].value == 1.0


def test_wilson_agrees_with_its_published_example() -> None:
    low, high = wilson(9, 10)
    assert low == pytest.approx(0.5958, abs=1e-4)
    assert high == pytest.approx(0.9821, abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)


def test_the_bootstrap_holds_the_mean_of_many() -> None:
    values = [float(i % 2) for i in range(200)]
    low, high = bootstrap(values, lambda v: sum(v) / len(v))
    assert 0.40 < low < 0.5 < high < 0.60
    assert math.isnan(bootstrap([], lambda v: 0.0)[0])


def test_a_score_without_a_case_says_so_instead_of_a_number() -> None:
    rows = _rows({"a": _entry("none")}, {"a": CaseVerdict(outcome="no_gap")})
    row = rows["pairs: exact"]
    assert (row.value, row.low, row.count) == (None, None, 0)
    assert rows["calibration error"].value is None


def test_a_key_of_another_bank_is_refused() -> None:
    file = VerdictFile(format="smad-verdicts-1", bank="x", key_sha256="b" * 64, verdicts={})
    with pytest.raises(KeyMismatchError, match="their own bank"):
        score.matched(file, _key({}), SHA)


def test_verdicts_on_cases_that_do_not_exist_are_refused() -> None:
    file = VerdictFile(
        format="smad-verdicts-1",
        bank="x",
        key_sha256=SHA,
        verdicts={"z": CaseVerdict(outcome="no_gap")},
    )
    with pytest.raises(VerdictError, match="the key does not have"):
        score.matched(file, _key({}), SHA)


@pytest.mark.parametrize(
    ("verdict", "why"),
    [
        ({"outcome": "sure"}, "unknown outcome; got sure"),
        ({"outcome": "effect", "causes": [{"names": ["a"], "probability": 1.4}]}, "normalise"),
        (
            {
                "outcome": "effect",
                "causes": [
                    {"names": ["a"], "probability": 0.2},
                    {"names": ["b"], "probability": 0.7},
                ],
            },
            "sort them",
        ),
        ({"causes": []}, "missing required field"),
    ],
)
def test_a_broken_verdict_is_refused_with_its_reason(
    verdict: dict[str, Any], why: str, tmp_path: Path
) -> None:
    path = tmp_path / "verdicts.json"
    body = {"format": "smad-verdicts-1", "bank": "x", "key_sha256": SHA}
    path.write_text(json.dumps(body | {"verdicts": {"case-001": verdict}}))
    with pytest.raises(VerdictError, match=why):
        read_verdicts(path)


def test_every_listed_cause_is_in_the_library_and_other_names_stay_as_they_are() -> None:
    assert not set(ALIASES) & set(CAUSES)
    assert set(ALIASES.values()) <= set(CAUSES)
    assert set(CAUSES) <= {canonical(e.name) for e in SmaPlant().effects}
    assert canonical("something_else") == "something_else"


def test_two_entries_that_are_one_answer_share_their_probability(tmp_path: Path) -> None:
    causes = [
        Hypothesis(["unknown"], 0.4),
        Hypothesis(["cold_ends"], 0.35),
        Hypothesis(["temperature_spread"], 0.25),
    ]
    path = tmp_path / "verdicts.json"
    verdicts = {"a": CaseVerdict(outcome="effect", causes=causes, subsystem="water")}
    write_verdicts(
        path, VerdictFile(format="smad-verdicts-1", bank="x", key_sha256=SHA, verdicts=verdicts)
    )
    read = read_verdicts(path).verdicts["a"]
    assert [h.names for h in read.causes] == [["cold_ends"], ["unknown"]]
    assert read.causes[0].probability == pytest.approx(0.6)
    assert read.subsystem == "thermal"


def _scored(tmp_path: Path, bank: str) -> tuple[Path, Path]:
    cases = {"a": _entry("single", LAG), "b": _entry("none"), "c": _entry("single", LAG)}
    key_path = tmp_path / "KEY.json"
    key_path.write_text(json.dumps({"format": FORMAT, "bank": bank, "cases": cases}))
    verdicts = {
        "a": _named("rtd_lag"),
        "b": CaseVerdict(outcome="no_gap"),
        "c": _named("rtd_offset", p=0.8),
    }
    path = tmp_path / "verdicts.json"
    file = VerdictFile(
        format="smad-verdicts-1", bank=bank, key_sha256=file_digest(key_path), verdicts=verdicts
    )
    write_verdicts(path, file)
    return path, key_path


def test_the_command_prints_scores_and_mistakes_and_writes_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts, key = _scored(tmp_path, "dev")
    out = tmp_path / "scores.json"
    assert execute(["gap", "score", str(verdicts), str(key), "--json", str(out)]) == 0
    said = capsys.readouterr().out
    assert "right name first" in said
    assert "rtd_offset" in said
    file = read_verdicts(verdicts)
    found = scores(score.matched(file, *read_key(key)), "dev")
    assert msgspec.json.decode(out.read_bytes(), type=Scores) == found
    assert found.confusion == {
        "none": {"no_gap": 1}, "rtd_lag": {"rtd_lag": 1, "rtd_offset": 1}
    }  # fmt: skip
    assert found.mistakes == [
        Mistake("c", "single", ["rtd_lag"], 3.0, ["rtd_offset"], "effect", 0.8)
    ]


def test_a_sealed_key_is_not_scored_without_a_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts, key = _scored(tmp_path, "sealed")
    assert execute(["gap", "score", str(verdicts), str(key)]) == 1
    said = capsys.readouterr()
    assert "evaluation score" in said.err
    assert said.out == ""


def test_a_place_that_cannot_be_written_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts, key = _scored(tmp_path, "dev")
    place = verdicts / "scores.json"
    assert execute(["gap", "score", str(verdicts), str(key), "--json", str(place)]) == 1
    assert "choose another file with --json" in capsys.readouterr().err


def test_a_file_that_is_no_key_is_refused(tmp_path: Path) -> None:
    verdicts, _ = _scored(tmp_path, "dev")
    with pytest.raises(KeyMismatchError, match="is not a key"):
        read_key(verdicts)
    with pytest.raises(KeyMismatchError, match="cannot be read"):
        read_key(tmp_path / "none.json")


@pytest.mark.parametrize("form", [{}, {"format": "smad-key-9"}], ids=["none", "another"])
def test_a_key_of_another_form_is_refused(form: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "KEY.json").write_text(json.dumps(form | {"bank": "x", "cases": {}}))
    with pytest.raises(KeyMismatchError, match="smad-key-1"):
        read_key(tmp_path / "KEY.json")
