"""Constants come from cases: the right rivals become likely, benches left out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from evaluation.calibrate import command
from evaluation.calibrate.banks import cases_of
from evaluation.calibrate.command import LEFT_OUT, calibrate
from evaluation.calibrate.fitting import fitted, whether, which
from evaluation.calibrate.rivals import LISTED, MOVED, NONE, UNLISTED, CaseRivals, showing
from evaluation.errors import BankError
from evaluation.recovery.cases import Case
from evaluation.recovery.judging import Answer
from evaluation.recovery.running import RecoveryFile
from evaluation.results.page import with_reliability
from evaluation.results.record import Result
from evaluation.score.answers import digest
from evaluation.score.first_step import RivalScore, ScoredVerdict
from smad.diagnosis.constants import Constants, shipped

RUNS, ROWS = 4, 20.0


def rival(kind: str, name: str, left: float, *places: str, far: float = 0.0) -> RivalScore:
    """A rival that leaves so many floors in each of two channels of every run."""
    score = -2.0 * float(np.log(left**2 + 1.0))
    return RivalScore(
        kind=kind, name=name, places=list(places), gap=left, scores=[score] * RUNS, log_prior=-far
    )


def rivals(
    truth: str, effect: float, rng: np.random.Generator, parameters: float = 6.0
) -> list[RivalScore]:
    """The rivals of a case; `effect` is what the listed effect leaves in floors."""
    good, little = 0.7, float(rng.uniform(0.66, 0.74))
    moved = {NONE: little, MOVED: good}.get(truth, parameters)
    return [
        rival("nothing", "nothing", good if truth == NONE else 9.0),
        rival("parameters", "parameters", moved, far=1.0),
        rival("effect", "rtd_lag", effect, "reading_rtd"),
        rival("effect", "channel_delay", 2.0 * effect, "reading_rtd", "reading_force"),
        rival("law", "reading_rtd", 1.4 if truth != NONE else little, "reading_rtd"),
        rival("law", "film", 3.0 if truth != NONE else little, "film"),
    ]


def cases(counts: dict[str, int]) -> list[CaseRivals]:
    """Cases of which listed effects leave the floor, others more than the law of their place."""
    rng = np.random.default_rng(3)
    effect = {NONE: 0.7, MOVED: 0.7, LISTED: 0.7, UNLISTED: 1.9}
    return [
        CaseRivals(
            case=f"{truth}-{n}",
            fold=f"bench {n % 4}",
            question="check-up",
            truth=truth,
            exact=n % 2 == 0,
            names=frozenset({"rtd_lag"} if truth == LISTED else {"slow glue"}),
            places=frozenset({"reading_rtd"}),
            effects=41,
            laws=20,
            rivals=tuple(rivals(truth, effect[truth], rng)),
            independent_rows=ROWS,
        )
        for truth, count in counts.items()
        for n in range(count)
    ]


FEW = {NONE: 4, MOVED: 4, LISTED: 4, UNLISTED: 4}
ALL = {NONE: 8, MOVED: 8, LISTED: 8, UNLISTED: 8}


@pytest.fixture(scope="module")
def c() -> Constants:
    """Fitted to all cases."""
    return fitted(cases(ALL))


def test_fitted_constants_make_the_right_rivals_likelier_than_others_do(c: Constants) -> None:
    some = cases(ALL)
    effects = [x for x in some if x.truth in (LISTED, UNLISTED)]

    def loss(c: Constants) -> float:
        return whether([(x, c) for x in some]) + which([(x, c) for x in effects])

    assert loss(c) <= loss(shipped())
    assert loss(c) < loss(msgspec.structs.replace(c, nothing=c.nothing - 9.0))
    assert not any(x.said(c).noticed for x in some if x.truth == NONE)
    assert all(x.said(c).noticed for x in some if x.truth == LISTED)


def test_what_is_reported_holds_the_truth_as_often_as_it_should(c: Constants) -> None:
    some = cases(ALL)
    said = [x.said(c) for x in some if x.truth in (LISTED, UNLISTED)]
    assert all(s.reported_places(c.credible_level) & s.case_rivals.places for s in said)


def test_an_effect_that_parameters_imitate_says_nothing_of_the_constants(c: Constants) -> None:
    some = cases(ALL)
    rng = np.random.default_rng(4)
    hidden = [
        replace(x, rivals=tuple(rivals(LISTED, 0.7, rng, parameters=0.7)))
        for x in some
        if x.truth == LISTED
    ]
    assert showing([*some, *hidden]) == some
    assert fitted([*some, *hidden]) == c


@pytest.mark.parametrize("kind", [NONE, MOVED, LISTED])
def test_cases_that_lack_a_kind_are_refused(kind: str) -> None:
    with pytest.raises(BankError, match="constants are fitted to"):
        fitted([x for x in cases(ALL) if x.truth != kind])


def recovery(folder: Path) -> Path:
    """A file of `recover`, as if every case had been asked."""
    kinds = {NONE: "none", MOVED: "parameters", LISTED: "single"}
    answers = {}
    for x in cases({NONE: 4, MOVED: 4, LISTED: 4}):
        case = Case(
            name=x.case,
            question="differs",
            kind=kinds[x.truth],
            seed=1,
            effects={"rtd_lag": {"tau_s": 0.6}} if x.truth == LISTED else {},
        )
        verdict = ScoredVerdict(
            question="differs",
            outcome="quiet",
            headline="",
            first_step=list(x.rivals),
            independent_rows=ROWS,
        )
        answers[x.case] = Answer(case=case, verdict=verdict)
    path = folder / "recovery.json"
    RecoveryFile(seed=1, source_sha256="", answers=answers).write(path)
    return path


def test_an_effect_of_our_simulator_is_left_out_whole(tmp_path: Path) -> None:
    read = cases_of(recovery(tmp_path), [])
    assert len({x.fold for x in read if x.truth == LISTED}) == 1
    assert len({x.fold for x in read if x.truth == NONE}) == 4


def bank(folder: Path, name: str = "dev") -> tuple[Path, Path]:
    """A file of `check` with its key."""
    of = {NONE: "none", MOVED: "parameters", LISTED: "single", UNLISTED: "unknown"}
    key, verdicts = {}, {}
    for n, x in enumerate(cases(FEW)):
        effect = {"name": next(iter(x.names)), "places": list(x.places), "known": x.truth == LISTED}
        effects = [effect] if x.truth in (LISTED, UNLISTED) else []
        key[x.case] = {"kind": of[x.truth], "effects": effects, "bench": n % 4}
        verdicts[x.case] = msgspec.to_builtins(
            ScoredVerdict(
                question="check-up",
                outcome="quiet",
                headline="",
                first_step=list(x.rivals),
                independent_rows=ROWS,
            )
        )
    (folder / "key").mkdir()
    path = folder / "key" / "KEY.json"
    path.write_text(json.dumps({"format": "smad-key-1", "bank": name, "cases": key}))
    reported = {"format": "smad-verdicts-3", "bank": name, "key_sha256": digest(path)}
    (folder / "v.json").write_text(json.dumps(reported | {"verdicts": verdicts}))
    return folder / "v.json", path


def test_banks_of_both_kinds_become_a_file_of_constants_and_a_diagram(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts, key = bank(tmp_path)
    out, result = tmp_path / "constants.toml", tmp_path / "calibration.json"
    made = calibrate([recovery(tmp_path), verdicts], [key], out=out, result=result)
    assert msgspec.toml.decode(out.read_bytes(), type=Constants) == made
    assert "28 cases of recovery, v" in out.read_text()
    assert LEFT_OUT in capsys.readouterr().out
    kept = msgspec.json.decode(result.read_bytes(), type=Result)
    assert [r[0] for r in kept.tables["Scores"].rows][:2] == [
        "quiet benches called changed", "parameters reported as such",
    ]  # fmt: skip
    page = with_reliability("a\n<!-- reliability -->\n<!-- end of reliability -->\nb\n", kept)
    assert "Probability of the likeliest place" in page
    assert page.startswith("a\n<!-- reliability -->\n\n## The probabilities")
    assert page.endswith("<!-- end of reliability -->\nb\n")
    assert with_reliability(page, kept) == page
    assert with_reliability("no marks", kept) == "no marks"


def test_a_file_without_its_key_and_a_sealed_key_are_refused(tmp_path: Path) -> None:
    verdicts, key = bank(tmp_path, "sealed")
    with pytest.raises(BankError, match="--key"):
        cases_of(verdicts, [])
    with pytest.raises(BankError, match="sealed"):
        cases_of(verdicts, [key])
    with pytest.raises(BankError, match=r"is not by `recover` or `check`"):
        cases_of(key.parent / "none.json", [])


def test_a_sealed_key_is_refused_under_another_name_beside_a_key_that_is_not(
    tmp_path: Path,
) -> None:
    verdicts, key = bank(tmp_path, "sealed")
    renamed = key.rename(key.with_name("sealed.json"))
    key.write_text(json.dumps({"format": "smad-key-1", "bank": "dev", "cases": {}}))
    with pytest.raises(BankError, match="is sealed"):
        cases_of(verdicts, [renamed])


def test_cases_of_one_name_in_two_banks_are_apart() -> None:
    some = cases(ALL)
    imitated = [
        replace(x, rivals=tuple(rivals(LISTED, 0.7, np.random.default_rng(4), parameters=0.7)))
        for x in some
        if x.truth == LISTED
    ]
    table = command._scores([(x.said(shipped()), shipped()) for x in [*some, *imitated]])
    counts = {name: count for name, _, count in table.rows}
    assert counts["effects noticed"] == "24"
    assert counts["effects noticed, of those that parameters do not imitate"] == "16"


def test_what_shares_an_effect_of_our_simulator_is_not_fitted_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pair = [
        replace(x, case="pair", exact=True, fold="own simulator a", names=frozenset(("a", "z")))
        for x in cases({LISTED: 1})
    ]
    alone = [
        replace(x, case="alone", exact=True, fold="own simulator z", names=frozenset(("z",)))
        for x in cases({LISTED: 1})
    ]
    fits: list[set[str]] = []

    def noted(some: list[CaseRivals]) -> Constants:
        fits.append({x.case for x in some})
        return shipped()

    monkeypatch.setattr(command, "fitted", noted)
    monkeypatch.setattr(command, "cases_of", lambda *_: [*cases(FEW), *pair, *alone])
    calibrate([tmp_path], [])
    assert {"pair", "alone"} <= fits[0]
    assert not any(len({"pair", "alone"} & fit) == 1 for fit in fits[1:])
