"""What a watcher keeps for the one after it."""

from pathlib import Path

import pytest

from smad.hooks.events import WatcherState
from smad.hooks.watch import Watcher
from smad.queue.machine import Change
from smad.queue.states import Snapshot
from smad.queue.store import FILE, Store

ABSENT = "no such bench"


def say(folder: Path, *texts: str) -> None:
    with Store(folder / FILE) as store:
        store.change(lambda s: Change(after=s))
        for text in texts:
            store.add_message("item_ended", text, None, 1.0)


def texts_of(watcher: Watcher) -> list[str]:
    look = watcher.look()
    assert isinstance(look.snapshot, Snapshot)
    return [message.text for message in look.messages]


def test_messages_that_came_while_nobody_watched_are_new_to_the_next_watcher(
    tmp_path: Path,
) -> None:
    say(tmp_path, "before")
    first = Watcher(ABSENT, tmp_path)
    assert first.known() is None
    assert texts_of(first) == []
    first.keep(WatcherState(message=first.look().message))
    first.close()
    say(tmp_path, "meanwhile")
    second = Watcher(ABSENT, tmp_path)
    assert second.known() == WatcherState(message=1)
    assert texts_of(second) == ["meanwhile"]
    assert texts_of(second) == []
    second.close()


def test_a_new_queue_in_the_place_of_the_old_one_is_told_from_its_beginning(
    tmp_path: Path,
) -> None:
    watcher = Watcher(ABSENT, tmp_path)
    watcher.keep(WatcherState(message=40))
    watcher.known()
    say(tmp_path, "first of the new one")
    assert texts_of(watcher) == ["first of the new one"]
    watcher.close()


def test_a_queue_that_is_begun_anew_while_it_is_watched_is_told_too(tmp_path: Path) -> None:
    say(tmp_path, "of the old one")
    watcher = Watcher(ABSENT, tmp_path)
    watcher.known()
    texts_of(watcher)
    (tmp_path / FILE).rename(tmp_path / "old.sqlite")
    assert watcher.look().snapshot is None
    say(tmp_path, "of the new one")
    assert texts_of(watcher) == ["of the new one"]
    watcher.close()


def test_a_watcher_that_ran_before_there_was_any_folder_lets_the_next_one_catch_up(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "runs"
    first = Watcher(ABSENT, folder)
    assert first.known() is None
    first.keep(WatcherState())
    say(folder, "the first")
    assert texts_of(first) == ["the first"]
    second = Watcher(ABSENT, folder)
    assert second.known() == WatcherState()
    assert texts_of(second) == ["the first"]
    for watcher in (first, second):
        watcher.close()


@pytest.mark.parametrize("content", ["", "{", '{"message": "x"}'])
def test_a_damaged_file_only_costs_the_catching_up(tmp_path: Path, content: str) -> None:
    (tmp_path / f"hooks-{ABSENT}.json").write_text(content)
    watcher = Watcher(ABSENT, tmp_path)
    assert watcher.known() is None
    watcher.keep(WatcherState(message=3))
    assert watcher.known() == WatcherState(message=3)
