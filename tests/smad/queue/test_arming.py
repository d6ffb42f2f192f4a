"""Arming in two steps, and end times on days on which clocks change."""

from datetime import datetime
from typing import Any
from zoneinfo import ZoneInfo

import pytest

from smad.config import Config, TelemetryConfig
from smad.queue import arming
from smad.queue import budget as metering
from smad.queue.errors import ArmingError
from smad.queue.states import Budget, Item, Snapshot, State
from smad.queue.store import Proposal
from smad.queue.words import state_in_words

BERLIN = ZoneInfo("Europe/Berlin")
QUEUE = Snapshot(
    items=tuple(
        Item(id=n, position=float(n), kind="run", title="t", words=("run",)) for n in (1, 2)
    )
)


def proposal(generation: int | None = 7) -> Proposal:
    return arming.propose(
        QUEUE,
        code="WXYZ",
        now_unix_s=100.0,
        end_unix_s=3700.0,
        budget=Budget(),
        generation=generation,
    )


def confirmed(
    code: str = "WXYZ", now_unix_s: float = 110.0, queue: Snapshot = QUEUE, generation: int = 7
) -> Snapshot:
    return arming.confirm(
        queue, proposal(), code, now_unix_s=now_unix_s, generation=generation
    ).after


@pytest.mark.parametrize("budget", [Budget(energy_J=1e3), Budget(cycles=10.0)])
@pytest.mark.parametrize("telemetry", [{"enabled": False}, {"every_nth_sample": 101}])
def test_a_budget_that_nothing_would_end_is_refused(
    monkeypatch: pytest.MonkeyPatch, budget: Budget, telemetry: dict[str, Any]
) -> None:
    config = Config(telemetry=TelemetryConfig(**telemetry))
    monkeypatch.setattr(metering, "configuration", lambda _: config)
    with pytest.raises(ArmingError, match="cannot be metered"):
        metering.require_metered(budget, "bench")
    metering.require_metered(Budget(hours=1.0), "bench")
    monkeypatch.setattr(metering, "configuration", lambda _: Config())
    metering.require_metered(budget, "bench")


def test_the_second_step_arms_exactly_what_the_first_showed() -> None:
    after = confirmed(code=" wxyz ")
    assert after.mode == "running"
    assert after.arming is not None
    assert after.arming.items == (1, 2)
    assert after.arming.longest_s == 3600.0


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"code": "AAAA"}, "not the code"),
        ({"now_unix_s": 300.0}, "too old"),
        ({"now_unix_s": 50.0}, "too old"),
        ({"queue": Snapshot(items=QUEUE.items[:1])}, "has changed"),
        ({"generation": 8}, "was stopped"),
    ],
)
def test_a_confirmation_of_anything_else_is_refused(changed: dict[str, object], words: str) -> None:
    with pytest.raises(ArmingError, match=words):
        confirmed(**changed)  # type: ignore[arg-type]


def test_without_a_first_step_there_is_no_second() -> None:
    with pytest.raises(ArmingError, match="not the code"):
        arming.confirm(QUEUE, None, "WXYZ", now_unix_s=1.0, generation=None)


def test_an_empty_queue_and_a_budget_of_nothing_are_not_armed() -> None:
    with pytest.raises(ArmingError, match="empty"):
        arming.propose(
            Snapshot(), code="A", now_unix_s=0.0, end_unix_s=1.0, budget=Budget(), generation=None
        )
    with pytest.raises(ArmingError, match="energy_J is not positive"):
        arming.propose(
            QUEUE,
            code="A",
            now_unix_s=0.0,
            end_unix_s=1.0,
            budget=Budget(energy_J=0.0),
            generation=None,
        )


def hours_until(text: str, now: datetime) -> float:
    return (arming.end_time(text, now).timestamp() - now.timestamp()) / 3600.0


def test_an_end_time_is_the_next_such_time() -> None:
    evening = datetime(2026, 11, 25, 22, 0, tzinfo=BERLIN)
    assert hours_until("07:00", evening) == 9.0
    assert hours_until("22:30", evening) == 0.5
    assert hours_until("2026-11-26T07:00", evening) == 9.0


def test_the_night_of_the_end_of_summer_time_is_an_hour_longer_and_of_its_beginning_shorter() -> (
    None
):
    assert hours_until("07:00", datetime(2026, 10, 24, 22, 0, tzinfo=BERLIN)) == 10.0
    assert hours_until("07:00", datetime(2026, 3, 28, 22, 0, tzinfo=BERLIN)) == 8.0


def test_a_time_that_comes_twice_is_the_first_and_a_skipped_one_the_next_that_exists() -> None:
    assert hours_until("02:30", datetime(2026, 10, 25, 0, 30, tzinfo=BERLIN)) == 2.0
    assert arming.end_time("02:30", datetime(2026, 3, 29, 0, 30, tzinfo=BERLIN)).hour == 3


@pytest.mark.parametrize("text", ["25:00", "soon", "", "2026-11-24T07:00", "2027-11-24T07:00"])
def test_an_end_time_that_is_none_or_not_ahead_is_refused(text: str) -> None:
    with pytest.raises(ArmingError, match="nothing was armed"):
        arming.end_time(text, datetime(2026, 11, 25, 22, 0, tzinfo=BERLIN))


def test_states_that_are_not_queued_are_not_armed() -> None:
    ended = Item(id=3, position=3.0, kind="run", title="t", words=(), state=State.DONE)
    assert arming.propose(
        Snapshot(items=(*QUEUE.items, ended)),
        code="A",
        now_unix_s=0.0,
        end_unix_s=1.0,
        budget=Budget(),
        generation=None,
    ).arming.items == (1, 2)


def test_a_paused_queue_says_why_and_how_it_is_armed() -> None:
    said = state_in_words(Snapshot(), runner=True)
    assert said == "paused: nobody has armed it yet; smad queue resume arms it"
