"""One direction of the line: healthy it changes nothing, broken it does what the row says."""

import random

import pytest

from firmware_protocol.framing import FrameDecoder, encode_frame
from sim_device.line import Line

FRAMES = [encode_frame(0x90, n, 7, bytes([n] * 20)) for n in range(60)]
DATA = b"".join(FRAMES)


def line(**fields: object) -> Line:
    made = Line(random.Random(3))
    if fields:
        made.spoil(**fields)
    return made


def good_frames(data: bytes) -> list[int]:
    return [frame.seq for frame in FrameDecoder().feed(data)]


def test_a_healthy_line_passes_the_very_bytes() -> None:
    assert line().carry(DATA, 0) is DATA


def test_a_spoilt_line_with_nothing_wrong_passes_all() -> None:
    assert line(flip=0.0).carry(DATA, 0) == DATA


@pytest.mark.parametrize("what", ["flip", "burst", "drop", "insert"])
def test_damage_costs_some_frames_and_invents_none(what: str) -> None:
    seen = good_frames(line(**{what: 2e-3}).carry(DATA, 0))
    assert 0 < len(seen) < len(FRAMES)
    assert set(seen) < set(range(60))


def test_a_garbled_line_lets_no_frame_through() -> None:
    assert good_frames(line(garbled=True).carry(DATA, 0)) == []


def test_a_lost_line_is_silent_and_forgets() -> None:
    broken = line(lost=True)
    assert broken.carry(DATA, 0) == b""
    broken.spoil(lost=False)
    assert broken.carry(b"\0", 10) == b"\0"


def test_a_stalled_line_gives_all_at_once_afterwards() -> None:
    stalled = line(stalled=True)
    assert stalled.carry(DATA[:50], 0) == b""
    assert stalled.carry(DATA[50:], 1) == b""
    stalled.spoil(stalled=False)
    assert stalled.carry(b"", 2) == DATA


def test_a_late_line_gives_each_piece_when_its_time_has_come() -> None:
    late = line(delay_us=100)
    assert late.carry(b"a", 0) == b""
    assert late.carry(b"b", 60) == b""
    assert late.carry(b"", 100) == b"a"
    assert late.carry(b"", 160) == b"b"


def test_a_split_line_gives_pieces_and_loses_nothing() -> None:
    split = line(split=7)
    out = [split.carry(DATA[:30], 0)]
    out += [split.carry(b"", n) for n in range(5)]
    assert [len(piece) for piece in out] == [7, 7, 7, 7, 2, 0]
    assert b"".join(out) == DATA[:30]


def test_frames_may_come_twice_or_change_places() -> None:
    twice = good_frames(line(duplicate=0.5).carry(DATA, 0))
    assert sorted(set(twice)) == list(range(60))
    assert len(twice) > 70
    swapped = good_frames(line(swap=0.5).carry(DATA, 0))
    assert sorted(swapped) == list(range(60))
    assert swapped != list(range(60))
