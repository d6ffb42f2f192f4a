"""Running a check: resumed where it stopped, past failed cases."""

from __future__ import annotations

import dataclasses
import functools
import os
import time
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import msgspec
import pytest

import evaluation.run
import sim_device.plant
from evaluation.checkout import source_digest
from evaluation.run.judging import Check, Judged, judge
from evaluation.run.manifest import Case
from evaluation.run.running import Task, VerdictFile, Work, answered, begun
from smad.diagnosis.verdict import DIFFERS, REFUSED, Verdict
from tests.evaluation.test_manifest import columns, make, opened, write

QUIET = msgspec.to_builtins(Verdict(question=DIFFERS, outcome="quiet", headline="no gap"))


@pytest.fixture
def order(tmp_path: Path, here: None) -> Check:
    return opened(make(tmp_path / "bank", 4))


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every case is worked on in this process."""

    def at_once(work: Work, check: Check, group: Sequence[Task]) -> Iterator[Judged]:
        return (work(check, *task) for task in group)

    monkeypatch.setattr("evaluation.run.running.apart", at_once)


def counting(seen: list[str], failing: tuple[str, ...] = ()) -> Callable[..., Judged]:
    """A worker that notes what it was given, and fails where it is told to."""

    def work(check: Check, case: Case, made_of: str) -> Judged:
        seen.append(case.id)
        if case.id in failing:
            return Judged(case.id, error="the run is made of cheese")
        return Judged(case.id, QUIET)

    return work


def out(check: Check) -> Path:
    return check.folder.with_name("verdicts.json")


def run(check: Check, work: Work, cases: Sequence[Case] = ()) -> VerdictFile:
    """What the command does."""
    some = cases or check.manifest.cases
    return answered(check, some, begun(check, out(check)), out(check), work=work)


def asked_again(check: Check) -> list[str]:
    """Cases that the same check asks for again, as another process would."""
    again: list[str] = []
    run(dataclasses.replace(check), counting(again))
    return again


def test_an_interrupted_check_goes_on_where_it_stopped(order: Check) -> None:
    def interrupted(check: Check, case: Case, made_of: str) -> Judged:
        if case.id == "case-3":
            raise KeyboardInterrupt
        return Judged(case.id, QUIET)

    with pytest.raises(KeyboardInterrupt):
        run(order, interrupted)
    kept = set(begun(order, out(order)).verdicts)
    assert {"case-1", "case-2"} <= kept
    again: list[str] = []
    file = run(order, counting(again))
    assert list(file.verdicts) == ["case-1", "case-2", "case-3", "case-4"]
    assert not kept & set(again)
    assert run(order, counting(once := [])).verdicts == file.verdicts
    assert once == []


def test_half_a_verdict_file_is_done_again(order: Check) -> None:
    run(order, counting([]))
    out(order).write_text('{"format": "smad-verdicts-3", "bank": "mine", "verd')
    assert len(asked_again(order)) == 4


@pytest.mark.parametrize(
    "change",
    [{"variant": "printed"}, {"params": "B"}, {"repeats": 1}],
    ids=["variant", "parameters", "repeats"],
)
def test_verdicts_made_in_another_way_are_not_taken_up(
    order: Check, change: dict[str, Any]
) -> None:
    run(order, counting([]))
    assert len(asked_again(dataclasses.replace(order, **change))) == 4


def test_verdicts_of_runs_that_were_recorded_anew_are_not_taken_up(order: Check) -> None:
    run(order, counting([]))
    assert asked_again(order) == []
    table = columns()
    table["force_N"] = table["force_N"] + 0.01
    path = order.folder / "case-2/fit.parquet"
    before = path.stat()
    write(order.folder, "case-2/fit.parquet", table)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert asked_again(order) == ["case-2"]


def test_verdicts_of_other_parameters_in_a_file_of_one_name_are_not_taken_up(
    order: Check, tmp_path: Path
) -> None:
    path = tmp_path / "mine.toml"
    nominal = (Path(sim_device.plant.__file__).parent / "data" / "set_a.toml").read_text()
    path.write_text(nominal)
    mine = dataclasses.replace(order, params=str(path))
    run(mine, counting([]))
    assert asked_again(mine) == []
    path.write_text(nominal.replace("value = 0.75", "value = 0.76", 1))
    assert len(asked_again(mine)) == 4


def test_code_counts_as_other_code_with_another_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    before = source_digest(evaluation.run)
    monkeypatch.setattr("evaluation.checkout.version", lambda name: f"{name} of tomorrow")
    assert source_digest.__wrapped__(evaluation.run) != before


def test_a_verdict_on_another_question_or_in_another_role_is_not_taken_up(order: Check) -> None:
    run(order, counting([]))
    one, other, *rest = order.manifest.cases
    runs = [msgspec.structs.replace(r, role="hold_out") for r in other.runs]
    cases = [
        msgspec.structs.replace(one, question="differs"),
        msgspec.structs.replace(other, runs=runs),
        *rest,
    ]
    manifest = msgspec.structs.replace(order.manifest, cases=cases)
    changed = dataclasses.replace(order, manifest=manifest)
    assert asked_again(changed) == ["case-1", "case-2"]


def test_a_check_of_some_cases_keeps_the_verdicts_of_the_others(order: Check) -> None:
    run(order, counting([]))
    some = order.manifest.cases[:1]
    assert len(run(order, counting([]), some).verdicts) == 4
    (order.folder / "case-3/fit.parquet").unlink()
    anew = dataclasses.replace(order)
    assert sorted(run(anew, counting([]), some).verdicts) == ["case-1", "case-2", "case-4"]


def test_a_failed_case_is_named_and_only_it_is_tried_again(order: Check) -> None:
    file = run(order, counting([], ("case-2",)))
    assert set(file.verdicts) == {"case-1", "case-3", "case-4"}
    assert file.notes == {"case-2": "the run is made of cheese"}
    assert msgspec.json.decode(out(order).read_bytes(), type=VerdictFile).notes == file.notes
    again: list[str] = []
    whole = run(order, counting(again))
    assert len(whole.verdicts) == 4
    assert whole.notes == {}
    assert again == ["case-2"]


def test_progress_tells_the_time_left_from_the_cases_of_this_run(
    order: Check, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run(order, counting([]), order.manifest.cases[:1])
    capsys.readouterr()
    ticks = iter([1000.0, 1600.0, 2200.0, 2800.0])
    monkeypatch.setattr("time.monotonic", lambda: next(ticks))
    run(order, counting([]))
    reported = [line.split("[")[1] for line in capsys.readouterr().out.splitlines()]
    assert reported == ["2/4, 20 min left]", "3/4, 10 min left]", "4/4, 0 min left]"]


def die_on(check: Check, case: Case, made_of: str, cases: tuple[str, ...]) -> Judged:
    """A worker that ends as one does that ran out of memory."""
    if case.id in cases:
        os._exit(9)
    return Judged(case.id, QUIET)


def test_a_worker_that_dies_costs_its_own_case_only(tmp_path: Path) -> None:
    order = opened(make(tmp_path / "bank", 4))
    file = run(order, functools.partial(die_on, cases=("case-2",)))
    assert set(file.verdicts) == {"case-1", "case-3", "case-4"}
    assert "fewer --jobs" in file.notes["case-2"]


def test_the_cases_of_a_bench_go_on_after_one_whose_worker_died(tmp_path: Path) -> None:
    order = opened(make(tmp_path / "bank", 4))
    cases = [msgspec.structs.replace(c, bench="b") for c in order.manifest.cases]
    file = run(order, functools.partial(die_on, cases=("case-2",)), cases)
    assert set(file.verdicts) == {"case-1", "case-3", "case-4"}
    assert list(file.notes) == ["case-2"]


def sleep_as(check: Check, case: Case, made_of: str, file: Path) -> Judged:
    """A worker that says who it is, and never ends of itself."""
    file.with_suffix(".part").write_text(str(os.getpid()))
    file.with_suffix(".part").rename(file)
    while True:
        time.sleep(60.0)


def check_asleep(order: Check, file: Path) -> None:
    run(order, functools.partial(sleep_as, file=file))


def wait_for(true: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 120.0
    while not true():
        assert time.monotonic() < end_s
        time.sleep(0.05)


def has_ended(process: Path) -> bool:
    """Whether there is no such process, or only the number that nobody has asked for."""
    try:
        return (process / "stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


def test_a_worker_ends_with_a_check_that_is_killed(tmp_path: Path) -> None:
    order = opened(make(tmp_path / "bank", 1))
    check = get_context("spawn").Process(target=check_asleep, args=(order, tmp_path / "worker"))
    check.start()
    wait_for((tmp_path / "worker").exists)
    worker = Path("/proc") / (tmp_path / "worker").read_text()
    assert not has_ended(worker)
    check.kill()
    check.join()
    wait_for(lambda: has_ended(worker))


def judge_runs(order: Check) -> Judged:
    """What becomes of the first case."""
    case = order.manifest.cases[0]
    return judge(order, case, order.made_of(case))


def test_a_run_that_cannot_be_read_is_part_of_the_answer(order: Check) -> None:
    table = columns()
    del table["duty_y"]
    write(order.folder, "case-1/fit.parquet", table)
    found = judge_runs(order)
    assert found.verdict is None
    assert "duty_y" in found.error


def test_runs_that_are_too_short_give_a_verdict_that_says_why(order: Check) -> None:
    verdict = judge_runs(order).verdict
    assert verdict is not None
    assert verdict["outcome"] == REFUSED
    assert verdict["causes"] == []
    assert "at least 8 s are needed" in " ".join(f["text"] for f in verdict["findings"])


def test_a_worker_with_other_code_or_runs_refuses(order: Check) -> None:
    found = judge(order, order.manifest.cases[0], "0" * 64)
    assert found.verdict is None
    assert "code or runs are other" in found.error
