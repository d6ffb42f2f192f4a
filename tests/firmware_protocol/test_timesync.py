"""Board time to host time."""

import random

import pytest

from firmware_protocol import events as e
from firmware_protocol.messages import TimeReply
from firmware_protocol.timesync import WINDOW, TimeExchanges, TimeSync, Unwrapper
from tests.firmware_protocol.pair import Pair, TestBoard

WRAP = 1 << 32


def test_stamps_are_unwrapped_across_the_wrap_and_out_of_order() -> None:
    unwrap = Unwrapper()
    assert unwrap(WRAP - 100, 0) == WRAP - 100
    assert unwrap(50, 150) == WRAP + 50
    assert unwrap(WRAP - 10, 160) == WRAP - 10
    assert unwrap(60, 170) == WRAP + 60
    for i in range(1, 10):
        assert unwrap((60 + i * (WRAP // 3)) % WRAP, 0) == WRAP + 60 + i * (WRAP // 3)


def test_after_a_day_without_samples_the_hosts_clock_says_how_often_it_wrapped() -> None:
    unwrap = Unwrapper()
    unwrap(1000, 0)
    day_us = 86_400_000_000
    board_us = 1000 + round(day_us * 1.0002)
    assert unwrap(board_us % WRAP, day_us) == board_us


@pytest.mark.parametrize("ppm", [-200.0, 0.0, 200.0])
def test_the_drift_is_found_within_a_few_ppm_through_asymmetric_delays(ppm: float) -> None:
    rng = random.Random(5)
    sync = TimeSync()
    for i in range(WINDOW):
        t1 = 1_000_000 * i
        there, back = (200 + int(rng.expovariate(1 / 300)) for _ in range(2))
        t2 = 7_000_000 + round((t1 + there) * (1 + ppm * 1e-6))
        fit = sync.add(t1, t2, t2, t1 + there + back)
    assert fit.locked
    assert fit.plausible
    # Host over board, so the sign turns; 30 µs of asymmetry over some 100 s is 0.3 ppm.
    assert fit.drift * 1e6 == pytest.approx(-ppm, abs=3.0)
    board_us = 7_000_000 + 60_000_000 * (1 + ppm * 1e-6)
    assert fit.host_us(board_us) == pytest.approx(60_000_000, abs=200)
    assert fit.board_us(fit.host_us(board_us)) == pytest.approx(board_us, abs=0.01)


def test_one_quick_exchange_outweighs_many_slow_ones() -> None:
    sync = TimeSync()
    for i in range(8):
        t1 = i * 100_000
        delay = 300 if i == 3 else 20_000
        fit = sync.add(t1, t1 + delay, t1 + delay, t1 + delay + 100)
    assert fit.round_trip_us == 400
    assert abs(fit.host_us(fit.board_ref_us) - fit.board_ref_us) <= 200


def test_no_drift_is_claimed_from_exchanges_a_moment_apart() -> None:
    sync = TimeSync()
    for i in range(16):
        fit = sync.add(i * 50_000, i * 50_000 + 900 * (i % 2), i * 50_000 + 900, i * 50_000 + 1000)
    assert fit.drift == 0.0
    assert fit.locked


def test_a_board_faster_than_the_clock_is_not_plausible_before_its_rate_is_known() -> None:
    """A simulated bench at 40 times real time on a busy machine: one exchange a second.

    The first two fall into a moment in which the simulation hardly ran.
    """
    sync = TimeSync()
    assert sync.add(0, 0, 0, 2_500_000).plausible
    assert sync.add(1_000_000, 10_000, 10_000, 3_500_000).plausible
    for second in range(2, 12):
        board_us = 40_000_000 * (second - 1)
        fit = sync.add(1_000_000 * second, board_us, board_us, 1_000_000 * second + 1_000)
        assert not fit.plausible, second


def test_an_answer_to_another_question_is_ignored() -> None:
    exchanges = TimeExchanges()
    asked = exchanges.ask(5_000)
    assert exchanges.answer(TimeReply(asked.t1_us + 1, 0, 0), 6_000) is None
    assert exchanges.answer(TimeReply(asked.t1_us, 0, 0), 6_000) is not None
    assert exchanges.answer(TimeReply(asked.t1_us, 0, 0), 6_000) is None


@pytest.mark.parametrize("ppm", [-200, 200])
def test_two_sessions_agree_on_the_time_of_a_fast_or_slow_board_across_its_wrap(ppm: int) -> None:
    pair = Pair(board=TestBoard(t_us=WRAP - 30_000_000), ppm=ppm).connect().run(6000)
    fit = pair.host.clock
    assert fit is not None
    assert fit.locked
    assert fit.drift * 1e6 == pytest.approx(-ppm, abs=1.0)
    assert fit.host_us(pair.board.t_us) == pytest.approx(pair.now_us, abs=100)
    last = pair.told(e.StateReceived)[-1]
    assert last.board_us == pair.board.t_us > WRAP


def test_sixteen_quick_exchanges_lock_both_ends_within_a_second_then_one_a_second() -> None:
    pair = Pair().connect()
    pair.run(90)
    assert pair.host.clock is not None
    assert pair.host.clock.locked
    assert pair.board.session.clock_locked
    before = len(pair.told(e.TimeSynced))
    pair.run(1000)
    assert len(pair.told(e.TimeSynced)) - before in (9, 10, 11)


def test_time_keeps_counting_over_a_reconnection_to_the_same_board() -> None:
    pair = Pair(board=TestBoard(t_us=WRAP - 1_000_000)).connect().run(200)
    assert pair.told(e.StateReceived)[-1].board_us > WRAP
    pair.events += pair.host.lost(pair.now_us)
    pair.run(100)
    pair.connect()
    assert pair.told(e.StateReceived)[-1].board_us == pair.board.t_us


@pytest.mark.parametrize("lost_us", [60_000, 300_000, 2_800_000, -400_000])
def test_after_a_step_of_the_boards_clock_two_exchanges_bring_the_fit_back(lost_us: int) -> None:
    sync = TimeSync()

    def exchange(t1: int, behind_us: int, delay_us: int = 300) -> None:
        t2 = 9_000_000 + t1 + delay_us - behind_us
        sync.add(t1, t2, t2, t1 + 2 * delay_us)

    def wrong_us(t_us: int, behind_us: int) -> float:
        assert sync.fit is not None
        return abs(sync.fit.host_us(9_000_000 + t_us - behind_us) - t_us)

    for second in range(200):
        exchange(second * 1_000_000, 0)
    for second in (200, 201):
        exchange(second * 1_000_000, lost_us)
    assert wrong_us(202_000_000, lost_us) < 300
    for second in range(202, 230):
        exchange(second * 1_000_000, lost_us)
    assert sync.fit is not None
    assert sync.fit.locked
    assert wrong_us(230_000_000, lost_us) < 300


def test_late_answers_are_no_step() -> None:
    rng = random.Random(2)
    sync = TimeSync()
    for second in range(300):
        t1 = second * 1_000_000
        there, back = (rng.randrange(200, 400_000 if second % 3 else 500) for _ in range(2))
        t2 = t1 + there
        fit = sync.add(t1, t2, t2, t1 + there + back)
        assert abs(fit.host_us(t1) - t1) < 200_000
    assert fit.exchanges == WINDOW


def test_a_simulation_that_is_not_real_time_is_no_series_of_steps() -> None:
    sync = TimeSync()
    for second in range(40):
        t1 = second * 1_000_000
        fit = sync.add(t1, 10 * t1 + 3000, 10 * t1 + 3000, t1 + 600)
    assert fit.exchanges == 40
    assert not fit.plausible


def test_after_a_step_the_host_asks_quickly_again() -> None:
    exchanges = TimeExchanges()
    now_us, behind_us, waits = 0, 0, []
    for n in range(80):
        now_us = max(now_us + 1000, exchanges.due_us)
        behind_us = 500_000 if n >= 40 else 0
        asked = exchanges.ask(now_us)
        stamp = 9_000_000 + now_us + 300 - behind_us
        exchanges.answer(TimeReply(asked.t1_us, stamp, stamp), now_us + 600)
        waits.append(exchanges.due_us - now_us)
    assert waits[30:40] == [1_000_000] * 10
    assert 12 <= waits[40:].count(50_000) <= 16
    assert waits[-10:] == [1_000_000] * 10
