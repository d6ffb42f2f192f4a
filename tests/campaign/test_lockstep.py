"""The lockstep campaign: its catalogue, a few of its cases, and benches broken behind its back."""

import itertools
import math
import random
from pathlib import Path

import pytest

from campaign.faults import lockstep
from campaign.faults.cases import chosen_rows, outcomes, pair_cases, single_cases
from campaign.faults.catalogue import ROWS
from campaign.faults.lockstep import Case, run_case
from campaign.faults.oracle import Then, judge
from campaign.faults.scenes import SCENES
from campaign.faults.trace import WatchedBench
from campaign.virtual import Rig
from firmware_protocol.enums import BoardState
from firmware_protocol.supervisor import Supervisor
from sim_device.board import WRAP
from sim_device.faults import FAULT_KINDS
from smad.errors import CommandError


def case(*names: str, scene: str = "heating", at_s: float = 2.0) -> Case:
    onsets_s = tuple(at_s + 0.3 * n for n in range(len(names)))
    return Case(names, scene, 0, "test", onsets_s)


def test_every_fault_of_the_device_is_in_the_campaign() -> None:
    assert {row.kind.name for row in ROWS.values()} >= set(FAULT_KINDS)


def test_what_must_stop_has_a_finite_budget_and_a_cause() -> None:
    for row in ROWS.values():
        if row.then in (Then.STOPS, Then.RESTARTS, Then.ENDS_OFF):
            assert math.isfinite(row.stop_budget_J), row.name
        if row.then is Then.STOPS:
            assert row.faults, row.name


def test_drawn_parameters_are_those_of_the_fault_and_differ() -> None:
    rng = random.Random(1)
    for row in ROWS.values():
        first, second = row.drawn(rng, 0), row.drawn(rng, 0)
        assert set(first.parameters) == set(row.kind.parameters), row.name
        if set(row.draws) - {"channel", "way"}:
            assert first.parameters != second.parameters, row.name


def test_the_same_seed_draws_the_same_cases_and_another_does_not() -> None:
    rows = chosen_rows(())
    assert single_cases(3, 60, rows) == single_cases(3, 60, rows)
    assert single_cases(3, 60, rows) != single_cases(4, 60, rows)
    assert pair_cases(3, 20) == pair_cases(3, 20)
    assert all(len(set(case.row_names)) == 2 for case in pair_cases(3, 20))


def test_a_name_of_the_device_chooses_all_its_rows_and_a_wrong_one_is_refused() -> None:
    assert {row.name for row in chosen_rows(["stall"])} == {"stall", "stall_short", "stall_to_host"}
    with pytest.raises(CommandError, match="has this name; got leek"):
        chosen_rows(["leek"])


@pytest.mark.parametrize(
    ("name", "scene", "fault"),
    [
        ("wire_cut", "heating", "WIRE_OPEN"),
        ("sensor_open", "sine", "SENSOR_OPEN"),
        ("leak", "air", "LEAK"),
        ("pump_stalled", "water", "PUMP_STALLED"),
        ("host_stall_long", "heating", "SETPOINT_LOST"),
        ("reboot", "holding", ""),
        ("stall_short", "heating", ""),
        ("wall_clock_jump", "heating", ""),
        ("unplug", "heating", "SETPOINT_LOST"),
    ],
)
def test_a_fault_ends_as_it_must(name: str, scene: str, fault: str) -> None:
    outcome = run_case(case(name, scene=scene))
    assert judge(outcome) == []
    assert outcome.first_fault == fault
    assert (outcome.safe_after_s is None) == (outcome.expected.then is Then.GOES_ON)


def test_a_clock_that_is_about_to_wrap_is_watched_until_it_has(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clocks_us: list[int] = []
    whole = WatchedBench.advance

    def noted(self: WatchedBench) -> object:
        state = whole(self)
        clocks_us.append(self.board.now_us % WRAP)
        return state

    monkeypatch.setattr(WatchedBench, "advance", noted)
    assert judge(run_case(case("clock_wrap"))) == []
    wraps = [before - now > WRAP / 2 for before, now in itertools.pairwise(clocks_us)]
    assert sum(wraps) == 1


def test_two_faults_at_once_are_judged_together() -> None:
    outcome = run_case(case("flip_bits", "driver_open"))
    assert judge(outcome) == []
    assert outcome.group == "pair"
    assert outcome.first_fault == "DRIVER_OPEN"


def test_a_case_run_twice_gives_the_same_outcome() -> None:
    assert run_case(case("bursts")) == run_case(case("bursts"))


def test_a_case_leaves_nothing_among_the_records_of_a_bench(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    run_case(case("stall"))
    assert list(tmp_path.iterdir()) == []


def test_outcomes_come_in_the_order_of_the_cases() -> None:
    names = ["leak", "reboot", "encoder_lost"]
    found = list(outcomes([case(name) for name in names], jobs=1))
    assert [outcome.name for outcome in found] == names


# Benches broken behind the campaign's back: it has to notice.


@pytest.fixture
def deaf_supervisor(monkeypatch: pytest.MonkeyPatch) -> None:
    """A supervisor that takes every measurement for a good one."""
    whole = Supervisor.sample

    def deaf(self: Supervisor, measurements: object, now_us: int) -> object:
        for check in ("leak", "encoder_invalid"):
            setattr(measurements, check, 0)
        return whole(self, measurements, now_us)  # type: ignore[arg-type]

    monkeypatch.setattr(Supervisor, "sample", deaf)


@pytest.mark.usefixtures("deaf_supervisor")
@pytest.mark.parametrize("name", ["leak", "encoder_lost"])
def test_a_board_that_overlooks_a_fault_fails_cause_and_energy(name: str) -> None:
    clauses = {violation.clause for violation in judge(run_case(case(name)))}
    assert clauses == {"cause", "energy"}


def test_a_client_that_arms_again_by_itself_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = Rig.sample
    tried: list[bool] = []

    async def eager(self: Rig) -> None:
        await whole(self)
        axis = self.axis
        ready = axis.watch.parameters.complete and axis.watch.mode is BoardState.SAFE
        if self.bench.faults.begun and ready and not tried:
            tried.append(True)
            self.begin("arm")

    monkeypatch.setattr(Rig, "sample", eager)
    # A bench that is still cold, for the board would refuse to arm a hot one.
    outcome = run_case(case("reboot", at_s=0.5))
    assert tried
    assert "rearm" in {violation.clause for violation in judge(outcome)}


def test_every_scene_heats_a_healthy_bench() -> None:
    for scene in SCENES.values():
        assert lockstep.healthy_J(scene, 0, 0.0, 10.0) > 10.0, scene.name
