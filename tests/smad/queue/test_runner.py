"""The runner on virtual time, with processes and a bench that are made up."""

import os
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from smad.errors import DaemonError
from smad.queue import machine
from smad.queue.bench import BenchSnapshot
from smad.queue.errors import StoreError
from smad.queue.machine import Change, Obstacle, Readiness
from smad.queue.runner import KILL_AFTER_S, SAVE_WITHIN_S, Runner, RunnerParts
from smad.queue.states import Arming, Budget, Item, Snapshot, State, Usage
from smad.queue.store import FILE, Store
from smad.runlog.header import RunHeader
from smad.runlog.reader import read_run
from smad.runlog.schema import Row
from smad.runlog.writer import write_run

BEGAN_S = 1_000_000.0


class MadeProcess:
    """Ends when the test says so."""

    pid = 1

    def __init__(self, stops: int | None) -> None:
        self.status: int | None = None
        self.asked = self.killed = 0
        self.stops = stops

    def known_stops(self) -> int | None:
        return self.stops

    def poll(self) -> int | None:
        return self.status

    def end(self) -> None:
        self.asked += 1

    def kill(self) -> None:
        self.killed += 1

    def last_line(self) -> str:
        return "its last line"


class Night:
    """A store, its runner, and everything around it, with a clock that the test moves."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.store = Store(folder / FILE)
        self.now_s = BEGAN_S
        self.leap_s = 0.0
        self.view = BenchSnapshot(generation=5, bench=Readiness(True), folder=str(folder))
        self.spent = Usage()
        self.processes: list[MadeProcess] = []
        self.obstacles: dict[int, Obstacle] = {}
        self.said: list[str] = []
        self.closed_logs = 0
        self.written_at_start: list[State] = []
        self.runner = self.new_runner()

    def new_runner(self) -> Runner:
        return Runner(
            self.store,
            RunnerParts(
                watch=self,
                start=self._start,
                check=lambda item: self.obstacles.get(item.id),
                say=self.said.append,
                wall_s=lambda: self.now_s + self.leap_s,
                clock_s=lambda: self.now_s,
            ),
        )

    def look(self, *, now: bool = False) -> BenchSnapshot:
        return self.view

    def usage(self) -> Usage:
        spent, self.spent = self.spent, Usage()
        return spent

    def stop_recording(self) -> None:
        self.closed_logs += 1

    def _start(self, item: Item, stops: int | None) -> MadeProcess:
        self.written_at_start.append(self.store.snapshot().item(item.id).state)
        self.processes.append(MadeProcess(stops))
        return self.processes[-1]

    def add(self, count: int = 1) -> None:
        self.store.add(
            [Item(id=0, position=0.0, kind="run", title="run x", words=("run",))] * count
        )

    def arm(self, hours: float = 8.0, budget: Budget | None = None) -> None:
        arming = Arming(
            items=tuple(item.id for item in self.store.snapshot().queued),
            end_unix_s=self.now_s + 3600 * hours,
            longest_s=3600 * hours,
            budget=budget or Budget(),
            generation=self.view.generation,
        )
        self.store.change(lambda s: machine.resumed(s, arming))

    def tick(self, times: int = 1, seconds: float = 0.2) -> None:
        for _ in range(times):
            self.now_s += seconds
            self.runner.tick()

    def stop(self) -> None:
        assert self.view.generation is not None
        self.view = msgspec.structs.replace(self.view, generation=self.view.generation + 1)

    @property
    def queue(self) -> Snapshot:
        return self.store.snapshot()

    def states(self) -> list[State]:
        return [item.state for item in self.queue.items]


@pytest.fixture
def night(tmp_path: Path) -> Night:
    made = Night(tmp_path)
    made.runner.begin()
    return made


def test_items_run_one_after_the_other_each_written_as_running_before_it_begins(
    night: Night,
) -> None:
    night.add(3)
    night.arm()
    for number in range(3):
        night.tick(3)
        assert len(night.processes) == number + 1
        night.processes[-1].status = 0
    night.tick(2)
    assert night.states() == [State.DONE] * 3
    assert night.written_at_start == [State.RUNNING] * 3
    assert night.queue.mode == "paused"
    assert [m.event for m in night.store.messages()] == ["item_ended"] * 3 + ["queue_ended"]


def test_nothing_begins_before_a_person_has_armed(night: Night) -> None:
    night.add(2)
    night.tick(10)
    assert night.processes == []


def test_a_stop_between_two_items_pauses_the_queue(night: Night) -> None:
    night.add(2)
    night.arm()
    night.tick()
    night.processes[0].status = 0
    night.view = msgspec.structs.replace(night.view, bench=Readiness(False))
    night.tick()
    night.stop()
    night.view = msgspec.structs.replace(night.view, bench=Readiness(True))
    night.tick(5)
    assert night.states() == [State.DONE, State.QUEUED]
    assert "somebody stopped the bench" in night.queue.reason


def test_the_stops_that_an_item_makes_itself_pause_nothing(night: Night) -> None:
    night.add(2)
    night.arm()
    night.tick()
    night.stop()
    night.processes[0].stops = night.view.generation
    night.processes[0].status = 0
    night.tick(2)
    assert night.states() == [State.DONE, State.RUNNING]
    assert night.processes[1].stops == night.view.generation


def test_a_stop_that_an_item_does_not_know_of_when_it_ends_pauses_the_queue(night: Night) -> None:
    night.add(2)
    night.arm()
    night.tick()
    night.stop()
    night.processes[0].status = 0
    night.tick(2)
    assert night.states() == [State.DONE, State.QUEUED]
    assert "somebody stopped the bench" in night.queue.reason


def test_an_item_is_begun_with_the_stops_that_its_runner_knows_of(night: Night) -> None:
    night.add()
    night.arm()
    night.tick()
    assert night.processes[0].stops == night.view.generation


def test_a_stop_after_the_arming_and_before_the_first_item_pauses(night: Night) -> None:
    night.add()
    night.arm()
    night.stop()
    night.tick(3)
    assert night.processes == []
    assert night.queue.mode == "paused"


@pytest.mark.parametrize(
    "status", [machine.STOPPED, machine.LOST, machine.TRIPPED, machine.SHORT, -9]
)
def test_an_item_that_a_stop_a_fault_or_a_kill_ended_pauses_the_queue(
    night: Night, status: int
) -> None:
    night.add(2)
    night.arm()
    night.tick()
    night.processes[0].status = status
    night.tick(5)
    assert len(night.processes) == 1
    assert night.states()[1] is State.QUEUED
    assert night.queue.mode == "paused"


def test_a_runner_after_a_kill_runs_nothing_again(night: Night) -> None:
    night.add(2)
    night.arm()
    night.tick()
    for _ in range(3):
        night.runner = night.new_runner()
        night.runner.begin()
        night.tick(5)
    assert len(night.processes) == 1
    assert night.states() == [State.INTERRUPTED, State.QUEUED]
    assert night.queue.mode == "paused"


def test_a_kill_between_writing_and_beginning_interrupts_the_item(night: Night) -> None:
    night.add()
    night.arm()
    night.store.change(lambda s: machine.step(s, night.now_s, Readiness(True)))
    night.runner = night.new_runner()
    night.runner.begin()
    night.tick(5)
    assert night.processes == []
    assert night.states() == [State.INTERRUPTED]


def test_a_limit_asks_the_item_to_end_and_kills_it_when_it_does_not(night: Night) -> None:
    night.add()
    night.arm(budget=Budget(energy_J=100.0))
    night.tick()
    night.spent = Usage(energy_J=150.0)
    night.tick(30)
    assert (night.processes[0].asked, night.processes[0].killed) == (1, 0)
    night.tick(seconds=KILL_AFTER_S + 1.0)
    assert night.processes[0].killed == 1
    night.processes[0].status = -9
    night.tick()
    assert night.states() == [State.INTERRUPTED]
    assert "energy" in night.queue.item(1).reason


def test_the_end_comes_although_the_wall_clock_was_set_back(night: Night) -> None:
    night.add()
    night.arm(hours=1.0)
    night.tick()
    night.leap_s = -86_400.0
    night.tick(62, seconds=60.0)
    assert night.processes[0].asked == 1


def test_an_item_is_looked_at_again_when_it_begins(night: Night) -> None:
    night.add(2)
    night.arm()
    night.obstacles[1] = Obstacle("the baseline is gone")
    night.tick(3)
    assert night.states() == [State.FAILED, State.RUNNING]
    assert night.queue.item(1).reason == "the baseline is gone"


def test_a_disk_without_room_pauses_the_queue_and_fails_no_item(night: Night) -> None:
    night.add(2)
    night.arm()
    night.obstacles[1] = Obstacle("too little room for run logs", of_computer=True)
    night.tick(5)
    assert night.states() == [State.QUEUED, State.QUEUED]
    assert night.queue.reason == "item 1 cannot begin: too little room for run logs"


def test_with_a_disk_that_cannot_be_written_nothing_begins_and_an_end_is_not_lost(
    night: Night, monkeypatch: pytest.MonkeyPatch
) -> None:
    night.add(2)
    night.arm()
    night.tick()
    whole = night.store.change

    def full(decide: Callable[[Snapshot], Change]) -> Change:
        change = decide(night.store.snapshot())
        if change.items or change.after != night.store.snapshot():
            raise StoreError("database or disk is full")
        return change

    monkeypatch.setattr(night.store, "change", full)
    night.processes[0].status = 0
    night.tick(50)
    assert night.states() == [State.RUNNING, State.QUEUED]
    assert night.said.count("database or disk is full") == 1
    monkeypatch.setattr(night.store, "change", whole)
    night.tick(2)
    assert night.states() == [State.DONE, State.RUNNING]


def test_on_a_full_disk_the_end_of_the_arming_still_ends_the_item(
    night: Night, monkeypatch: pytest.MonkeyPatch
) -> None:
    night.add()
    night.arm(hours=1.0)
    night.tick()

    def full(decide: Callable[[Snapshot], Change]) -> Change:
        raise StoreError("database or disk is full")

    monkeypatch.setattr(night.store, "change", full)
    night.tick(3500, seconds=1.0)
    assert night.processes[0].asked == 0
    night.tick(150, seconds=1.0)
    assert night.processes[0].asked == 1


def test_on_a_full_disk_what_is_used_still_counts_for_the_budget(
    night: Night, monkeypatch: pytest.MonkeyPatch
) -> None:
    night.add()
    night.arm(budget=Budget(energy_J=1000.0))
    night.tick()

    def full(decide: Callable[[Snapshot], Change]) -> Change:
        raise StoreError("database or disk is full")

    monkeypatch.setattr(night.store, "change", full)
    for _ in range(110):
        assert night.processes[0].asked == 0
        night.spent = Usage(energy_J=9.0)
        night.tick(seconds=1.0)
    night.spent = Usage(energy_J=20.0)
    night.tick()
    assert night.processes[0].asked == 1


def test_a_runner_whose_queue_was_moved_away_ends_its_item_and_says_so(night: Night) -> None:
    night.add()
    night.arm()
    night.tick()
    (night.folder / FILE).rename(night.folder / "old.sqlite")
    with pytest.raises(StoreError, match="was moved away or removed"):
        night.runner.run(until_paused=True)
    night.processes[0].status = 143
    night.runner.close()
    assert night.processes[0].asked == 1


def cut_log(folder: Path) -> Path:
    path = folder / "20261125-220000-run.mcap"
    rows = [Row(t_s=0.01 * n, host_time_s=BEGAN_S + 0.01 * n) for n in range(3000)]
    write_run(path, RunHeader(source="sim", name="run", rate_hz=100.0), rows)
    path.write_bytes(path.read_bytes()[:-2000])
    return path


def test_the_run_log_of_an_interrupted_item_is_recovered(night: Night) -> None:
    night.add()
    night.arm()
    night.tick()
    path = cut_log(night.folder)
    night.view = msgspec.structs.replace(night.view, recording=str(path), being_recorded=True)
    night.tick()
    night.view = BenchSnapshot()
    night.runner = night.new_runner()
    night.runner.begin()
    recovered = path.with_name(f"{path.stem}.recovered.mcap")
    assert len(read_run(recovered).columns["t_s"]) > 1000
    assert any("recovered to" in text for text in night.said)


@pytest.mark.parametrize("back_s", [0.0, 3600.0])
def test_a_log_that_nobody_noted_is_recovered_where_a_killed_daemon_recorded(
    night: Night, tmp_path_factory: pytest.TempPathFactory, back_s: float
) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    night.view = msgspec.structs.replace(night.view, folder=str(elsewhere))
    night.add()
    night.arm()
    night.now_s = BEGAN_S
    night.tick()
    path = cut_log(elsewhere)
    night.leap_s = -back_s
    os.utime(path, (BEGAN_S - back_s, BEGAN_S - back_s))
    night.view = BenchSnapshot()
    night.processes[0].status = machine.LOST
    night.tick()
    assert path.with_name(f"{path.stem}.recovered.mcap").exists()


def test_a_recording_that_somebody_began_after_a_runner_was_killed_goes_on(
    night: Night, monkeypatch: pytest.MonkeyPatch
) -> None:
    night.add()
    night.arm()
    night.tick()
    path = cut_log(night.folder)
    night.view = msgspec.structs.replace(night.view, recording=str(path), being_recorded=True)
    monkeypatch.setattr("smad.queue.runner.being_written", lambda path: True)
    night.runner = night.new_runner()
    night.runner.begin()
    night.tick(2)
    assert night.states() == [State.INTERRUPTED]
    assert night.closed_logs == 0


def test_a_process_that_cannot_be_begun_pauses_the_queue(
    night: Night, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(item: Item, stops: int | None) -> MadeProcess:
        raise OSError(12, "Cannot allocate memory")

    object.__setattr__(night.runner._parts, "start", refuse)
    night.add()
    night.arm()
    night.tick(2)
    assert night.states() == [State.INTERRUPTED]
    assert night.queue.mode == "paused"
    assert "Cannot allocate memory" in night.queue.item(1).reason


def test_the_end_of_an_item_that_could_not_begin_is_written_once_there_is_room(
    night: Night, monkeypatch: pytest.MonkeyPatch
) -> None:
    change = night.store.change

    def refuse(item: Item, stops: int | None) -> MadeProcess:
        monkeypatch.setattr(night.store, "change", full)
        raise OSError(28, "No space left on device")

    def full(decide: Callable[[Snapshot], Change]) -> Change:
        raise StoreError("no room")

    object.__setattr__(night.runner._parts, "start", refuse)
    night.add()
    night.arm()
    night.tick(2)
    assert night.states() == [State.RUNNING]
    monkeypatch.setattr(night.store, "change", change)
    night.tick()
    assert night.states() == [State.INTERRUPTED]
    assert "No space left" in night.queue.item(1).reason


def test_closing_the_runner_ends_its_item_in_order(
    night: Night, monkeypatch: pytest.MonkeyPatch
) -> None:
    night.add(2)
    night.arm()
    night.tick()

    def sleep(seconds: float) -> None:
        night.now_s += seconds
        night.processes[0].status = 143

    monkeypatch.setattr("smad.queue.runner.time.sleep", sleep)
    night.runner.close()
    assert night.states() == [State.INTERRUPTED, State.QUEUED]
    assert night.queue.reason == "the runner was ended"


def test_a_daemon_that_does_not_close_the_log_is_told_and_nothing_else_suffers(
    night: Night, monkeypatch: pytest.MonkeyPatch
) -> None:
    def away() -> None:
        raise DaemonError("no daemon")

    path = cut_log(night.folder)
    monkeypatch.setattr(night, "stop_recording", away)
    monkeypatch.setattr("smad.queue.runner.being_written", lambda path: True)
    night.add()
    night.arm()
    night.tick()
    night.view = msgspec.structs.replace(night.view, recording=str(path), being_recorded=True)
    night.tick()
    night.processes[0].status = -9
    night.tick()
    assert night.states() == [State.INTERRUPTED]
    night.tick(seconds=SAVE_WITHIN_S)
    assert [text for text in night.said if "no daemon" in text] == [f"run log {path}: no daemon"]


def test_a_log_that_the_lease_of_a_killed_item_keeps_is_closed_once_that_has_lapsed(
    night: Night, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = cut_log(night.folder)
    monkeypatch.setattr("smad.queue.runner.being_written", lambda path: True)
    lapses_s = night.now_s + 3.0
    whole = night.stop_recording

    def held() -> None:
        if night.now_s < lapses_s:
            raise DaemonError("somebody has control")
        whole()

    monkeypatch.setattr(night, "stop_recording", held)
    night.add()
    night.arm()
    night.tick()
    night.view = msgspec.structs.replace(night.view, recording=str(path), being_recorded=True)
    night.tick()
    night.processes[0].status = -9
    night.tick(30)
    assert night.closed_logs == 1
    assert not any("somebody has control" in text for text in night.said)
