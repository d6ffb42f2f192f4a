"""From samples to frames, on virtual time."""

import random

from smad.view.feed import FRAMES_PER_S, MOST_BUCKETS, WINDOWS, Cursor, Feed, Frame, Tier

EPOCH_S = 1_700_000_000.0


def drawn(frame: Frame, channel: int = 0) -> list[float]:
    return [value for value in frame.y[channel] if value is not None]


def test_a_spike_of_one_sample_is_drawn_in_every_window() -> None:
    feed = Feed(1)
    for n in range(500 * 60):
        feed.add(EPOCH_S + n / 500, (9.0 if n == 12_345 + 500 * 30 else 1.0,))
    for window in range(len(WINDOWS)):
        frame, whole = Cursor(feed, window).take() or (None, False)
        assert whole
        assert frame is not None
        assert max(drawn(frame)) == 9.0


def test_the_extremes_of_a_bucket_are_drawn_in_the_order_in_which_they_came() -> None:
    tier = Tier(1.0, 1)
    for n, value in enumerate((2.0, 5.0, 1.0, 3.0)):
        tier.add(10 + n / 10, (value,))
    for n, value in enumerate((2.0, 1.0, 5.0, 3.0)):
        tier.add(11 + n / 10, (value,))
    frame, _ = tier.since(None) or (None, 0)
    assert frame is not None
    assert frame.y[0] == [5.0, 1.0, 1.0, 5.0]
    assert frame.t == sorted(frame.t)


def test_frames_laid_over_one_another_give_what_one_whole_frame_gives() -> None:
    draw = random.Random(3)
    feed = Feed(2)
    cursor = Cursor(feed)
    t: list[float] = []
    y: list[list[float | None]] = [[], []]
    now_s = EPOCH_S
    for _ in range(2000):
        for _ in range(draw.randrange(40)):
            now_s += 0.002
            feed.add(now_s, (draw.random(), None if draw.random() < 0.3 else draw.random()))
        if draw.random() < 0.02:
            now_s += 5.0
        taken = cursor.take()
        if taken is None:
            continue
        frame, whole = taken
        keep = 0 if whole else sum(1 for time in t if time < frame.from_s)
        t = t[:keep] + frame.t
        y = [curve[:keep] + new for curve, new in zip(y, frame.y, strict=True)]
    frame, _ = Cursor(feed).take() or (None, False)
    assert frame is not None
    shown = len(frame.t)
    assert t[-shown:] == frame.t
    assert [curve[-shown:] for curve in y] == frame.y


def test_a_pause_breaks_the_line() -> None:
    tier = Tier(1 / 30, 1)
    tier.add(10.0, (1.0,))
    tier.add(15.0, (2.0,))
    frame, _ = tier.since(None) or (None, 0)
    assert frame is not None
    assert frame.y[0] == [1.0, 1.0, None, 2.0, 2.0]


def test_samples_ten_times_a_second_are_one_line() -> None:
    tier = Tier(1 / 30, 1)
    for n in range(50):
        tier.add(10.0 + n / 10, (1.0,))
    frame, _ = tier.since(None) or (None, 0)
    assert frame is not None
    assert None not in frame.y[0]


def test_a_day_takes_no_more_memory_than_an_hour() -> None:
    feed = Feed(1)
    for n in range(24 * 3600 * 2):
        feed.add(EPOCH_S + n / 2, (1.0,))
    assert [len(tier) for tier in feed.tiers] == [MOST_BUCKETS] * len(WINDOWS)
    for window in range(len(WINDOWS)):
        frame, _ = Cursor(feed, window).take() or (None, False)
        assert frame is not None
        assert len(frame.t) <= 3 * MOST_BUCKETS


def test_a_page_that_was_away_gets_the_newest_in_one_frame_and_then_little() -> None:
    feed = Feed(1)
    cursor = Cursor(feed)
    for n in range(500 * 600):
        feed.add(EPOCH_S + n / 500, (float(n),))
        if n == 10:
            cursor.take()
    frame, _ = cursor.take() or (None, False)
    assert frame is not None
    assert len(frame.t) <= 2 * MOST_BUCKETS
    assert drawn(frame)[-1] == 500 * 600 - 1
    feed.add(EPOCH_S + 600 + 1 / FRAMES_PER_S, (0.0,))
    frame, whole = cursor.take() or (None, True)
    assert frame is not None
    assert not whole
    assert len(frame.t) <= 4


def test_a_clock_that_went_back_begins_anew_and_one_that_was_steered_does_not() -> None:
    feed = Feed(1)
    cursor = Cursor(feed)
    feed.add(EPOCH_S, (1.0,))
    cursor.take()
    feed.add(EPOCH_S - 0.01, (2.0,))
    _, whole = cursor.take() or (None, True)
    assert not whole
    feed.add(EPOCH_S - 3600.0, (3.0,))
    frame, whole = cursor.take() or (None, False)
    assert whole
    assert frame is not None
    assert drawn(frame) == [3.0, 3.0]


def test_a_value_that_is_not_a_number_is_not_drawn() -> None:
    tier = Tier(1.0, 2)
    tier.add(10.0, (float("nan"), None))
    tier.add(10.1, (1.0, float("inf")))
    frame, _ = tier.since(None) or (None, 0)
    assert frame is not None
    assert frame.y == [[1.0, 1.0], [None, None]]
