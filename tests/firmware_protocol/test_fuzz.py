"""Whatever arrives at either end: no exception, every frame counted, no action out of nothing."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_protocol import events as e
from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC
from firmware_protocol.framing import encode_frame
from firmware_protocol.generate.vectors import random_message
from firmware_protocol.schema import own_crc
from tests.firmware_protocol.pair import Pair, TestBoard

quiet = settings(derandomize=True, deadline=None, max_examples=120)

numbers = st.one_of(st.sampled_from([cls.info.number for cls in m.MESSAGES]), st.integers(0, 255))
headers = st.tuples(st.integers(0, 255), st.sampled_from([0, 1, 2, 5000, 65535]))


@st.composite
def frames(draw: st.DrawFn, session: int) -> bytes:
    """A frame that is good as a frame: random payload, or a real message with random values."""
    seq = draw(st.integers(0, 255))
    number = draw(st.sampled_from([session, session, 0, 1, 65535]))
    if draw(st.booleans()):
        return encode_frame(draw(numbers), seq, number, draw(st.binary(max_size=120)))
    cls = draw(st.sampled_from(m.MESSAGES))
    return CODEC.frame(random_message(cls, draw(st.randoms(use_true_random=False))), seq, number)


def streams(session: int) -> st.SearchStrategy[list[bytes]]:
    return st.lists(st.one_of(st.binary(max_size=200), frames(session)), max_size=12)


@quiet
@given(st.data())
def test_a_host_takes_any_bytes_and_every_frame_is_counted_once(data: st.DataObject) -> None:
    pair = Pair().connect()
    host = pair.host
    for chunk in data.draw(streams(host.session)):
        pair.now_us += data.draw(st.integers(0, 200_000))
        events = host.receive(chunk, pair.now_us)
        assert all(isinstance(event, e.HostEvent) for event in events)
        host.tick(pair.now_us)
        host.data_to_send()
    states = [event for event in pair.events if isinstance(event, e.StateReceived)]
    assert host.stats.states >= len(states)
    host.connect(pair.now_us)
    assert host.state is e.HostState.SYNC


@quiet
@given(st.data())
def test_a_board_takes_any_bytes_and_acts_on_each_request_number_once(
    data: st.DataObject,
) -> None:
    board = TestBoard()
    board.take(CODEC.frame(m.Hello(m.PROTOCOL_MAJOR, 0, own_crc(), 9), 0, 0))
    session = board.session.session
    stats = board.session.stats
    before = stats.decoder.frames
    for chunk in data.draw(streams(session)):
        board.t_us += data.draw(st.integers(0, 100_000))
        board.take(chunk)
        assert len(board.session.data_to_send()) <= 8193
    assert all(isinstance(event, e.BoardEvent) for event in board.events)
    refused = stats.payload_errors + stats.echoes + stats.session_errors + stats.stale_setpoints
    assert refused + stats.repeated_requests + stats.busy_requests <= stats.decoder.frames - before
    assert max(board.actions.values(), default=0) <= 1


@quiet
@given(st.binary(max_size=400))
def test_a_host_that_is_not_connected_ignores_everything(data: bytes) -> None:
    pair = Pair()
    assert pair.host.receive(data, 0) == []
    assert pair.host.tick(10**9) == []
    assert pair.host.data_to_send() == b""


@pytest.mark.parametrize("seed", range(24))
def test_on_any_bad_line_at_most_one_action_for_each_request_and_recovery_after_it(
    seed: int,
) -> None:
    pair = Pair(seed)
    damage = pair.rng.uniform(0, 0.01)
    twice, swap = pair.rng.uniform(0, 0.4), pair.rng.uniform(0, 0.3)
    for line in (pair.up, pair.down):
        line.flip = line.drop = line.insert = damage
        line.twice, line.swap = twice, swap
    pair.connect()
    for _ in range(6):
        if pair.host.state is e.HostState.MONITOR:
            pair.host.request(m.ParamSave(), pair.now_us)
            pair.host.request(m.Disarm(0), pair.now_us)
        pair.run(25)
    assert max(pair.board.actions.values(), default=0) <= 1
    done = [event.id for event in pair.told(e.RequestDone)]
    assert len(set(done)) == len(done)
    for line in (pair.up, pair.down):
        line.flip = line.drop = line.insert = line.twice = line.swap = 0.0
    pair.run(300)
    assert pair.host.state is e.HostState.MONITOR
    assert isinstance(pair.ask(m.ParamSave()), e.RequestDone)
