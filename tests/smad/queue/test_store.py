"""The file of a queue: what is written, what is refused, what two processes may do at once."""

import contextlib
import sqlite3
import threading
from pathlib import Path

import pytest

from campaign.faults.smalldisk import small_disk
from smad.queue import machine
from smad.queue.errors import StoreError
from smad.queue.machine import Readiness
from smad.queue.states import Arming, Budget, Item, Snapshot, State
from smad.queue.store import FILE, VERSION, Proposal, Store

ITEM = Item(id=0, position=0.0, kind="run", title="run fig11", words=("run", "fig11-tracking"))
ARMING = Arming(items=(1,), end_unix_s=2e9, longest_s=3600.0, budget=Budget(energy_J=5e3))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / FILE


def armed(store: Store) -> None:
    store.add([ITEM])
    store.change(lambda s: machine.resumed(s, ARMING))


def test_what_was_changed_is_read_back_by_another_process(path: Path) -> None:
    with Store(path) as store:
        armed(store)
        store.change(lambda s: machine.step(s, 1.0, Readiness(True)))
        before = store.snapshot()
    with Store(path) as again:
        assert again.snapshot() == before
        assert before.running is not None
        assert before.arming == ARMING


def test_numbers_of_items_are_never_used_again(path: Path) -> None:
    with Store(path) as store:
        (first,) = store.add([ITEM])
        store.change(lambda s: machine.removed(s, first.id, 1.0))
        assert [item.id for item in store.add([ITEM, ITEM])] == [2, 3]


def test_a_decision_that_raises_changes_nothing(path: Path) -> None:
    with Store(path) as store:
        armed(store)
        before = store.snapshot()
        with pytest.raises(RuntimeError):
            store.change(_raising)
        assert store.snapshot() == before


def _raising(snapshot: Snapshot) -> machine.Change:
    raise RuntimeError


def test_of_two_that_start_an_item_at_once_only_one_does(path: Path) -> None:
    with Store(path) as store:
        armed(store)
    started: list[int] = []

    def start() -> None:
        with Store(path) as own:
            change = own.change(lambda s: machine.step(s, 1.0, Readiness(True)))
            started.append(len(change.items))

    threads = [threading.Thread(target=start) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(started) == [0] * 7 + [1]


def test_a_queue_of_a_newer_version_is_refused_and_left_as_it_is(path: Path) -> None:
    Store(path).close()
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.execute(f"PRAGMA user_version={VERSION + 1}")
    before = path.read_bytes()
    with pytest.raises(StoreError, match="written by a newer smad; got version 2"):
        Store(path)
    assert path.read_bytes() == before


def test_a_file_that_is_no_queue_is_refused(path: Path) -> None:
    path.write_text("no database at all, but long enough to be taken for one" * 20)
    with pytest.raises(StoreError, match="damaged"):
        Store(path)
    path.unlink()
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE other (x)")
    with pytest.raises(StoreError, match="not a queue of smad"):
        Store(path)


def test_a_record_that_is_damaged_is_told(path: Path) -> None:
    with Store(path) as store:
        armed(store)
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE item SET record='{\"id\": 1}'")
    with Store(path) as store, pytest.raises(StoreError, match="damaged"):
        store.snapshot()


def test_on_a_full_disk_nothing_is_changed_and_with_room_again_it_goes_on(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk") as disk:
        if disk.refused:
            pytest.skip(disk.refused)
        with Store(disk.folder / FILE) as store:
            armed(store)
            disk.fill(0, disk.folder)
            with pytest.raises(StoreError, match="make room"):
                store.change(lambda s: machine.step(s, 1.0, Readiness(True)))
            assert store.snapshot().running is None
            disk.empty()
            store.change(lambda s: machine.step(s, 1.0, Readiness(True)))
            assert store.snapshot().item(1).state is State.RUNNING


def test_a_commit_reaches_the_disk_before_it_returns(path: Path) -> None:
    with Store(path) as store:
        assert store._db.execute("PRAGMA synchronous").fetchone() == (3,)
        assert store._db.execute("PRAGMA journal_mode").fetchone() == ("delete",)


def test_proposals_logs_and_messages_are_kept_and_old_messages_forgotten(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("smad.queue.store.MOST_MESSAGES", 10)
    with Store(path) as store:
        proposal = Proposal(code="ABCD", made_unix_s=1.0, arming=ARMING)
        store.propose(proposal)
        assert store.proposal() == proposal
        store.propose(None)
        assert store.proposal() is None
        store.add_log(1, "a.mcap")
        store.add_log(1, "a.mcap")
        assert store.logs(1) == ("a.mcap",)
        for number in range(13):
            store.add_message("item_ended", f"{number}", None, 1.0)
        kept = store.messages()
        assert len(kept) == 10
        assert kept[-1].text == "12"
        assert [m.text for m in store.messages(after=kept[-2].id)] == ["12"]
