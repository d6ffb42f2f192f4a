"""A few of the power losses and kills of the campaigns, `power` and `kills` beside this file."""

from pathlib import Path

import pytest

from smad.client.endpoints import FOLDER_VARIABLE

from . import kills, power


def lose_power(folder: Path, seed: int, synchronous: str = "") -> power.Loss:
    try:
        return power.lose_power(folder, seed, synchronous)
    except power.NoMount as error:
        pytest.skip(f"file systems cannot be mounted here: {error}")


@pytest.mark.parametrize("seed", range(3))
def test_a_power_loss_loses_no_change_that_was_acted_upon(tmp_path: Path, seed: int) -> None:
    assert not lose_power(tmp_path, seed).lost


def test_without_waiting_for_the_disk_a_power_loss_does_lose_changes(tmp_path: Path) -> None:
    assert any(lose_power(tmp_path, seed, "OFF").lost for seed in range(5))


def test_a_daemon_that_does_not_answer_does_not_pass_for_a_bench_that_is_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    assert not kills.is_off()


def test_kills_of_each_part_run_nothing_twice_and_lose_nothing(tmp_path: Path) -> None:
    seeds = [
        next(s for s in range(1000) if kills.drawn(s)[0] == v) for v in ("runner", "everything")
    ]
    rig = kills.Rig(tmp_path, speed=4.0)
    try:
        outcomes = [kills.trial(rig, seed) for seed in seeds]
    finally:
        rig.close()
    assert [outcome.faults for outcome in outcomes] == [[], []]
