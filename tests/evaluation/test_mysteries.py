"""The round over the wire, its processes replaced: what is asked of them, in which order."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest

from evaluation.errors import QuizError
from evaluation.quiz import ends
from evaluation.quiz.session import Order, investigated
from smad.checkup.investigation import Record, Report
from smad.checkup.store import SCHEMA, About
from smad.diagnosis.verdict import CAUSES, CHECK_UP, Verdict
from tests.evaluation.reported import effect_reported

ANSWER = {"seed": 7, "effects": [{"name": "rtd_lag", "listed": True, "places": ["reading_rtd"]}]}
VERDICT = Verdict(
    question=CHECK_UP,
    outcome=CAUSES,
    headline="the reading of the RTD has changed",
    causes=[effect_reported("rtd_lag", "reading_rtd")],
)


class FakeWire:
    """Notes what is asked, and writes what the commands would; `fails` names one that does not."""

    def __init__(self, fails: str = "") -> None:
        self.asked: list[str] = []
        self._fails = fails

    @contextmanager
    def bench(self, *, good: bool, day: int) -> Iterator[None]:
        self.asked.append(f"{'good' if good else 'troubled'} bench, day {day}")
        yield
        self.asked.append("bench ended")

    def smad(self, *arguments: str) -> None:
        options = dict(zip(arguments, (*arguments[1:], ""), strict=True))
        command = arguments[1]
        again = " again" if "--again" in arguments else ""
        self.asked.append(command + again + (" quick" if "--quick" in arguments else ""))
        if command == self._fails:
            raise QuizError("the disk is full")
        baseline = Path(options["--baseline"])
        if command == "commission":
            baseline.mkdir(exist_ok=True)
            have = 1 if again else 0
            about = About(
                schema=SCHEMA,
                bench="quiz",
                programme="",
                plant="",
                degrees=1,
                theta={},
                repeats=have + int(options["--repeats"]),
                effects={},
                runs=[],
            )
            (baseline / "baseline.json").write_bytes(msgspec.json.encode(about))
        else:
            folder = baseline / "investigation-1"
            folder.mkdir()
            records = [
                Record(file=f"{k}.mcap", run="run-1", why="", held_out=k == 3, took_s=120.0)
                for k in range(4)
            ]
            report = Report(records=records, why_over="the time is spent", verdict=VERDICT)
            (folder / "investigation.json").write_bytes(msgspec.json.encode(report))

    def answer(self) -> dict[str, Any]:
        return ANSWER


def test_the_good_bench_is_commissioned_on_its_days_and_ended_before_the_trouble(
    tmp_path: Path,
) -> None:
    wire = FakeWire()
    case = investigated(wire, Order(quick=True), tmp_path)
    assert wire.asked == [
        "good bench, day 0", "commission quick", "bench ended",
        "good bench, day 1", "commission again quick", "bench ended",
        "troubled bench, day 2", "investigate", "bench ended",
    ]  # fmt: skip
    assert case["minutes"] == 8.0
    assert (case["effects"], case["names"]) == (["rtd_lag"], ["rtd_lag"])
    assert (case["place"], case["true_places"]) == ("reading_rtd", ["reading_rtd"])
    assert ends.mark(case) == ends.placed(case) == ends.placed_among(case) == "rightly"


def test_a_bench_on_which_nothing_is_wrong_is_investigated_on_another_day_and_is_rightly_quiet(
    tmp_path: Path,
) -> None:
    wire = FakeWire()
    case = investigated(wire, Order(unchanged=True), tmp_path)
    assert wire.asked[-3:] == ["good bench, day 2", "investigate", "bench ended"]
    assert ends.mark(case) == ends.placed(case) == "wrongly"
    quiet = case | {"outcome": "quiet"}
    assert ends.mark(quiet) == ends.placed(quiet) == ends.placed_among(quiet) == "rightly"
    rows = {row[0]: row for row in ends.table([case, quiet]).rows}
    assert rows["none: likeliest place"][1:3] == ("2", "0.50 (0.09–0.91)")


def test_one_day_holds_both_repeats(tmp_path: Path) -> None:
    wire = FakeWire()
    investigated(wire, Order(days=1), tmp_path)
    assert wire.asked[:3] == ["good bench, day 0", "commission", "bench ended"]


def test_a_round_that_was_interrupted_goes_on_where_it_stopped(tmp_path: Path) -> None:
    with pytest.raises(QuizError):
        investigated(FakeWire(fails="investigate"), Order(), tmp_path)
    wire = FakeWire()
    case = investigated(wire, Order(), tmp_path)
    assert wire.asked == ["troubled bench, day 2", "investigate", "bench ended"]
    assert investigated(FakeWire(fails="investigate"), Order(), tmp_path) == case


def test_a_bench_that_fails_does_not_keep_the_others_waiting(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def one(seed: int) -> dict[str, Any]:
        folder = tmp_path / f"runs-{seed}"
        folder.mkdir(exist_ok=True)
        return investigated(FakeWire(fails="commission" if seed == 7 else ""), Order(), folder)

    out = tmp_path / "out"
    with pytest.raises(QuizError, match="not finished: 7"):
        ends.run([7, 8], out, one)
    assert [p.name for p in out.iterdir()] == ["8.json"]
    said = capsys.readouterr().out
    assert "7 failed: the disk is full" in said
    assert "8 rightly" in said


def ended(outcome: str, *names: str, truth: str = "rtd_lag", listed: bool = True) -> dict[str, Any]:
    return {
        "outcome": outcome,
        "names": list(names),
        "effects": [truth],
        "listed": listed,
        "minutes": 10.0,
        "place": "reading_rtd" if names else "",
        "true_places": ["reading_rtd"],
    }


@pytest.mark.parametrize(
    ("case", "said"),
    [
        (ended("causes", "rtd_lag"), "rightly"),
        (ended("causes", "rtd_lag", "force_gain"), "with a wrong name"),
        (ended("causes", "force_gain"), "wrongly"),
        (ended("quiet"), "not noticed"),
        (ended("parameters"), "wrongly"),
        (ended("causes"), "said to be unknown"),
        (ended("unexplained", listed=False), "rightly"),
        (ended("causes", "rtd_lag", truth="misted_board", listed=False), "wrongly"),
    ],
)
def test_an_end_is_right_when_it_says_what_there_is(case: dict[str, Any], said: str) -> None:
    assert ends.mark(case) == said


def test_the_table_counts_ends_of_listed_and_other_effects() -> None:
    other = ended("causes", "x") | {"place": "film", "reported_places": ["film", "reading_rtd"]}
    cases = [ended("causes", "rtd_lag"), other, ended("causes", listed=False)]
    rows = {row[0]: row for row in ends.table(cases).rows}
    assert [r for r in rows if r.startswith("all")] == [
        "all: name", "all: likeliest place", "all: one of 1.5 places"
    ]  # fmt: skip
    assert "not in it: one of the places" in rows
    assert rows["in the library: name"][2].startswith("0.50")
    assert rows["in the library: likeliest place"][2].startswith("0.50")
    assert rows["in the library: one of 1.5 places"][2].startswith("1.00")
    assert rows["all: name"][1] == "3"


def test_the_table_counts_those_that_leave_one_rival_or_nothing_apart() -> None:
    cases = [
        ended("causes", "rtd_lag") | {"why_over": "one rival is left: rtd_lag, probability 0.90"},
        ended("causes", "x") | {"place": "film", "why_over": "the time is spent: …"},
        ended("quiet") | {"why_over": "the time is spent: so far nothing has changed"},
        ended("parameters") | {"why_over": "every run of the baseline was played: other values"},
        ended("quiet") | {"why_over": "every run of the baseline was played: nothing has changed"},
    ]
    rows = {row[0]: row for row in ends.table(cases).rows}
    assert rows["all: likeliest place"][1] == "5"
    assert rows["one rival or nothing left: likeliest place"][1:3] == ("2", "0.50 (0.09–0.91)")
