"""One page's conversation: what is sent and when, what is done, and that a stop never waits."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Any, cast

import pytest
from msgspec.structs import replace
from websockets.asyncio.server import ServerConnection

from firmware_protocol.enums import BoardState
from smad import api
from smad.client import AsyncClient, NotReady
from smad.config import AxisConfig, Config
from smad.style import strips
from smad.view import page as pages
from smad.view.access import Right
from smad.view.page import IN_FLIGHT, MOST_STOPS, MOST_WAITING, PATIENCE_S, Page
from smad.view.queries import Queries
from smad.view.replies import Mark
from smad.view.source import SILENT_AFTER_S, Source
from smad.view.state import NO_WORD, bench_state

from .test_forms_and_state import status

MOTION = api.Motion(
    running="idle",
    done=True,
    armed=False,
    mode="COOL",
    reference_mm=None,
    displacement_mm=None,
    board_time_s=1.0,
)
ONES = (1.0,) * len(strips.PLACES)
SHOW = {"do": "show", "channels": ["displacement_mm"]}
MOVE = {"do": "move", "trajectory": {"kind": "hold", "duration_s": 1}}


class Browser:
    """The other end of a page's connection."""

    def __init__(self) -> None:
        self.got: list[dict[str, Any]] = []
        self.ended = ""
        self._said: asyncio.Queue[str | None] = asyncio.Queue()

    async def send(self, text: str) -> None:
        self.got.append(json.loads(text))

    def __aiter__(self) -> AsyncIterator[str]:
        return self._messages()

    async def _messages(self) -> AsyncIterator[str]:
        while (text := await self._said.get()) is not None:
            yield text

    def say(self, message: Any) -> None:
        self._said.put_nowait(message if isinstance(message, str) else json.dumps(message))

    async def close(self, code: int, reason: str) -> None:
        self.ended = reason
        self.leave()

    def leave(self) -> None:
        self._said.put_nowait(None)

    def of(self, kind: str) -> list[dict[str, Any]]:
        return [message for message in self.got if message["type"] == kind]

    def replies(self) -> dict[int, tuple[bool, str]]:
        return {reply["id"]: (reply["done"], reply["text"]) for reply in self.of("reply")}


class FakeClient:
    """Notes what it is asked; `busy` holds every command back until it is set."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.generations: list[int | None] = []
        self.axes: list[str] = []
        self.free = asyncio.Event()
        self.free.set()
        self.stopped = asyncio.Event()
        self.stopped.set()
        self.refuse_arming = False

    def as_of(self, generation: int | None) -> None:
        self.generations.append(generation)

    async def _do(self, name: str) -> api.Motion:
        self.asked.append(name)
        await self.free.wait()
        return MOTION

    async def move(self, *pieces: Any, queue: bool) -> api.Motion:
        return await self._do("move")

    def __getitem__(self, axis: str) -> FakeClient:
        self.axes.append(axis)
        return self

    async def arm(self, *axes: str) -> api.Motion:
        self.axes += axes
        await self._do("arm")
        if self.refuse_arming:
            raise NotReady("it is too warm")
        return MOTION

    async def disarm(self) -> api.Motion:
        self.asked.append("disarm")
        await self.stopped.wait()
        return MOTION

    async def tune(self, gains: Any) -> None:
        await self._do("tune")

    async def take_control(self, name: str, lease_s: float) -> None:
        self.asked.append("take_control")

    async def release_control(self) -> None:
        self.asked.append("release_control")

    def close(self) -> None:
        self.asked.append("close")


class Rig:
    """A page with a fake browser and a fake client."""

    def __init__(self, right: Right) -> None:
        self.now_s = 0.0
        self.clients = 0
        self.source = Source("bench", clock_s=lambda: self.now_s)
        self.axis = self.source.axis("")
        self.queries = Queries(self.source)
        self.browser, self.client = Browser(), FakeClient()
        page = Page(
            cast(ServerConnection, self.browser),
            right,
            self.source,
            self._new_client,
            self.queries,
        )
        self.running = asyncio.create_task(page.run())

    def _new_client(self) -> AsyncClient:
        self.clients += 1
        return cast(AsyncClient, self.client)

    async def settle(self) -> None:
        """Let everything happen that can happen without time passing."""
        for _ in range(50):
            await asyncio.sleep(0)

    async def frames_pass(self, count: int) -> None:
        """Let the page's own clock tick; how long that takes does not matter."""
        for _ in range(count):
            await asyncio.sleep(1 / 30)

    async def end(self) -> None:
        self.browser.leave()
        await self.running


@pytest.fixture
async def rig() -> AsyncIterator[Rig]:
    made = Rig("command")
    yield made
    await made.end()


@pytest.fixture
async def watcher() -> AsyncIterator[Rig]:
    made = Rig("watch")
    yield made
    await made.end()


async def test_a_stop_passes_a_command_that_hangs_and_takes_the_waiting_ones_with_it(
    rig: Rig,
) -> None:
    rig.client.free.clear()
    rig.browser.say({**MOVE, "id": 1})
    await rig.settle()
    for number in range(2, 6):
        rig.browser.say({**MOVE, "id": number})
    rig.browser.say({"do": "stop", "id": 9})
    await rig.settle()
    assert rig.client.asked[:2] == ["move", "disarm"]
    replies = rig.browser.replies()
    assert replies[9] == (True, "stopped: the board is in COOL")
    assert {number for number, (done, _) in replies.items() if not done} == {2, 3, 4, 5}
    rig.client.free.set()
    await rig.settle()
    assert rig.client.asked.count("move") == 1


async def test_a_stop_does_not_wait_for_an_earlier_stop(rig: Rig) -> None:
    rig.client.stopped.clear()
    rig.browser.say({"do": "stop", "id": 1})
    await rig.settle()
    for number in range(2, 21):
        rig.browser.say({"do": "stop", "id": number})
    await rig.settle()
    asked, clients = rig.client.asked.count("disarm"), rig.clients
    rig.client.stopped.set()
    await rig.settle()
    # Each has a client of its own, as one client's stops go one after the other.
    assert (asked, clients) == (MOST_STOPS, MOST_STOPS)
    assert sum(done for done, _ in rig.browser.replies().values()) == MOST_STOPS


async def test_a_flood_from_the_page_is_refused_and_does_not_grow(rig: Rig) -> None:
    rig.client.free.clear()
    rig.browser.say({**MOVE, "id": 1})
    await rig.settle()
    for number in range(2, 1001):
        rig.browser.say({**MOVE, "id": number})
    await rig.settle()
    await rig.frames_pass(1)
    refused = [text for done, text in rig.browser.replies().values() if not done]
    assert len(refused) == 1000 - MOST_WAITING - 1
    rig.client.free.set()


async def test_a_command_carries_the_generation_that_the_page_had_shown(rig: Rig) -> None:
    rig.browser.say({**MOVE, "id": 1, "generation": 4})
    await rig.settle()
    assert rig.client.generations == [4]


async def test_a_page_that_keeps_control_renews_it_while_it_is_there(rig: Rig) -> None:
    rig.browser.say({"do": "arm", "id": 1})
    await rig.settle()
    assert rig.client.asked == ["take_control", "arm"]
    rig.browser.say({"do": "alive"})
    await rig.settle()
    assert rig.client.asked[2:] == ["take_control"]
    rig.browser.say({"do": "stop", "id": 2})
    await rig.settle()
    assert rig.client.asked[3:] == ["disarm", "release_control"]
    rig.browser.say({"do": "alive"})
    await rig.settle()
    assert len(rig.client.asked) == 5


async def test_a_stop_while_the_page_takes_control_is_not_known_to_its_arming(rig: Rig) -> None:
    take = rig.client.take_control

    async def stopped_meanwhile(name: str, lease_s: float) -> None:
        await take(name, lease_s)
        # What the reply to our own stop lets the client know of.
        rig.client.as_of(5)

    rig.client.take_control = stopped_meanwhile  # type: ignore[method-assign]
    rig.browser.say({"do": "arm", "id": 1, "generation": 4})
    await rig.settle()
    assert rig.client.asked == ["take_control", "arm"]
    assert rig.client.generations[-1] == 4


async def test_control_is_given_back_once_somebody_else_has_stopped_the_bench(rig: Rig) -> None:
    rig.browser.say({"do": "arm", "id": 1})
    await rig.settle()
    rig.axis.shown = bench_state(status("COOL"))
    for version, asked in ((0, "take_control"), (1, "take_control"), (2, "release_control")):
        # The first ones may have been asked for before the bench was armed.
        rig.source.version = version
        rig.browser.say({"do": "alive"})
        await rig.settle()
        assert rig.client.asked[-1] == asked


async def test_an_arming_that_is_refused_gives_control_back(rig: Rig) -> None:
    rig.client.refuse_arming = True
    rig.browser.say({"do": "arm", "id": 1})
    await rig.settle()
    assert rig.client.asked == ["take_control", "arm", "release_control"]
    assert rig.browser.replies()[1] == (False, "it is too warm")


async def test_a_page_that_goes_away_lets_its_lease_lapse() -> None:
    rig = Rig("command")
    rig.browser.say({"do": "arm", "id": 1})
    await rig.settle()
    await rig.end()
    # Giving it back would leave an armed bench that nobody is missed at.
    assert rig.client.asked == ["take_control", "arm", "close"]


@pytest.mark.parametrize(
    "command",
    [
        {"do": "arm"},
        {"do": "clear", "fault": 1},
        MOVE,
        {"do": "idle"},
        {"do": "tune", "tune": {"mode": "tune", "kp_A_per_mm": 1}},
        {"do": "note", "text": "x"},
        {"do": "record"},
        {"do": "end_record"},
        {"do": "runs"},
        {"do": "begin", "job": {"kind": "diagnose", "run": "a.mcap"}},
        {"do": "begin", "job": {"kind": "experiment", "experiment": "fig9-cycle"}},
        {"do": "end_job"},
    ],
    ids=lambda command: str(command.get("job", command)),
)
async def test_the_link_for_watching_commands_nothing(
    watcher: Rig, command: dict[str, Any]
) -> None:
    watcher.browser.say({**command, "id": 7})
    await watcher.settle()
    done, text = watcher.browser.replies()[7]
    assert not done
    assert "watching" in text
    assert watcher.client.asked == []


async def test_anybody_may_stop_also_by_the_link_for_watching(watcher: Rig) -> None:
    watcher.browser.say({"do": "stop", "id": 7})
    await watcher.settle()
    assert watcher.browser.replies()[7] == (True, "stopped: the board is in COOL")
    assert watcher.client.asked == ["disarm"]


async def test_frames_and_status_name_one_mode_and_the_first_message_what_each_means(
    rig: Rig,
) -> None:
    # The status was asked for before the stop; the samples know of it already.
    rig.axis.shown = bench_state(status("ARMED"))
    rig.axis.mode = int(BoardState.COOL)
    await rig.frames_pass(1)
    rig.source.version += 1
    rig.axis.now = ONES
    rig.axis.feed.add(1000.0, ONES)
    rig.browser.say(SHOW)
    rig.browser.say({"do": "alive"})
    await rig.settle()
    await rig.frames_pass(2)
    assert rig.browser.of("status")[-1]["status"]["mode"] == "COOL"
    assert rig.browser.of("frame")[-1]["mode"] == "COOL"
    names = {*(state.name for state in BoardState), NO_WORD}
    assert rig.browser.of("hello")[0]["modes"].keys() == names


async def test_a_status_that_knows_of_a_lost_link_takes_back_the_state_of_the_last_sample(
    rig: Rig,
) -> None:
    source = rig.source
    source.axis("").mode = int(BoardState.ARMED)
    source.on_status(status("ARMED"))
    assert source.axis("").mode_name == "ARMED"
    source.on_status(status(NO_WORD))
    assert source.axis("").mode_name == NO_WORD
    source.axis("").mode = int(BoardState.SAFE)
    assert source.axis("").mode_name == "SAFE"


async def test_a_motion_begins_at_the_reference_also_where_that_is_zero(rig: Rig) -> None:
    motion = replace(MOTION, reference_mm=0.0, displacement_mm=3.0)
    rig.source.on_status(replace(status(), motion=motion))
    assert rig.source.axis("").reference_mm == 0.0


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{",
        '{"do":"shutdown"}',
        '{"do":"move","trajectory":{"kind":"step","displacement_mm":1e9,"duration_s":1}}',
        '{"do":"note","text":""}',
        '{"do":"show","window":7}',
        '{"do":"begin","job":{"kind":"rm","run":"a"}}',
        '{"do":"stop","extra":1}',
    ],
)
async def test_nonsense_is_refused_and_the_page_goes_on(rig: Rig, text: str) -> None:
    rig.browser.say(text)
    rig.browser.say({**MOVE, "id": 1})
    await rig.settle()
    assert rig.browser.replies()[0][1].startswith("not understood")
    assert rig.browser.replies()[1][0]
    assert rig.client.asked == ["move"]


async def test_who_asks_what_is_not_understood_gets_the_answer(rig: Rig) -> None:
    runs = [f"{n}.mcap" for n in range(7)]
    rig.browser.say({"do": "begin", "id": 4, "job": {"kind": "page", "runs": runs}})
    await rig.settle()
    assert "length <= 6" in rig.browser.replies()[4][1]


async def test_a_browser_that_draws_nothing_gets_no_more_and_then_the_newest(rig: Rig) -> None:
    rig.axis.now = ONES
    rig.browser.say(SHOW)
    await rig.settle()
    for n in range(200):
        rig.axis.feed.add(1000.0 + n * 0.1, (float(n),) * len(strips.PLACES))
        if n % 20 == 0:
            await rig.frames_pass(1)
    await rig.frames_pass(3)
    assert len(rig.browser.of("frame")) == IN_FLIGHT
    rig.browser.say({"do": "drawn"})
    await rig.settle()
    await rig.frames_pass(3)
    frames = rig.browser.of("frame")
    assert len(frames) == IN_FLIGHT + 1
    assert frames[-1]["y"][0][-1] == 199.0


async def test_the_status_goes_out_again_only_when_the_last_was_received(rig: Rig) -> None:
    for version in range(10):
        rig.source.version = version
        await rig.frames_pass(1)
    await rig.frames_pass(2)
    assert len(rig.browser.of("status")) == 1
    rig.browser.say({"do": "alive"})
    await rig.settle()
    await rig.frames_pass(2)
    assert len(rig.browser.of("status")) == 2


async def test_a_page_whose_script_answers_nothing_loses_its_place_and_is_told_why(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pages, "LOOK_EVERY_S", 0.0)
    await rig.frames_pass(2)
    assert len(rig.browser.of("status")) == 1
    rig.now_s = PATIENCE_S - 0.1
    await rig.settle()
    rig.browser.say({"do": "alive"})
    await rig.settle()
    rig.now_s += 1.0
    rig.source.version += 1
    await rig.frames_pass(2)
    assert len(rig.browser.of("status")) == 2
    assert not rig.running.done()
    rig.now_s += PATIENCE_S + 0.1
    async with asyncio.timeout(30.0):
        await rig.running
    assert "did not respond for 10 seconds" in rig.browser.ended


async def test_a_bench_that_fell_silent_is_said_to_be_and_nothing_old_is_drawn_anew(
    rig: Rig,
) -> None:
    rig.axis.now = ONES
    rig.axis.feed.add(1000.0, ONES)
    rig.browser.say(SHOW)
    await rig.frames_pass(2)
    rig.browser.say({"do": "alive"})
    rig.browser.say({"do": "drawn"})
    await rig.settle()
    rig.now_s = SILENT_AFTER_S + 1.0
    before = len(rig.browser.of("frame"))
    await rig.frames_pass(1)
    rig.browser.say({"do": "drawn"})
    await rig.settle()
    await rig.frames_pass(3)
    assert rig.browser.of("status")[-1]["silent_s"] == SILENT_AFTER_S + 1.0
    assert len(rig.browser.of("frame")) <= before + 1
    rig.browser.say({"do": "stop", "id": 5})
    await rig.settle()
    assert rig.browser.replies()[5][0]


async def test_another_window_and_other_channels_are_sent_whole(rig: Rig) -> None:
    rig.axis.now = ONES
    for n in range(100):
        rig.axis.feed.add(1000.0 + n, (float(n),) * len(strips.PLACES))
    await rig.frames_pass(1)
    names = ["force_N", "mode"]
    rig.browser.say({"do": "show", "id": 4, "window": 2, "channels": names, "xy": ["force_N"]})
    await rig.settle()
    await rig.frames_pass(2)
    frames = [frame for frame in rig.browser.of("frame") if frame["view"] == 4]
    assert frames[0]["whole"]
    assert [curve[-1] for curve in frames[0]["y"]] == [99.0, 99.0]
    assert frames[0]["now"] == [1.0, 1.0]
    assert frames[0]["xy"]["y"] == [[float(n) for n in range(39, 100)]]


async def test_a_channel_that_is_not_there_is_refused(rig: Rig) -> None:
    rig.browser.say({"do": "show", "id": 4, "channels": ["t_s"]})
    await rig.settle()
    assert rig.browser.replies()[4] == (False, "there is no channel t_s")


async def test_a_page_that_looks_back_gets_no_frames_and_what_was_then(watcher: Rig) -> None:
    watcher.axis.now = ONES
    for n in range(1000):
        watcher.axis.feed.add(1000.0 + n / 10, (float(n),) * len(strips.PLACES))
    watcher.source.marks.append(Mark(1050.0, "here"))
    show = {"do": "show", "channels": ["force_N"], "xy": ["force_N"], "live": False}
    watcher.browser.say(show)
    watcher.browser.say({"do": "look_back", "id": 3, "from_s": 1040.0, "to_s": 1060.0})
    await watcher.settle()
    await watcher.frames_pass(2)
    assert watcher.browser.of("frame") == []
    (reply,) = (one for one in watcher.browser.of("reply") if one["id"] == 3)
    found = reply["found"]
    assert found["source"] == "memory"
    assert found["marks"] == [{"x": 1050.0, "text": "here"}]
    assert 399.0 <= found["frame"]["y"][0][0] <= 401.0
    assert 600.0 <= found["moments"]["y"][0][-1] <= 602.0


async def test_of_several_spans_only_the_last_is_looked_for(rig: Rig) -> None:
    rig.axis.now = ONES
    rig.axis.feed.add(1000.0, ONES)
    rig.browser.say(SHOW)
    for number in range(1, 30):
        rig.browser.say({"do": "look_back", "id": number, "from_s": 990.0, "to_s": 1010.0})
    await rig.settle()
    done = {number for number, (done, _) in rig.browser.replies().items() if done}
    assert 29 in done
    assert len(done) <= 2
    assert len(rig.browser.replies()) == 29


async def test_a_mark_stands_on_the_strips_of_all_pages(rig: Rig) -> None:
    rig.axis.now = ONES
    rig.axis.feed.add(1000.0, ONES)
    rig.browser.say({"do": "tune", "tune": {"mode": "tune", "kp_A_per_mm": 3.0}})
    await rig.settle()
    assert list(rig.source.marks) == [Mark(1000.0, "kp_A_per_mm 3.0")]


async def test_a_page_looks_at_one_axis_and_its_commands_are_for_that(rig: Rig) -> None:
    rig.source.on_config(Config(axes=(AxisConfig(name="pitch-1"), AxisConfig(name="yaw-1"))))
    yaw = rig.source.axis("yaw-1")
    yaw.now = ONES
    yaw.feed.add(1000.0, ONES)
    await rig.frames_pass(2)
    rig.browser.say({"do": "look_at", "axis": "yaw-1"})
    await rig.frames_pass(2)
    assert [one["axis"] for one in rig.browser.of("hello")][-2:] == ["pitch-1", "yaw-1"]
    rig.browser.say(SHOW)
    await rig.frames_pass(2)
    assert rig.browser.of("frame")[-1]["now"] == [1.0]
    rig.browser.say({**MOVE, "id": 1, "axis": "yaw-1"})
    rig.browser.say({"do": "arm", "id": 2, "axes": ["pitch-1"], "keep_control": False})
    tune = {"mode": "tune", "kp_A_per_mm": 3.0}
    rig.browser.say({"do": "tune", "id": 3, "axis": "pitch-1", "tune": tune})
    await rig.settle()
    assert rig.client.axes == ["yaw-1", "pitch-1", "pitch-1"]
    assert list(rig.source.marks) == [Mark(1000.0, "pitch-1: kp_A_per_mm 3.0")]


async def test_a_silent_axis_leaves_the_others_in_sight(rig: Rig) -> None:
    rig.source.on_config(Config(axes=(AxisConfig(name="pitch-1"), AxisConfig(name="yaw-1"))))
    rig.now_s = 2 * SILENT_AFTER_S
    pitch = rig.source.axis("pitch-1")
    pitch.now, pitch.mode = ONES, int(BoardState.ARMED)
    pitch.heard()
    told = pages.status_message(rig.source, rig.source.axis("yaw-1"), ours=False)
    assert told["silent_s"] > 0
    one, other = told["tiles"]
    assert (one.mode, one.displacement_mm) == ("ARMED", 1.0)
    assert (other.mode, other.displacement_mm) == ("", None)


async def test_a_stop_ends_a_job_on_the_bench_and_no_other(rig: Rig) -> None:
    asked: list[bool] = []

    def interrupt(*, on_the_bench: bool = False) -> bool:
        asked.append(on_the_bench)
        return False

    rig.queries.jobs.interrupt = interrupt  # type: ignore[method-assign]
    rig.browser.say({"do": "stop", "id": 1})
    await rig.settle()
    assert asked == [True]
    assert rig.client.asked == ["disarm"]


async def test_a_job_is_not_begun_after_a_stop_that_the_page_had_not_shown(rig: Rig) -> None:
    rig.axis.shown = bench_state(status("SAFE"))
    rig.source.folder = "/nowhere"
    job = {"kind": "page", "runs": ["a.mcap"]}
    rig.browser.say({"do": "begin", "id": 1, "generation": 2, "job": job})
    await rig.settle()
    done, text = rig.browser.replies()[1]
    assert not done
    assert "stopped" in text
    assert rig.queries.jobs.snapshot() is None
