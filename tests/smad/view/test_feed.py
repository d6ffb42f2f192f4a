"""From samples to frames, on virtual time."""

import math
import random
import tracemalloc

import pytest

from smad.runlog.cycles import Cycles
from smad.view.feed import FRAMES_PER_S, WINDOWS, Cursor, Feed, View
from smad.view.tier import MOST_BUCKETS, Frame, Moments, Tier

EPOCH_S = 1_700_000_000.0


def taken_by(cursor: Cursor) -> tuple[Frame, Moments | None, bool]:
    found = cursor.take()
    assert found is not None
    return found


def whole_of(feed: Feed, window: int = 0, channels: tuple[int, ...] = (0,)) -> Frame:
    frame, _, whole = taken_by(Cursor(feed, View(window=window, channels=channels)))
    assert whole
    return frame


def frame_of(tier: Tier, channels: tuple[int, ...] = (0,)) -> Frame:
    found = tier.since(None, channels)
    assert found is not None
    return found[0]


def drawn(frame: Frame, channel: int = 0) -> list[float]:
    return [value for value in frame.y[channel] if value is not None]


def test_a_spike_of_one_sample_is_drawn_in_every_window() -> None:
    feed = Feed(1)
    for n in range(500 * 60):
        feed.add(EPOCH_S + n / 500, (9.0 if n == 12_345 + 500 * 30 else 1.0,))
    for window in range(len(WINDOWS)):
        assert max(drawn(whole_of(feed, window))) == 9.0


def test_the_extremes_of_a_bucket_are_drawn_in_the_order_in_which_they_came() -> None:
    tier = Tier(1.0, 1)
    for n, value in enumerate((2.0, 5.0, 1.0, 3.0)):
        tier.add(10 + n / 10, (value,))
    for n, value in enumerate((2.0, 1.0, 5.0, 3.0)):
        tier.add(11 + n / 10, (value,))
    frame = frame_of(tier)
    assert frame.y[0] == [5.0, 1.0, 1.0, 5.0]
    assert frame.t == sorted(frame.t)


@pytest.mark.parametrize(("window", "pause_s"), [(0, 5.0), (2, 2.0)])
def test_frames_laid_over_one_another_give_what_one_whole_frame_gives(
    window: int, pause_s: float
) -> None:
    draw = random.Random(3)
    feed = Feed(2)
    cursor = Cursor(feed, View(window=window, channels=(0, 1)))
    t: list[float] = []
    y: list[list[float | None]] = [[], []]
    now_s = EPOCH_S
    for _ in range(2000):
        for _ in range(draw.randrange(40)):
            now_s += 0.002
            feed.add(now_s, (draw.random(), None if draw.random() < 0.3 else draw.random()))
        if draw.random() < 0.02:
            now_s += pause_s
        taken = cursor.take()
        if taken is None:
            continue
        frame, _, whole = taken
        keep = 0 if whole else sum(1 for time in t if time < frame.from_s)
        t = t[:keep] + frame.t
        y = [curve[:keep] + new for curve, new in zip(y, frame.y, strict=True)]
    frame = whole_of(feed, window, channels=(0, 1))
    shown = len(frame.t)
    assert t[-shown:] == frame.t
    assert [curve[-shown:] for curve in y] == frame.y


def test_a_pause_breaks_the_line() -> None:
    tier = Tier(1 / 30, 1)
    tier.add(10.0, (1.0,))
    tier.add(15.0, (2.0,))
    frame = frame_of(tier)
    assert frame.y[0] == [1.0, 1.0, None, 2.0, 2.0]


def test_samples_ten_times_a_second_are_one_line() -> None:
    tier = Tier(1 / 30, 1)
    for n in range(50):
        tier.add(10.0 + n / 10, (1.0,))
    frame = frame_of(tier)
    assert None not in frame.y[0]


def test_after_a_day_nothing_grows_any_more() -> None:
    feed = Feed(1)
    step_s = 1.4
    for n in range(int(26 * 3600 / step_s)):
        if n == int(25 * 3600 / step_s):
            tracemalloc.start()
        feed.add(EPOCH_S + n * step_s, (1.0,))
    grown = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert grown < 10_000
    assert [len(tier) for tier in feed.tiers] == [window.capacity for window in WINDOWS]
    for window in range(len(WINDOWS)):
        assert len(whole_of(feed, window).t) <= 3 * MOST_BUCKETS


def test_a_page_that_was_away_gets_the_newest_in_one_frame_and_then_little() -> None:
    feed = Feed(1)
    cursor = Cursor(feed, View(channels=(0,)))
    for n in range(500 * 600):
        feed.add(EPOCH_S + n / 500, (float(n),))
        if n == 10:
            cursor.take()
    frame, _, _ = taken_by(cursor)
    assert len(frame.t) <= 2 * MOST_BUCKETS
    assert drawn(frame)[-1] == 500 * 600 - 1
    feed.add(EPOCH_S + 600 + 1 / FRAMES_PER_S, (0.0,))
    frame, _, whole = taken_by(cursor)
    assert not whole
    assert len(frame.t) <= 4


def test_a_clock_that_went_back_begins_anew_and_one_that_was_steered_does_not() -> None:
    feed = Feed(1)
    cursor = Cursor(feed, View(channels=(0,)))
    feed.add(EPOCH_S, (1.0,))
    cursor.take()
    feed.add(EPOCH_S - 0.01, (2.0,))
    _, _, whole = taken_by(cursor)
    assert not whole
    feed.add(EPOCH_S - 3600.0, (3.0,))
    frame, _, whole = taken_by(cursor)
    assert whole
    assert drawn(frame) == [3.0, 3.0]


def test_a_value_that_is_not_a_number_is_not_drawn() -> None:
    tier = Tier(1.0, 2)
    tier.add(10.0, (float("nan"), None))
    tier.add(10.1, (1.0, float("inf")))
    assert frame_of(tier, (0, 1)).y == [[1.0, 1.0], [None, None]]


def loop(feed: Feed, seconds: float, rate_Hz: int = 100, period_s: float = 7.0) -> None:
    """A known loop: channel 0 goes as a sine, channel 1 as the cosine of the same phase."""
    for n in range(int(seconds * rate_Hz)):
        phase = math.tau * n / rate_Hz / period_s
        feed.add(EPOCH_S + n / rate_Hz, (2.0 * math.sin(phase), 40.0 + 10.0 * math.cos(phase)))


def test_the_points_of_an_xy_plot_lie_on_the_loop_and_are_of_one_moment_each() -> None:
    feed = Feed(2)
    cursor = Cursor(feed, View(xy=(0, 1), tail_s=20.0))
    loop(feed, 60.0)
    _, moments, _ = taken_by(cursor)
    assert moments is not None
    assert len(moments.t) == pytest.approx(20 * 30, abs=2)
    for x, y in zip(*moments.y, strict=True):
        assert x is not None
        assert y is not None
        assert (x / 2.0) ** 2 + ((y - 40.0) / 10.0) ** 2 == pytest.approx(1.0, abs=1e-3)


def test_only_new_points_of_an_xy_plot_are_sent() -> None:
    feed = Feed(2)
    cursor = Cursor(feed, View(xy=(0, 1)))
    loop(feed, 30.0)
    taken_by(cursor)
    feed.add(EPOCH_S + 30.0, (0.0, 50.0))
    _, moments, _ = taken_by(cursor)
    assert moments is not None
    assert len(moments.t) <= 2
    assert moments.y[1][-1] == 50.0


def test_cycles_are_counted_from_lowest_point_to_lowest_point() -> None:
    feed = Feed(2)
    loop(feed, 70.0)
    moments, _ = feed.tiers[0].moments_since(0, (0,))
    assert moments.cycle[-1] == 10
    turns = [
        t
        for t, a, b in zip(moments.t[1:], moments.cycle, moments.cycle[1:], strict=False)
        if a != b
    ]
    # A minimum of the sine is at three quarters of a period; the motion has to rise by 0.3 mm.
    assert all((t - EPOCH_S) % 7.0 == pytest.approx(5.25 + 0.62, abs=0.05) for t in turns)


def test_noise_ends_no_cycle() -> None:
    draw = random.Random(1)
    cycles = Cycles()
    assert {cycles.add(draw.gauss(0.0, 0.03)) for _ in range(5000)} == {0}


def test_memory_looks_back_over_an_hour_and_keeps_a_spike_of_one_sample() -> None:
    feed = Feed(1)
    for n in range(3600 * 20):
        feed.add(EPOCH_S + n / 20, (9.0 if n == 1800 * 20 else 1.0,))
    for from_s, to_s in ((0.0, 3600.0), (1700.0, 1900.0)):
        tier = feed.tier_for(EPOCH_S + from_s, EPOCH_S + to_s)
        t, curve = tier.between(EPOCH_S + from_s, EPOCH_S + to_s, (0,))
        assert len(t) <= 2 * MOST_BUCKETS
        assert t[0] == pytest.approx(EPOCH_S + from_s, abs=2 * tier.bucket_s)
        spike = max(range(len(curve)), key=lambda k: curve[k] or 0.0)
        assert curve[spike] == 9.0
        assert t[spike] == pytest.approx(EPOCH_S + 1800.0, abs=8.0)


def test_a_span_is_taken_from_the_finest_buckets_that_reach_back_to_it() -> None:
    feed = Feed(1)
    for n in range(2 * 3600 * 5):
        feed.add(EPOCH_S + n / 5, (1.0,))
    end_s = EPOCH_S + 2 * 3600
    widths = [
        feed.tier_for(end_s - ago_s, end_s - ago_s + 20.0).bucket_s
        for ago_s in (30.0, 2500.0, 5000.0)
    ]
    assert widths == [1 / 30, 1 / 3, 4.0]
