"""How the right entry fares alone: what it shows, what it gains, and what it is mistaken for."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec
import pytest

from smad.gap.diagnose import ready
from smad.gap.errors import RunRefused
from smad.gap.fit.stages import Prepared
from smad.gap.records import NAMED, Outcome
from tests.smad.gap.cases import OTHER, SETTINGS, SHOWN, bank
from tests.smad.gap.heater_plant import HeaterPlant, recorded
from tests.withheld.entry import EntryRecord, examine


def since_good(effects: Mapping[str, Mapping[str, float]], **moved: float) -> Prepared:
    """A bench that has come to have these effects, and other values of some parameters."""
    runs = bank(OTHER | moved, effects)
    return ready(
        runs[:3], plant=HeaterPlant(), good=bank(OTHER, seed=40)[:3], hold_out=runs[3:],
        settings=SETTINGS,
    )  # fmt: skip


@pytest.fixture(scope="module")
def coupled() -> EntryRecord:
    prepared = since_good({"coupling": SHOWN["coupling"]})
    return examine(prepared, ["coupling"], ["radiation"])


def test_an_entry_that_is_the_truth_is_named_when_it_is_alone(coupled: EntryRecord) -> None:
    assert coupled.standing.outcome in NAMED
    assert coupled.name == "coupling"
    assert coupled.standing.tied
    assert not coupled.standing.free_answers
    assert coupled.fit is not None
    assert coupled.fit.shows
    assert coupled.fit.enters
    assert coupled.fit.gain > coupled.fit.asked * coupled.fit.gain_se
    assert coupled.fit.values["g_W_K"] == pytest.approx(0.12, rel=0.2)


def test_what_parameters_can_imitate_is_taken_off_step_by_step(coupled: EntryRecord) -> None:
    fit = coupled.fit
    assert fit is not None
    assert fit.d2_known > fit.d2_nothing > 16.0
    assert fit.d2_nothing > fit.d2_free > 0.0
    assert 0.0 <= coupled.hidden < 1.0
    assert coupled.hidden == pytest.approx(1.0 - fit.d2_nothing / fit.d2_known)


def test_the_size_of_an_effect_is_told_in_floors_and_in_background(coupled: EntryRecord) -> None:
    fit = coupled.fit
    assert fit is not None
    assert fit.output.startswith(("thermal", "rod"))
    assert fit.size_floors >= fit.size_background > 1.0
    assert set(coupled.background) == {c.name for c in HeaterPlant().channels}
    assert all(size > 0.0 for size in coupled.background.values())


def test_another_entry_in_its_place_is_told_with_its_distance(coupled: EntryRecord) -> None:
    for rival in coupled.rivals:
        assert rival.name == "radiation"
        assert rival.d2 is None or rival.d2 > 16.0
        assert rival.odds is None or rival.odds < 0.1


def test_the_experiment_that_would_tell_more_is_named_with_what_it_would_tell(
    coupled: EntryRecord,
) -> None:
    known = {e.name for e in HeaterPlant().catalogue()}
    asides = [coupled.apart, *(r.apart for r in coupled.rivals if r.d2 is not None)]
    assert len(asides) >= 1
    for aside in asides:
        assert {a.experiment for a in aside} == known
        assert all(a.d2 > 16.0 for a in aside)
        assert [a.counted for a in aside] == sorted((a.counted for a in aside), reverse=True)


@pytest.mark.parametrize("size", [0.03, 0.3])
def test_on_a_bench_that_obeys_the_model_most_of_a_separation_counts_however_large(
    size: float,
) -> None:
    small = {"g_W_K": size * SHOWN["coupling"]["g_W_K"]}
    (best, *_) = examine(since_good({"coupling": small}), ["coupling"]).apart
    assert 0.5 < best.counted / best.d2 <= 1.0


def test_an_entry_that_is_not_the_truth_leaves_the_gap(coupled: EntryRecord) -> None:
    other = examine(since_good({"coupling": SHOWN["coupling"]}), ["driver_gain"])
    assert other.standing.outcome not in NAMED
    assert other.standing.outcome_asked is Outcome.UNKNOWN
    assert other.standing.gap_refit == pytest.approx(coupled.standing.gap_refit, rel=0.05)
    assert other.rivals == []


def test_parameters_that_have_moved_answer_in_the_place_of_an_entry() -> None:
    moved = examine(since_good({}, c_J_K=34.0, ha_W_K=0.66), ["coupling"])
    assert moved.standing.free_answers
    assert moved.standing.free_gain > 2.0 * moved.standing.free_gain_se > 0.0
    assert moved.standing.outcome not in NAMED
    assert moved.standing.gap_free < moved.standing.gap_refit


def test_an_entry_that_screening_gains_nothing_by_is_fitted_even_so() -> None:
    quiet = examine(since_good({}), ["backlash", "sticky_fan"], ["dial_delay"])
    assert quiet.standing.outcome not in NAMED
    assert quiet.fit is not None
    assert not quiet.fit.shows
    assert quiet.fit.d2_free <= quiet.fit.d2_nothing <= quiet.fit.d2_known
    assert quiet.fit.d2_nothing < 16.0
    assert quiet.apart
    assert all(a.d2 < 16.0 for a in quiet.apart)
    assert [r.name for r in quiet.rivals] == ["dial_delay"]


def test_a_record_reads_as_it_was_written(coupled: EntryRecord) -> None:
    assert msgspec.json.decode(msgspec.json.encode(coupled), type=EntryRecord) == coupled


def test_runs_that_cannot_be_used_have_no_entry() -> None:
    short = [recorded("random", 1, duration_s=3.0)]
    with pytest.raises(RunRefused, match="no run to fit can be used"):
        ready(short, plant=HeaterPlant(), settings=SETTINGS)
