"""The host's request queue and its mirror of the board, alone."""

import pytest

from firmware_protocol import events as e
from firmware_protocol import messages as m
from firmware_protocol.enums import BoardState
from firmware_protocol.events import HostState
from firmware_protocol.framing import DecoderStats
from firmware_protocol.mirror import Mirror
from firmware_protocol.requests import (
    FIRST_RTO_US,
    LEAST_RTO_US,
    MOST_RTO_US,
    TRIES,
    RequestQueue,
    RoundTrip,
)
from firmware_protocol.stats import HostLinkStats
from tests.firmware_protocol.pair import Pair

DONE = m.Done(m.Disarm.info.number, 0)


def queue() -> tuple[RequestQueue, list[int]]:
    sent: list[int] = []
    stats = HostLinkStats(DecoderStats())
    return RequestQueue(lambda message, seq: sent.append(seq), stats), sent


def test_the_wait_for_an_answer_follows_the_round_trips_within_its_bounds() -> None:
    trip = RoundTrip()
    assert trip.rto_us == FIRST_RTO_US
    trip.sample(40_000)
    assert trip.rto_us == 40_000 + 4 * 20_000
    for _ in range(100):
        trip.sample(2_000)
    assert trip.rto_us == LEAST_RTO_US == 25_000
    for _ in range(100):
        trip.sample(10_000_000)
    assert trip.rto_us == MOST_RTO_US


def test_each_try_waits_twice_as_long_as_the_one_before() -> None:
    requests, sent = queue()
    requests.add(m.Disarm(0), 0)
    waits = []
    now_us = 0
    for _ in range(TRIES):
        deadline_us = requests.deadline_us
        assert deadline_us is not None
        waits.append(deadline_us - now_us)
        assert requests.tick(deadline_us - 1) is None
        now_us = deadline_us
        given_up = requests.tick(now_us)
    assert waits == [FIRST_RTO_US, 2 * FIRST_RTO_US, 4 * FIRST_RTO_US]
    assert given_up is not None
    assert given_up.message == m.Disarm(0)
    assert sent == [1, 1, 1]
    assert requests.deadline_us is None


def test_an_answer_after_a_repeat_is_not_taken_as_a_round_trip() -> None:
    requests, _ = queue()
    requests.add(m.Disarm(0), 0)
    requests.tick(FIRST_RTO_US)
    assert requests.answered(DONE, 1, FIRST_RTO_US + 10) is not None
    assert requests.round_trip.srtt_us is None
    requests.add(m.Disarm(0), 0)
    assert requests.answered(DONE, 2, 3_000) is not None
    assert requests.round_trip.srtt_us == 3_000


@pytest.mark.parametrize(("reply", "seq"), [(DONE, 2), (DONE, 0), (m.ArmToken(0, 1, 2), 1)])
def test_an_answer_of_another_number_or_kind_answers_nothing(reply: m.Message, seq: int) -> None:
    requests, _ = queue()
    requests.add(m.Disarm(0), 0)
    assert requests.answered(reply, seq, 10) is None


def test_request_numbers_begin_anew_with_each_session_so_that_the_board_takes_them() -> None:
    pair = Pair().connect()
    for _ in range(200):
        pair.host.request(m.ParamSave(), pair.now_us)
    pair.run(100)
    pair.events += pair.host.connect(pair.now_us)
    pair.run(10)
    assert isinstance(pair.ask(m.ParamSave()), e.RequestDone)


def test_a_sample_from_before_the_arming_does_not_undo_it() -> None:
    mirror = Mirror()
    mirror.sample(0, BoardState.SAFE, 800)
    mirror.confirmed(0, 1000)
    mirror.sample(0, BoardState.SAFE, 900)
    assert mirror.state is HostState.RUNNING
    mirror.sample(0, BoardState.SAFE, 1100)
    assert mirror.state is HostState.MONITOR


def test_a_sample_from_before_the_fault_does_not_hide_it() -> None:
    mirror = Mirror()
    mirror.confirmed(0, 1000)
    mirror.stopped(0, 2000)
    mirror.sample(0, BoardState.ARMED, 1990)
    assert mirror.state is HostState.FAULTED
    mirror.sample(0, BoardState.SAFE, 9000)
    assert mirror.state is HostState.MONITOR


def test_hold_is_running_and_cooling_is_not() -> None:
    mirror = Mirror()
    mirror.confirmed(0, 1000)
    mirror.sample(0, BoardState.HOLD, 2000)
    assert mirror.state is HostState.RUNNING
    mirror.sample(0, BoardState.ARMED, 3000)
    assert mirror.state is HostState.RUNNING
    mirror.sample(0, BoardState.COOL, 4000)
    assert mirror.state is HostState.MONITOR
    mirror.sample(0, BoardState.ARMED, 5000)
    assert mirror.state is HostState.MONITOR
