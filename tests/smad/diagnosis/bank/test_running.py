"""Running a check: resumed where it stopped, past failed cases."""

from __future__ import annotations

import dataclasses
import functools
import os
from collections.abc import Callable
from pathlib import Path

import pytest

import sim_device.plant
from smad.diagnosis.bank.bank import open_bank
from smad.diagnosis.bank.case import How, Part, Task, judge, source_digest
from smad.diagnosis.bank.running import Order, Progress, check
from smad.diagnosis.bank.verdicts import read_verdicts, write_verdicts
from smad.diagnosis.verdict import DIFFERS, REFUSED, Verdict
from tests.smad.diagnosis.bank.test_bank import columns, make, write

QUIET = Verdict(question=DIFFERS, outcome="quiet", headline="no gap")


@pytest.fixture
def order(tmp_path: Path, here: None) -> Order:
    bank = open_bank(make(tmp_path / "bank", 4))
    return Order(bank, bank.manifest.cases, How(), tmp_path / "parts")


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every case is worked on in this process."""
    monkeypatch.setattr("smad.diagnosis.bank.running.apart", lambda work, task: work(task))


def counting(seen: list[str], failing: tuple[str, ...] = ()) -> Callable[[Task], Part]:
    """A worker that notes what it was given, and fails where it is told to."""

    def work(task: Task) -> Part:
        seen.append(task.case.id)
        if task.case.id in failing:
            return Part(task.case.id, 1.0, error="the run is made of cheese")
        return Part(task.case.id, 1.0, QUIET)

    return work


def test_an_interrupted_check_goes_on_where_it_stopped(order: Order) -> None:
    seen: list[str] = []

    def interrupt(progress: Progress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        check(order, jobs=1, report=interrupt, work=counting(seen))
    assert (order.folder / f"{seen[0]}.json").exists()
    again: list[str] = []
    file = check(order, jobs=1, work=counting(again))
    assert list(file.verdicts) == ["case-1", "case-2", "case-3", "case-4"]
    assert seen[0] not in again
    assert check(order, jobs=1, work=counting(once := [])) == file
    assert once == []


def test_half_a_part_is_done_again(order: Order) -> None:
    check(order, jobs=1, work=counting([]))
    (order.folder / "case-3.json").write_text('{"case": "case-3", "sec')
    again: list[str] = []
    check(order, jobs=1, work=counting(again))
    assert again == ["case-3"]


@pytest.mark.parametrize(
    "change",
    [{"variant": "printed"}, {"params": "B"}, {"effects": ("rtd_lag",)}],
    ids=["variant", "parameters", "library"],
)
def test_parts_made_in_another_way_are_not_taken_up(
    order: Order, change: dict[str, object]
) -> None:
    check(order, jobs=1, work=counting([]))
    other = dataclasses.replace(order, how=dataclasses.replace(order.how, **change))
    again: list[str] = []
    check(other, jobs=1, work=counting(again))
    assert len(again) == 4


def _parts_again(order: Order) -> list[str]:
    """Cases that the same check asks for again, as another process would."""
    again: list[str] = []
    check(dataclasses.replace(order), jobs=1, work=counting(again))
    return again


def test_parts_of_runs_that_were_recorded_anew_are_not_taken_up(order: Order) -> None:
    check(order, jobs=1, work=counting([]))
    assert _parts_again(order) == []
    table = columns()
    table["force_N"] = table["force_N"] + 0.01
    path = order.bank.folder / "case-2/fit.parquet"
    before = path.stat()
    write(order.bank.folder, "case-2/fit.parquet", table)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert _parts_again(order) == ["case-2"]


def test_parts_made_with_other_parameters_in_a_file_of_one_name_are_not_taken_up(
    order: Order, tmp_path: Path
) -> None:
    path = tmp_path / "mine.toml"
    nominal = (Path(sim_device.plant.__file__).parent / "data" / "set_a.toml").read_text()
    path.write_text(nominal)
    mine = dataclasses.replace(order, how=How(params=str(path)))
    check(mine, jobs=1, work=counting([]))
    assert _parts_again(mine) == []
    path.write_text(nominal.replace("value = 0.75", "value = 0.76", 1))
    assert len(_parts_again(mine)) == 4


def test_code_counts_as_other_code_with_another_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    before = source_digest()
    monkeypatch.setattr("smad.diagnosis.bank.case.version", lambda name: f"{name} of tomorrow")
    assert source_digest.__wrapped__() != before


def test_parts_of_another_bank_are_not_taken_up(order: Order) -> None:
    check(order, jobs=1, work=counting([]))
    other = dataclasses.replace(order, bank=dataclasses.replace(order.bank, digest="other"))
    again: list[str] = []
    check(other, jobs=1, work=counting(again))
    assert len(again) == 4


def test_a_failed_case_is_named_and_only_it_is_tried_again(order: Order, tmp_path: Path) -> None:
    file = check(order, jobs=2, work=counting([], ("case-2",)))
    assert set(file.verdicts) == {"case-1", "case-3", "case-4"}
    assert file.notes == {"case-2": "the run is made of cheese"}
    path = tmp_path / "verdicts.json"
    write_verdicts(path, file)
    assert read_verdicts(path).notes == file.notes
    again: list[str] = []
    assert len(check(order, jobs=2, work=counting(again)).verdicts) == 4
    assert again == ["case-2"]


def test_progress_tells_the_time_left_from_the_cases_of_this_run(order: Order) -> None:
    check(dataclasses.replace(order, cases=order.cases[:1]), jobs=1, work=counting([]))
    told: list[Progress] = []
    ticks = iter([100.0, 110.0, 120.0, 130.0])
    check(order, jobs=1, report=told.append, clock_s=lambda: next(ticks),
          work=counting([]))  # fmt: skip
    assert [(p.done, p.total, p.left_s) for p in told] == [(2, 4, 20.0), (3, 4, 10.0), (4, 4, 0.0)]


def die_on(task: Task, cases: tuple[str, ...]) -> Part:
    """A worker that ends as one does that ran out of memory."""
    if task.case.id in cases:
        os._exit(9)
    return Part(task.case.id, 0.0, QUIET)


def test_a_worker_that_dies_costs_its_own_case_only(tmp_path: Path) -> None:
    bank = open_bank(make(tmp_path / "bank", 4))
    order = Order(bank, bank.manifest.cases, How(), tmp_path / "parts")
    work = functools.partial(die_on, cases=("case-2",))
    file = check(order, jobs=2, work=work)
    assert set(file.verdicts) == {"case-1", "case-3", "case-4"}
    assert "fewer --jobs" in file.notes["case-2"]


def test_a_run_that_cannot_be_read_is_part_of_the_answer(order: Order) -> None:
    table = columns()
    del table["duty_y"]
    write(order.bank.folder, "case-1/fit.parquet", table)
    part = judge(Task(order.bank, order.cases[0], order.how, source_digest()))
    assert part.verdict is None
    assert "duty_y" in part.error


def test_runs_that_are_too_short_give_a_verdict_that_says_why(order: Order) -> None:
    part = judge(Task(order.bank, order.cases[0], order.how, source_digest()))
    assert part.verdict is not None
    assert part.verdict.outcome == REFUSED
    assert part.verdict.places == []
    assert "at least 8 s are needed" in " ".join(f.text for f in part.verdict.findings)


def test_a_worker_with_other_code_refuses(order: Order) -> None:
    part = judge(Task(order.bank, order.cases[0], order.how, "0" * 64))
    assert part.verdict is None
    assert "other code" in part.error
