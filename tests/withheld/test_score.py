"""The scorer on made-up verdicts whose scores are known by hand."""

import datetime
import json
import math
from pathlib import Path
from typing import Any

import msgspec
import pytest

from tests.withheld import openings, page, score
from tests.withheld.command import main
from tests.withheld.errors import BankError, KeyMismatchError, VerdictError
from tests.withheld.intervals import bootstrap, wilson
from tests.withheld.plant.effects import names
from tests.withheld.verdicts import (
    Estimate,
    Hypothesis,
    NextExperiment,
    Short,
    Verdict,
    VerdictFile,
    read_verdicts,
)
from tests.withheld.vocabulary import ALIASES, canonical, canonical_subsystem

SHA = "a" * 64


def _entry(kind: str, *effects: tuple[str, str], gap: float = 3.0) -> dict[str, Any]:
    quantity = {"rtd_lag": 0.5}
    return {
        "kind": kind,
        "gap_worst": gap,
        "effects": [{"name": n, "subsystem": s, "quantity": quantity.get(n)} for n, s in effects],
        "shrink_exact_law": 0.9,
    }


LAG = ("rtd_lag", "sensors")
FRICTION = ("tube_friction", "mechanics")


def _named(*causes: str, p: float = 0.9, **more: Any) -> Verdict:
    more.setdefault("subsystem", "sensors")
    return Verdict(outcome="effect", causes=[Hypothesis(list(causes), p)], **more)


def _rows(key: dict[str, Any], verdicts: dict[str, Verdict]) -> dict[str, score.Row]:
    file = VerdictFile(format="smad-verdicts-1", bank="x", key_sha256=SHA, verdicts=verdicts)
    return {r.name: r for r in score.table(score.matched(file, {"cases": key}, SHA))}


def test_the_right_name_counts_one_and_a_group_counts_its_share() -> None:
    key = {c: _entry("single", LAG) for c in "abcd"}
    group = Verdict(
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
            "d": Verdict(outcome="no_gap"),
        },
    )
    name = rows["right name first, of the detected"]
    assert name.value == pytest.approx(0.5)
    assert name.count == 3
    assert name.met is False
    assert rows["right name in the first three"].value == pytest.approx(2 / 3)
    assert rows["right subsystem, of the detected"].value == 1.0
    assert rows["mean probability on the truth"].value == pytest.approx((0.9 + 0.4 + 0.0) / 3)
    assert rows["detected at 3× the floor"].value == 0.75


def test_a_group_without_the_truth_counts_nothing() -> None:
    verdict = Verdict(outcome="ambiguous", group=["rtd_offset", "rtd_stem_error"])
    rows = _rows({"a": _entry("single", LAG)}, {"a": verdict})
    assert rows["right name first, of the detected"].value == 0.0


def test_false_alarms_are_claims_where_there_is_no_structural_gap() -> None:
    key = {"a": _entry("none"), "b": _entry("parameters"), "c": _entry("none"), "d": _entry("none")}
    verdicts = {
        "a": Verdict(outcome="no_gap"),
        "b": Verdict(outcome="parameters_only"),
        "c": Verdict(outcome="unknown"),
        "d": Verdict(outcome="not_enough_excitation"),
    }
    row = _rows(key, verdicts)["false alarms on none"]
    assert (row.value, row.count, row.met) == (0.25, 4, False)


def test_unknown_effects_must_be_called_unknown() -> None:
    key = {c: _entry("unknown", ("coil_contact", "mechanics")) for c in "abcd"}
    verdicts = {
        "a": Verdict(outcome="unknown", subsystem="mechanics"),
        "b": _named("tube_friction", subsystem="mechanics"),
        "c": Verdict(outcome="no_gap"),
        "d": Verdict(outcome="unknown", subsystem="phase"),
    }
    rows = _rows(key, verdicts)
    assert rows["unknown effects rejected, of the detected"].value == pytest.approx(2 / 3)
    assert rows["unknown effects named as a known one"].value == 0.25
    assert rows["unknown effects: right subsystem, of the detected"].value == pytest.approx(2 / 3)


def test_strengths_are_told_apart_by_the_gap_that_was_reached() -> None:
    key = {c: _entry("single", LAG, gap=g) for c, g in zip("abc", (1.1, 2.9, 12.0), strict=True)}
    verdicts = {"a": Verdict(outcome="no_gap"), "b": _named("rtd_lag"), "c": _named("rtd_lag")}
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


def test_shrink_coverage_left_out_and_next_experiment() -> None:
    key = {c: _entry("single", LAG) for c in "ab"}
    verdicts = {
        "a": _named(
            "rtd_lag",
            shrink=0.8,
            shrink_best_entry=0.8,
            quantities={"rtd_lag": Estimate(0.52, 0.45, 0.6)},
            left_out={"rtd_lag": Short("unknown")},
            next_experiment=NextExperiment("two_ramps", ["rtd_lag"], ["rtd_lag"]),
        ),
        "b": _named(
            "rtd_lag",
            shrink=0.4,
            shrink_best_entry=0.8,
            quantities={"rtd_lag": Estimate(0.7, 0.6, 0.8)},
            left_out={"rtd_lag": Short("effect", ["rtd_stem_error"])},
            next_experiment=NextExperiment("two_ramps", ["rtd_lag"], ["rtd_offset"]),
        ),
    }
    rows = _rows(key, verdicts)
    assert rows["median held-out shrink, tool ÷ O2"].value == pytest.approx(0.75)
    assert rows["median held-out shrink, tool ÷ O1"].value == pytest.approx(0.6 / 0.9)
    assert rows["95 % intervals cover"].value == 0.5
    assert rows["leave one effect out: rejected"].value == 0.5
    assert rows["recommended experiment resolves"].value == 0.5


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
        "a": Verdict(outcome="no_gap", causes=[Hypothesis(["none"], 1.0)]),
        "b": Verdict(outcome="unknown", causes=[Hypothesis(["unknown"], 1.0)]),
    }
    assert _rows(key, verdicts)["calibration error"].value == 0.0


def test_baselines_and_confusion_are_reported_beside_ours() -> None:
    key = {"a": _entry("single", LAG), "b": _entry("none")}
    alarm = Short("effect", ["rtd_lag"])
    verdicts = {
        "a": _named("rtd_lag", baselines={"smallest_rmse": alarm}),
        "b": Verdict(outcome="no_gap", baselines={"smallest_rmse": alarm}),
    }
    file = VerdictFile(format="smad-verdicts-1", bank="x", key_sha256=SHA, verdicts=verdicts)
    report = score.report(score.matched(file, {"cases": key}, SHA))
    rows = {r["name"]: r["value"] for r in report["baselines"]["smallest_rmse"]}
    assert rows["false alarms on none"] == 1.0
    assert rows["right name first, of the detected"] == 1.0
    assert report["confusion"] == {"none": {"no_gap": 1}, "rtd_lag": {"rtd_lag": 1}}


def test_a_case_without_a_verdict_is_not_detected_and_is_counted() -> None:
    rows = _rows({"a": _entry("single", LAG), "b": _entry("single", LAG)}, {"a": _named("rtd_lag")})
    assert rows["detected at 3× the floor"].value == 0.5


def test_wilson_agrees_with_its_published_example() -> None:
    low, high = wilson(9, 10)
    assert low == pytest.approx(0.5958, abs=1e-4)
    assert high == pytest.approx(0.9821, abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)


def test_the_bootstrap_holds_the_mean_of_many() -> None:
    values: list[object] = [float(i % 2) for i in range(200)]
    low, high = bootstrap(values, lambda v: sum(float(str(x)) for x in v) / len(v))
    assert 0.40 < low < 0.5 < high < 0.60
    assert math.isnan(bootstrap([], lambda v: 0.0)[0])


def test_a_key_of_another_bank_is_refused() -> None:
    file = VerdictFile(format="smad-verdicts-1", bank="x", key_sha256="b" * 64, verdicts={})
    with pytest.raises(KeyMismatchError, match="their own bank"):
        score.matched(file, {"cases": {}}, SHA)


def test_verdicts_on_cases_that_do_not_exist_are_refused() -> None:
    file = VerdictFile(
        format="smad-verdicts-1",
        bank="x",
        key_sha256=SHA,
        verdicts={"z": Verdict(outcome="no_gap")},
    )
    with pytest.raises(VerdictError, match="does not have"):
        score.matched(file, {"cases": {}}, SHA)


@pytest.mark.parametrize(
    ("verdict", "why"),
    [
        ({"outcome": "sure"}, "outcome 'sure' is none of"),
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


def test_other_names_of_a_listed_cause_are_understood(tmp_path: Path) -> None:
    body = {
        "format": "smad-verdicts-1",
        "bank": "x",
        "key_sha256": SHA,
        "aliases": {"mine": "rtd_lag"},
        "verdicts": {
            "a": {"outcome": "effect", "causes": [{"names": ["Tendon slack"], "probability": 1}]},
            "b": {"outcome": "effect", "causes": [{"names": ["mine"], "probability": 1}]},
        },
    }
    path = tmp_path / "verdicts.json"
    path.write_text(json.dumps(body))
    file = read_verdicts(path)
    assert file.verdicts["a"].first == ("tendon_compliance",)
    assert file.verdicts["a"].subsystem == "mechanics"
    assert file.verdicts["b"].first == ("rtd_lag",)
    assert canonical_subsystem("water") == "thermal"


def test_every_listed_cause_is_in_the_vocabulary_once() -> None:
    assert set(ALIASES) == set(names("known"))
    others = [other for group in ALIASES.values() for other in group]
    assert len(others) == len(set(others))
    assert not set(others) & set(ALIASES)
    assert canonical("something else") == "something_else"


def _scored(tmp_path: Path, bank: str) -> tuple[Path, Path]:
    key = {"bank": bank, "cases": {"a": _entry("single", LAG), "b": _entry("none")}}
    key_path = tmp_path / "KEY.json"
    key_path.write_text(json.dumps(key))
    from tests.withheld.files import digest

    verdicts = VerdictFile(
        format="smad-verdicts-1",
        bank=bank,
        key_sha256=digest(key_path),
        verdicts={"a": _named("rtd_lag"), "b": Verdict(outcome="no_gap")},
    )
    path = tmp_path / "verdicts.json"
    path.write_bytes(msgspec.json.encode(verdicts))
    return path, key_path


def test_the_command_scores_and_writes_json_and_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts, key = _scored(tmp_path, "dev")
    out, html = tmp_path / "scores.json", tmp_path / "scores.html"
    main(["score", str(verdicts), str(key), "--json", str(out), "--html", str(html)])
    assert "right name first" in capsys.readouterr().out
    report = json.loads(out.read_text())
    assert report["answered"] == 2
    text = html.read_text()
    assert "<svg" in text
    assert "http" not in text
    readme = tmp_path / "README.md"
    readme.write_text(f"before\n{page.BEGIN}\nold\n{page.END}\nafter\n")
    main(["readme", str(out), "--readme", str(readme)])
    assert "| right name first" in readme.read_text()
    assert "old" not in readme.read_text()
    assert readme.read_text().endswith("after\n")


def test_a_readme_without_markers_is_refused(tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("nothing")
    with pytest.raises(BankError, match="no markers"):
        page.into_readme(tmp_path / "README.md", {"table": []})


def test_a_sealed_key_that_was_not_committed_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts, key = _scored(tmp_path, "sealed")
    before = openings.RECORD.read_text() if openings.RECORD.exists() else ""
    with pytest.raises(SystemExit):
        main(["score", str(verdicts), str(key)])
    assert "commit its hash" in capsys.readouterr().err
    assert (openings.RECORD.read_text() if openings.RECORD.exists() else "") == before


def test_every_opening_is_entered_with_date_commit_and_scores(tmp_path: Path) -> None:
    verdicts, key = _scored(tmp_path, "dev")
    file = read_verdicts(verdicts)
    report = score.report(score.matched(file, json.loads(key.read_text()), file.key_sha256))
    record, shown = tmp_path / "openings.jsonl", tmp_path / "openings.md"
    when = datetime.datetime(2030, 5, 1, 12, 0, tzinfo=datetime.UTC)
    for _ in range(2):
        openings.enter(file.key_sha256, "c" * 64, report, when, record=record, page=shown)
    assert shown.read_text().count("2030-05-01 12:00") == 2
    line = json.loads(record.read_text().splitlines()[0])
    assert line["scores"]["right name first, of the detected"] == 1.0
    assert line["commit"]


def test_the_page_of_openings_is_made_from_its_record() -> None:
    assert openings.PAGE.read_text() == openings.rendered()
