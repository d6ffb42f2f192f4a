"""Trajectories: shapes, queueing, hand-over, and what is refused."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smad.config import LimitsConfig
from smad.control.commands import (
    PIECES,
    Chirp,
    Follow,
    Hold,
    Ramp,
    RandomLevels,
    Samples,
    Sine,
    Staircase,
    Step,
    Trajectory,
)
from smad.control.trajectories import KINDS, LONGEST_QUEUE, ReferenceQueue, compile_piece
from smad.errors import CommandError

LIMITS = LimitsConfig()


def queue(*pieces: Trajectory, at_m: float = 0.0, rate: float = 5.0) -> ReferenceQueue:
    made = ReferenceQueue(LIMITS, rate)
    made.restart(at_m)
    made.follow(Follow(trajectories=pieces))
    return made


def trace_mm(reference: ReferenceQueue, seconds: float, dt_s: float = 0.01) -> list[float]:
    return [reference.advance(dt_s) * 1e3 for _ in range(round(seconds / dt_s))]


def test_a_sine_goes_up_first_and_returns_to_its_offset() -> None:
    values = trace_mm(queue(Sine(amplitude_mm=2.0, period_s=4.0, cycles=2)), 8.0)
    assert values[99] == pytest.approx(2.0, abs=1e-6)
    assert values[299] == pytest.approx(-2.0, abs=1e-6)
    assert values[-1] == pytest.approx(0.0, abs=1e-3)


def test_a_step_jumps_and_a_hold_keeps_it() -> None:
    values = trace_mm(queue(Step(displacement_mm=3.0, duration_s=1.0), Hold(duration_s=1.0)), 2.0)
    assert set(values) == {3.0}


def test_a_ramp_moves_at_its_rate_from_where_the_reference_is() -> None:
    reference = queue(Ramp(displacement_mm=-4.0, rate_mm_per_s=2.0), at_m=0.002)
    assert reference.advance(1.0) == pytest.approx(0.0)
    assert reference.advance(2.0) == pytest.approx(-0.004)
    assert reference.done


def test_a_chirp_ends_at_its_last_frequency() -> None:
    reference = queue(Chirp(amplitude_mm=1.0, start_Hz=0.1, end_Hz=1.0, duration_s=20.0))
    values = trace_mm(reference, 20.0, 0.001)
    rising = [0.001 * k for k in range(1, len(values)) if values[k - 1] < 0.0 <= values[k]]
    assert len(rising) == 10
    # Cycle number n begins where the integral of 0.1 Hz … 1 Hz over 20 s reaches n.
    assert [t * (0.1 + 0.9 / 40.0 * t) for t in rising] == pytest.approx(range(1, 11), abs=0.01)


def test_a_staircase_climbs_from_where_it_is_and_comes_back() -> None:
    reference = queue(Staircase(step_mm=1.0, steps=3, dwell_s=1.0, there_and_back=True), at_m=0.001)
    assert [round(reference.advance(1.0 if k else 0.5) * 1e3, 9) for k in range(6)] == [
        2.0, 3.0, 4.0, 3.0, 2.0, 1.0
    ]  # fmt: skip


def test_random_levels_are_the_same_for_the_same_seed() -> None:
    def levels(seed: int) -> list[float]:
        return trace_mm(
            queue(RandomLevels(amplitude_mm=5.0, levels=20, dwell_s=0.1, seed=seed)), 2.0, 0.1
        )

    assert levels(7) == levels(7)
    assert levels(7) != levels(8)
    assert max(map(abs, levels(7))) <= 5.0


def test_samples_are_joined_by_straight_lines() -> None:
    reference = queue(Samples(t_s=(0.0, 1.0, 3.0), displacement_mm=(0.0, 2.0, -2.0)))
    assert reference.advance(0.5) == pytest.approx(0.001)
    assert reference.advance(1.5) == pytest.approx(0.0)
    assert reference.peek(0.5) == pytest.approx(-0.001)


@settings(deadline=None, derandomize=True, max_examples=60)
@given(
    levels=st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=6),
    rate=st.floats(0.5, 20.0),
)
def test_a_hand_over_never_jumps_and_never_exceeds_its_rate(
    levels: list[float], rate: float
) -> None:
    pieces = [Samples(t_s=(0.0, 1.0), displacement_mm=(level, level)) for level in levels]
    reference = queue(*pieces, rate=rate)
    dt_s, before = 0.01, 0.0
    while not reference.done:
        after = reference.advance(dt_s) * 1e3
        assert abs(after - before) <= rate * dt_s * 1.0001 + 1e-9
        before = after
    assert before == pytest.approx(levels[-1], abs=0.05)


def test_queued_pieces_follow_and_replacing_ones_start_at_the_present_reference() -> None:
    reference = queue(Ramp(displacement_mm=4.0, rate_mm_per_s=1.0))
    reference.follow(Follow(trajectories=(Hold(duration_s=1.0),), queue=True))
    assert reference.advance(4.5) == pytest.approx(0.004)
    assert not reference.done
    reference.restart(0.001)
    reference.follow(Follow(trajectories=(Ramp(displacement_mm=0.0, rate_mm_per_s=1.0),)))
    assert reference.advance(0.5) == pytest.approx(0.0005)


def test_after_the_last_piece_the_reference_stays() -> None:
    reference = queue(Sine(amplitude_mm=2.0, period_s=1.0, cycles=1, offset_mm=1.0), at_m=0.001)
    reference.advance(100.0)
    assert reference.done
    assert reference.reference_m == pytest.approx(0.001)


@pytest.mark.parametrize(
    ("piece", "blamed", "value"),
    [
        (Step(displacement_mm=-16.0, duration_s=1.0), "displacement of the step", "-16 mm"),
        (Sine(amplitude_mm=16.0, period_s=30.0, cycles=1), "amplitude of the sine", "16 mm"),
        (
            Sine(amplitude_mm=10.0, period_s=30.0, cycles=1, offset_mm=6.0),
            "amplitude of the sine",
            "10 mm",
        ),
        (Staircase(step_mm=4.0, steps=4, dwell_s=1.0), "step of the staircase", "4 mm"),
        (
            RandomLevels(amplitude_mm=40.0, levels=50, dwell_s=1.0, seed=1),
            "amplitude of the random levels",
            "40 mm",
        ),
        (Sine(amplitude_mm=10.0, period_s=0.5, cycles=1), "period of the sine", "0.5 s"),
        (Ramp(displacement_mm=10.0, rate_mm_per_s=60.0), "rate of the ramp", "60 mm/s"),
        (
            Chirp(amplitude_mm=5.0, start_Hz=0.1, end_Hz=5.0, duration_s=9.0),
            "end frequency of the chirp",
            "5 Hz",
        ),
    ],
)
def test_a_piece_beyond_a_limit_is_refused_with_what_it_is_of_its_value_and_the_limit(
    piece: Trajectory, blamed: str, value: str
) -> None:
    harmless = Hold(duration_s=1.0)
    with pytest.raises(CommandError) as refused:
        queue(harmless).follow(Follow(trajectories=(harmless, piece)))
    assert str(refused.value).startswith(f"piece 2 of 2: the {blamed} ")
    assert f"; got {value}; allowed" in str(refused.value)
    assert "(limits." in str(refused.value)


@pytest.mark.parametrize(
    ("t_s", "displacement_mm", "says"),
    [
        ((0.0, 1.0, 1.0), (0.0, 1.0, 2.0), "t_s[1] = 1, t_s[2] = 1"),
        ((0.5, 1.0), (0.0, 1.0), "t_s[0] = 0.5"),
        ((0.0, 1.0), (0.0, 1.0, 2.0), "2 and 3"),
    ],
)
def test_samples_that_make_no_motion_are_refused(
    t_s: tuple[float, ...], displacement_mm: tuple[float, ...], says: str
) -> None:
    with pytest.raises(CommandError, match="t_s") as refused:
        compile_piece(Samples(t_s=t_s, displacement_mm=displacement_mm), 0.0, LIMITS)
    assert says in str(refused.value)


def test_a_refused_command_leaves_the_queue_as_it_was() -> None:
    reference = queue(Ramp(displacement_mm=4.0, rate_mm_per_s=1.0))
    bad = (Hold(duration_s=1.0), Step(displacement_mm=40.0, duration_s=1.0))
    with pytest.raises(CommandError):
        reference.follow(Follow(trajectories=bad))
    assert reference.remaining_s == pytest.approx(4.0)


def test_an_overfull_queue_is_refused() -> None:
    reference = queue(Hold(duration_s=1.0))
    thousand = Follow(trajectories=(Hold(duration_s=1.0),) * 1000, queue=True)
    for _ in range(LONGEST_QUEUE // 1000 - 1):
        reference.follow(thousand)
    with pytest.raises(CommandError, match=f"{LONGEST_QUEUE} pieces"):
        reference.follow(thousand)


def test_every_piece_can_be_followed() -> None:
    assert set(KINDS) == set(PIECES)


EXAMPLES: dict[type, Trajectory] = {
    type(piece): piece
    for piece in (
        Step(displacement_mm=3.0, duration_s=1.0),
        Hold(duration_s=1.0),
        Ramp(displacement_mm=-4.0, rate_mm_per_s=2.0),
        Sine(amplitude_mm=2.0, period_s=4.0, cycles=2, offset_mm=1.0),
        Chirp(amplitude_mm=1.0, start_Hz=0.1, end_Hz=1.0, duration_s=20.0),
        Staircase(step_mm=1.0, steps=3, dwell_s=1.0),
        RandomLevels(amplitude_mm=3.0, dwell_s=0.5, levels=9, seed=4),
        Samples(t_s=(0.0, 1.0, 1.5), displacement_mm=(1.0, 2.0, -1.0)),
    )
}
"""One of each kind of trajectory, from an offset where it has one."""


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_what_the_limits_look_at_holds_for_every_position(kind: type) -> None:
    assert kind in EXAMPLES, f"give an example of {kind.__name__} in EXAMPLES"
    compiled = compile_piece(EXAMPLES[kind], 0.002, LIMITS)
    count = 20_000
    step_s = compiled.duration_s / count
    found = [compiled.position(k * step_s) for k in range(count + 1)]
    assert compiled.low_m - 1e-9 <= min(found)
    assert max(found) <= compiled.high_m + 1e-9
    assert found[-1] == pytest.approx(compiled.end_m, abs=1e-9)
    if compiled.start_m is None:
        return
    assert found[0] == pytest.approx(compiled.start_m, abs=1e-9)
    fastest = max(abs(b - a) for a, b in pairwise(found)) / step_s
    assert fastest <= compiled.speed_m_per_s * 1.001 + 1e-9
