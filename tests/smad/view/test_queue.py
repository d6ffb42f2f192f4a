"""The queue on the page: what the server does, and the table and form in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest

from smad.queue import Queue, QueueError
from smad.queue.lease import RunnerLease
from smad.view import commands, queue

from .browsing import BrowsedBench, click, in_a_browser, is_live, text_of, until


def carry_out(folder: Path, **verb: Any) -> tuple[str, str]:
    return queue.carry_out(folder, "bench", msgspec.convert(verb, queue.Verb))


def test_a_folder_without_a_queue_shows_an_empty_one_and_makes_no_file(tmp_path: Path) -> None:
    assert queue.queue_state(tmp_path, "bench").lines == ()
    assert list(tmp_path.iterdir()) == []


def test_a_page_adds_places_removes_and_arms_in_two_steps(tmp_path: Path) -> None:
    assert carry_out(tmp_path, verb="add", kind="run", what="dsc", repeat=3)[0] == (
        "queued: item 1, item 2, item 3"
    )
    carry_out(tmp_path, verb="place", item=3, place=1)
    carry_out(tmp_path, verb="remove", item=1)
    lines = queue.queue_state(tmp_path, "bench").lines
    assert [(line.item, line.state, line.place) for line in lines] == [
        (1, "removed", 0),
        (3, "queued", 1),
        (2, "queued", 2),
    ]
    text, code = carry_out(tmp_path, verb="propose", hours=8.0)
    assert text == "2 items for at most 8 h"
    with pytest.raises(QueueError, match="no runner"):
        carry_out(tmp_path, verb="confirm", code=code)
    lease = RunnerLease(tmp_path)
    lease.acquire()
    assert carry_out(tmp_path, verb="confirm", code=code)[0] == "the queue runs"
    shown = queue.queue_state(tmp_path, "bench")
    assert (shown.mode, shown.runner) == ("running", True)
    carry_out(tmp_path, verb="pause", now=True)
    assert queue.queue_state(tmp_path, "bench").reason == "paused by hand"
    lease.release()


@pytest.mark.parametrize(
    ("verb", "words"),
    [
        ({"verb": "add", "kind": "run", "what": "--report=/etc/passwd"}, "not a name"),
        ({"verb": "add", "kind": "run", "what": "nonsense"}, "no such experiment"),
        ({"verb": "add", "kind": "checkup", "what": "nowhere"}, "no baseline"),
        ({"verb": "remove", "item": 7}, "no such item"),
        ({"verb": "confirm", "code": "AAAA"}, "no runner"),
    ],
)
def test_what_a_page_asks_wrongly_is_refused_in_words(
    tmp_path: Path, verb: dict[str, Any], words: str
) -> None:
    with pytest.raises(QueueError, match=words):
        carry_out(tmp_path, **verb)


def test_a_page_that_only_watches_may_see_the_queue_and_not_change_it() -> None:
    assert commands.ShowQueue in commands.WATCHING
    assert commands.ChangeQueue not in commands.WATCHING


@in_a_browser
def test_the_table_shows_what_the_form_adds(page: Any, bench: BrowsedBench) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    page.execute_script("document.getElementById('queue').open = true")
    until(page, lambda d: text_of(d, "queue-state").startswith("paused"))
    page.execute_script("document.getElementById('queue-what').value = 'dsc'")
    # The second click of a double click adds nothing again.
    add = page.find_element("css selector", "#queue-add button")
    ActionChains(page).double_click(add).perform()
    until(page, lambda d: "dsc" in text_of(d, "queue-list"))
    click(page, "#queue-arm button")
    until(page, lambda d: "1 item for at most 8 h" in text_of(d, "queue-confirm"))
    with Queue(bench.client.status().recorder.folder) as made:
        assert [item.title for item in made.snapshot().queued] == ["run dsc"]
        made.remove(1)
    until(page, lambda d: "removed" in text_of(d, "queue-list"))


@in_a_browser
def test_the_watching_page_has_the_table_without_buttons(
    chromium: Any, bench: BrowsedBench
) -> None:
    with Queue(bench.client.status().recorder.folder) as made:
        made.add("run", "dsc")
    chromium.get(bench.page.watch)
    until(chromium, is_live)
    chromium.execute_script("document.getElementById('queue').open = true")
    until(chromium, lambda d: "queued" in text_of(d, "queue-list"))
    assert chromium.execute_script("return document.querySelectorAll('#queue button').length") == 0
