"""Which events a pair of looks is."""

import msgspec
import pytest

from smad.api import (
    Control,
    Counts,
    Fault,
    LinkStatus,
    Motion,
    Percentiles,
    RecorderStatus,
    Status,
    Timing,
)
from smad.config import HooksConfig
from smad.hooks.events import MOST_AT_ONCE, SILENT_S, Detector, Event, Observation
from smad.hooks.watch import HOOKS
from smad.queue.states import Arming, Item, Snapshot, State
from smad.queue.store import Message

LINK = LinkStatus(
    port="/dev/ttyUSB0",
    baud=1,
    rate_hz=100,
    state="running",
    notes=(),
    bytes_in=0,
    bytes_out=0,
    short_writes=0,
    losses=0,
    frames={},
    board_stats={},
)
COUNTS = Counts(
    samples=0,
    missed=0,
    skipped=0,
    setpoints=0,
    setpoints_dropped=0,
    setpoints_refused=0,
    commands=0,
    refused=0,
    telemetry_dropped=0,
)
NONE = Percentiles()
TIMING = Timing(own_share=NONE, setpoint_age=NONE, jitter=NONE, round_trip_us=None, collections=0)
ARMED = Motion(
    running="displacement",
    done=False,
    armed=True,
    mode="ARMED",
    reference_mm=None,
    displacement_mm=None,
    board_time_s=1.0,
    generation=3,
)
STATUS = Status(
    bench="bench",
    version="0",
    pid=1,
    uptime_s=1.0,
    memory_MiB=1.0,
    realtime=(),
    link=LINK,
    board=None,
    motion=ARMED,
    limiter="",
    faults=(),
    warnings=(),
    sample=None,
    counts=COUNTS,
    timing=TIMING,
    recorder=RecorderStatus(recording=False),
    control=Control(holder="smad run"),
    events=(),
)
FAULT = Fault(number=6, name="OVER_TEMPERATURE")


def motion(**changes: object) -> Status:
    return msgspec.structs.replace(STATUS, motion=msgspec.structs.replace(ARMED, **changes))


def look(at_s: float, status: Status | None = STATUS, **more: object) -> Observation:
    return Observation(unix_s=1e9 + at_s, clock_s=at_s, status=status, **more)  # type: ignore[arg-type]


def told(*looks: Observation) -> list[tuple[str, str]]:
    detector = Detector("bench", HooksConfig())
    return [(e.event, e.text) for each in looks for e in detector.events(each)]


def test_a_bench_that_runs_is_no_news() -> None:
    assert told(look(0), look(1), look(2)) == []


def test_a_fault_is_told_once() -> None:
    faulted = motion(
        armed=False, mode="FAULT", generation=4, ended="stopped by a fault", fault=FAULT
    )
    assert told(look(0), look(1, faulted), look(2, faulted)) == [("on_fault", "OVER_TEMPERATURE")]


def test_a_stop_by_another_client_is_told_and_a_programs_own_disarm_is_not() -> None:
    other = motion(armed=False, generation=4, ended="stopped by disarm of a client")
    assert told(look(0), look(1, other), look(2, other)) == [
        ("on_stop", "stopped by disarm of a client")
    ]
    program = motion(armed=False, generation=4, ended="stopped by disarm of smad run")
    assert told(look(0), look(1, program)) == []


def test_a_daemon_that_is_silent_is_told_after_its_time_and_only_once() -> None:
    silent = [look(0.1 * n, None) for n in range(1, 40)]
    assert [event for event, _ in told(look(0), *silent)] == ["on_link_lost"]
    detector = Detector("bench", HooksConfig())
    detector.events(look(0))
    assert detector.events(look(SILENT_S - 0.1, None)) == []
    assert len(detector.events(look(SILENT_S, None))) == 1


def test_a_board_that_went_away_is_told_and_again_after_it_was_back() -> None:
    away = msgspec.structs.replace(STATUS, link=msgspec.structs.replace(LINK, state="disconnected"))
    assert [e for e, _ in told(look(0), look(1, away), look(2, away), look(3), look(4, away))] == [
        "on_link_lost",
        "on_link_lost",
    ]


def message(number: int) -> Message:
    text = f"item {number} (x) done"
    return Message(id=number, unix_s=1.0, event="item_ended", text=text, item=number)


def test_every_event_has_its_key_in_the_configuration() -> None:
    keys = HooksConfig.__struct_fields__
    assert {key for key in keys if key.startswith("on_")} == set(HOOKS)


def test_every_message_of_the_queue_is_told() -> None:
    (event,) = Detector("bench", HooksConfig(disk_low_MB=0.0)).events(
        look(0, messages=(message(1),))
    )
    assert (event.event, event.text, event.unix_s) == ("on_queue_end", "item 1 (x) done", 1.0)


def test_many_messages_at_once_are_one_word_that_holds_them_all() -> None:
    messages = tuple(map(message, range(1, MOST_AT_ONCE + 2)))
    (event,) = Detector("bench", HooksConfig(disk_low_MB=0.0)).events(look(0, messages=messages))
    assert event.text == "6 messages, the last: item 6 (x) done"
    assert event.data["messages"] == [each.text for each in messages]


FAULTED = motion(armed=False, mode="FAULT", generation=4, ended="stopped by a fault", fault=FAULT)


@pytest.mark.parametrize(
    ("after", "expected"),
    [
        (STATUS, []),
        (
            motion(armed=False, generation=4, ended="stopped by loss of the link"),
            ["stopped by loss of the link"],
        ),
        (motion(armed=False, generation=9, ended="stopped by disarm of smad tune"), []),
        (FAULTED, ["OVER_TEMPERATURE"]),
    ],
)
def test_a_watcher_that_was_away_tells_what_happened_meanwhile_and_the_next_one_not_again(
    after: Status, expected: list[str]
) -> None:
    first = Detector("bench", HooksConfig(disk_low_MB=0.0))
    first.events(look(0))
    second = Detector("bench", HooksConfig(disk_low_MB=0.0), known=first.known)
    assert [event.text for event in second.events(look(100, after))] == expected
    third = Detector("bench", HooksConfig(disk_low_MB=0.0), known=second.known)
    assert third.events(look(200, after)) == []


@pytest.mark.parametrize("has_runner", [True, False])
def test_a_runner_that_died_is_told_with_the_item_that_it_left(has_runner: bool) -> None:
    item = Item(id=4, position=1.0, kind="run", title="run x", words=(), state=State.RUNNING)
    arming = Arming(items=(4,), end_unix_s=1.0, longest_s=1.0)
    left = Snapshot(items=(item,), mode="running", arming=arming)
    looks = [look(n, snapshot=left, has_runner=has_runner) for n in range(3)]
    words = "the runner of the queue has ended while item 4 (run x) ran"
    assert told(*looks) == ([] if has_runner else [("on_queue_end", words)])


def test_a_low_disk_is_told_once_and_again_only_after_there_was_room() -> None:
    free = (3000.0, 1900.0, 1800.0, 2100.0, 1900.0, 2500.0, 1000.0)
    events = told(*(look(n, free_MB=megabytes) for n, megabytes in enumerate(free)))
    assert [text for _, text in events] == [
        "1900 MB left for run logs, less than 2000 MB",
        "1000 MB left for run logs, less than 2000 MB",
    ]


def test_an_event_is_json_that_anything_can_read() -> None:
    event = Event(event="on_stop", bench="b", unix_s=1.0, text="t", data={"item": 3})
    assert msgspec.json.decode(msgspec.json.encode(event)) == {
        "event": "on_stop", "bench": "b", "unix_s": 1.0, "text": "t", "data": {"item": 3},
    }  # fmt: skip
