"""What a queue does next, decided without clocks and files."""

import itertools
from pathlib import Path

import msgspec
import pytest

from smad.queue import QueueError, machine
from smad.queue.machine import EndItem, Obstacle, PostMessage, Readiness, StartItem
from smad.queue.states import FOLLOWING, Arming, Budget, Item, Snapshot, State, Usage, moved

ROOT = Path(__file__).resolve().parents[3]
READY = Readiness(True)
NOW_S = 1_000.0


def item(number: int, state: State = State.QUEUED) -> Item:
    return Item(
        id=number,
        position=float(number),
        kind="run",
        title=f"run {number}",
        words=("run",),
        state=state,
    )


def armed(*items: Item, **limits: float) -> Snapshot:
    arming = Arming(
        items=tuple(entry.id for entry in items),
        end_unix_s=NOW_S + 3600.0,
        longest_s=3600.0,
        budget=Budget(**limits),
    )
    return Snapshot(items=items, mode="running", reason="", arming=arming)


def after_start(*items: Item, **limits: float) -> Snapshot:
    return machine.step(armed(*items, **limits), NOW_S, READY).after


def using(snapshot: Snapshot, **amounts: float) -> Snapshot:
    return machine.used(snapshot, Usage(**amounts)).after


def test_no_state_leads_to_running_but_queued_and_none_leads_back_to_queued() -> None:
    assert [s for s, after in FOLLOWING.items() if State.RUNNING in after] == [State.QUEUED]
    assert [s for s, after in FOLLOWING.items() if State.QUEUED in after] == []
    assert set(FOLLOWING) == set(State)


def test_the_table_of_the_decision_is_that_of_the_code() -> None:
    page = (ROOT / "docs" / "decisions" / "0613-queue.md").read_text()
    rows = [line.split("|")[1:] for line in page.splitlines() if line.startswith("| ")]
    table = {
        row[0].strip(): {name.strip() for name in row[2].split(",") if name.strip()}
        for row in rows[1:]
    }
    assert table == {s: set(map(str, after)) for s, after in FOLLOWING.items()}


@pytest.mark.parametrize(("before", "after"), list(itertools.product(State, State)))
def test_a_change_that_is_in_no_table_is_refused(before: State, after: State) -> None:
    if after in FOLLOWING[before]:
        assert moved(item(1, before), after).state is after
    else:
        with pytest.raises(QueueError, match="cannot become"):
            moved(item(1, before), after)


def test_the_first_that_waits_begins_and_is_written_as_running() -> None:
    change = machine.step(armed(item(2), item(3)), NOW_S, READY)
    assert [i.state for i in change.items] == [State.RUNNING]
    assert change.actions == (StartItem(change.items[0]),)
    assert change.after.running is not None
    assert change.after.running.id == 2


def test_nothing_begins_while_paused_or_while_an_item_runs() -> None:
    paused = Snapshot(items=(item(1),))
    assert machine.step(paused, NOW_S, READY).actions == ()
    running = after_start(item(1), item(2))
    assert machine.step(running, NOW_S, READY).actions == ()


def test_an_item_waits_while_the_bench_cools_but_a_simulated_one_does_not() -> None:
    assert machine.step(armed(item(1)), NOW_S, Readiness(False)).items == ()
    simulated = msgspec.structs.replace(item(1), on_bench=False)
    assert machine.step(armed(simulated), NOW_S, Readiness(False)).after.running is not None


def test_a_bench_in_trouble_pauses_the_queue_before_an_item_begins() -> None:
    after = machine.step(armed(item(1)), NOW_S, Readiness(False, "the bench has a fault")).after
    assert (after.mode, after.reason) == ("paused", "the bench has a fault")
    assert after.queued[0].id == 1


@pytest.mark.parametrize(
    ("status", "state", "mode"),
    [
        (0, State.DONE, "running"),
        (1, State.FAILED, "running"),
        (2, State.FAILED, "running"),
        (machine.STOPPED, State.INTERRUPTED, "paused"),
        (machine.TRIPPED, State.FAILED, "paused"),
        (machine.LOST, State.INTERRUPTED, "paused"),
        (machine.SHORT, State.INTERRUPTED, "paused"),
        (-9, State.INTERRUPTED, "paused"),
        (137, State.INTERRUPTED, "paused"),
    ],
)
def test_an_exit_status_decides_the_state_and_whether_the_queue_goes_on(
    status: int, state: State, mode: str
) -> None:
    change = machine.ended(after_start(item(1), item(2)), 1, status, NOW_S, said="because")
    if status not in (0, -9, 137):
        assert change.after.item(1).reason == "because"
    assert change.after.item(1).state is state
    assert change.after.mode == mode
    assert (change.after.arming is None) == (mode == "paused")


def test_the_last_item_ends_the_queue_and_says_so() -> None:
    over = machine.ended(after_start(item(1)), 1, 0, NOW_S).after
    change = machine.step(over, NOW_S, READY)
    assert change.after.mode == "paused"
    assert change.actions == (PostMessage("queue_ended", "every item has ended"),)


def test_a_runner_that_begins_interrupts_what_ran_and_pauses() -> None:
    change = machine.recover(after_start(item(1), item(2)), NOW_S)
    assert change.after.item(1).state is State.INTERRUPTED
    assert change.after.item(2).state is State.QUEUED
    assert change.after.mode == "paused"
    assert not any(isinstance(action, StartItem) for action in change.actions)


def test_a_runner_that_begins_between_two_items_pauses_an_armed_queue() -> None:
    after = machine.recover(armed(item(1)), NOW_S).after
    assert (after.mode, after.arming) == ("paused", None)


def test_an_item_that_was_added_after_the_arming_pauses_the_queue() -> None:
    queue = armed(item(1))
    queue = msgspec.structs.replace(queue, items=(item(1, State.DONE), item(2)))
    after = machine.step(queue, NOW_S, READY).after
    assert after.mode == "paused"
    assert "added after" in after.reason
    assert after.item(2).state is State.QUEUED


@pytest.mark.parametrize(
    ("limits", "used", "words"),
    [
        ({"energy_J": 1e3}, {"energy_J": 1e3}, "energy"),
        ({"cycles": 10.0}, {"cycles": 10.0}, "cycles"),
        ({"hours": 0.5}, {"seconds": 1800.0}, "hours"),
        ({}, {"seconds": 3600.0}, "end time"),
    ],
)
def test_a_limit_that_is_reached_ends_the_item_and_pauses(
    limits: dict[str, float], used: dict[str, float], words: str
) -> None:
    before = using(after_start(item(1), **limits), **used)
    change = machine.step(before, NOW_S, READY)
    assert words in change.after.reason
    assert [type(action) for action in change.actions] == [EndItem, PostMessage]
    over = machine.ended(change.after, 1, 143, NOW_S).after
    assert over.item(1).state is State.INTERRUPTED
    assert words in over.item(1).reason


def test_a_wall_clock_that_leaps_ahead_ends_the_arming_and_one_that_leaps_back_does_not() -> None:
    running = after_start(item(1))
    assert machine.step(running, NOW_S + 7200.0, READY).after.mode == "paused"
    leapt_back = using(running, seconds=3600.0)
    assert machine.step(leapt_back, NOW_S - 86_400.0, READY).after.mode == "paused"


def test_pausing_now_asks_the_item_to_end_until_it_has() -> None:
    paused = machine.paused(after_start(item(1)), "by hand", end_item=True)
    assert isinstance(paused.actions[0], EndItem)
    again = machine.step(paused.after, NOW_S, READY)
    assert [type(action) for action in again.actions] == [EndItem]
    over = machine.ended(paused.after, 1, 143, NOW_S).after
    assert not over.end_item
    assert machine.step(over, NOW_S, READY).actions == ()


def test_pausing_lets_the_item_go_on_to_its_end() -> None:
    paused = machine.paused(after_start(item(1), item(2)), "by hand").after
    assert machine.step(paused, NOW_S, READY).actions == ()
    over = machine.ended(paused, 1, 0, NOW_S).after
    assert over.item(1).state is State.DONE
    assert machine.step(over, NOW_S, READY).actions == ()


def test_an_item_that_cannot_start_fails_and_the_next_one_begins() -> None:
    queue = armed(item(1), item(2))
    change = machine.step(queue, NOW_S, READY, obstacles={1: Obstacle("the baseline is gone")})
    assert change.after.item(1).state is State.FAILED
    assert change.after.item(1).reason == "the baseline is gone"
    assert machine.step(change.after, NOW_S, READY).after.running is not None


def test_a_running_item_is_not_removed_and_a_queued_one_is() -> None:
    running = after_start(item(1), item(2))
    with pytest.raises(QueueError, match="item 1 is running"):
        machine.removed(running, 1, NOW_S)
    assert machine.removed(running, 2, NOW_S).after.item(2).state is State.REMOVED
    with pytest.raises(QueueError, match="no such item"):
        machine.removed(running, 7, NOW_S)


def test_an_item_is_placed_among_those_that_wait() -> None:
    queue = Snapshot(items=(item(1), item(2), item(3)))
    assert [i.id for i in machine.placed(queue, 3, 1).after.queued] == [3, 1, 2]
    with pytest.raises(QueueError, match="allowed: 1 to 3"):
        machine.placed(queue, 3, 4)


def test_a_running_queue_cannot_be_armed_and_neither_can_one_whose_item_still_runs() -> None:
    running = after_start(item(1))
    assert running.arming is not None
    with pytest.raises(QueueError, match="running already"):
        machine.resumed(running, running.arming)
    with pytest.raises(QueueError, match="still running"):
        machine.resumed(machine.paused(running, "by hand").after, running.arming)
