"""Runs of a programme on a bench: what becomes of one that trips."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from sim_device.plant.models import Model, built_in
from smad import api
from smad.checkup.play import live, simulated
from smad.checkup.series import NOW, Play
from smad.config import Config, config_to_toml
from smad.experiments.driver import log_path
from smad.experiments.errors import TrippedError
from smad.runlog.reader import read_run
from tests.smad.checkup.short import SHORT
from tests.smad.experiments.fake_client import FakeClient
from tests.smad.experiments.helpers import driver
from tests.smad.experiments.test_leased import Noting

RUN = replace(SHORT, duration_s=12.0, t_s=SHORT.t_s[:4], inputs=SHORT.inputs[:4])
TRIP = api.Fault(number=7, name="no_cooling")


class Tripping(FakeClient):
    """A bench that trips a while after its recording has begun."""

    looks = 0

    def motion(self) -> api.Motion:
        self.looks += self.recording
        found = super().motion()
        if self.looks < 40:
            return found
        return msgspec.structs.replace(found, armed=False, mode="FAULT", fault=TRIP)

    @contextlib.contextmanager
    def in_control(self, name: str, lease_s: float) -> Iterator[None]:
        yield

    def disarm(self) -> None:
        """The bench is a fake."""


class Warm(Noting):
    """A bench whose springs may be too warm to arm."""

    def motion(self) -> Any:
        return SimpleNamespace(armed=self.armed, board_time_s=self.time_s)

    def config(self) -> str:
        return config_to_toml(Config())

    def status(self) -> Any:
        return SimpleNamespace(board=None)


@pytest.fixture
def client(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Tripping:
    own = Tripping(tmp_path)
    monkeypatch.setattr("smad.checkup.play.time.sleep", own.let_pass)
    return own


def recorded_of(model: Model, path: Path) -> Path:
    with simulated(model, seed=1) as series:
        path.write_bytes(series(0)(RUN, None).path.read_bytes())
    return path


def player(client: Any) -> Play:
    return live(client, bench="bench", say=print, progress=print)(NOW)


def test_a_repeat_that_trips_is_kept_as_far_as_it_goes(client: Tripping, tmp_path: Path) -> None:
    plan = RUN.plan()
    driver(folder=tmp_path).run(plan)
    recorded = player(client)(RUN, log_path(tmp_path, plan))
    assert recorded.ended == "run short: the board left ARMED (FAULT, no_cooling)"
    assert recorded.tripped
    assert 0.3 < read_run(recorded.path).duration_s < 5.0


def test_the_next_run_waits_until_the_springs_are_cold_enough_to_arm(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As after a run that was ended while a spring was hot."""
    bench: Any = Warm()

    def run(driver: Any, plan: Any) -> None:
        driver.log = Path("a.mcap")
        bench.run(plan)

    monkeypatch.setattr("smad.checkup.play.RestFirstDriver._run", run)
    monkeypatch.setattr("smad.checkup.play.time.sleep", bench.sleep)
    own = live(bench, bench="bench", say=print, progress=bench.done.append)(NOW)
    own(RUN, None)
    bench.refusals = 2
    own(RUN, None)
    assert bench.done.count("ran") == 2
    assert "short: waiting until the springs are cold enough to arm" in bench.done


def test_a_first_recording_that_trips_is_no_good_run(client: Tripping) -> None:
    with pytest.raises(TrippedError, match=r"left ARMED; got FAULT, no_cooling"):
        player(client)(RUN, None)


def test_a_simulated_repeat_that_trips_is_kept_as_far_as_it_goes(tmp_path: Path) -> None:
    nominal = built_in("A")
    weak = nominal.with_effects({"driver_gain": {"gain": -0.25}})
    good = recorded_of(nominal, tmp_path / "good.mcap")
    with simulated(weak, seed=2) as series:
        recorded = series(0)(RUN, good)
        assert "the board left ARMED" in recorded.ended
        assert "CURRENT_LOW" in recorded.ended
        assert 0.3 < read_run(recorded.path).duration_s < RUN.duration_s
    with simulated(weak, seed=2) as series, pytest.raises(TrippedError, match="CURRENT_LOW"):
        series(0)(RUN, None)


def test_a_repeat_whose_readings_leave_the_good_run_has_not_tripped(tmp_path: Path) -> None:
    nominal = built_in("A")
    offset = nominal.with_effects({"force_offset": {"offset_N": 1.0}, "force_gain": {"gain": 0.2}})
    good = recorded_of(nominal, tmp_path / "good.mcap")
    with simulated(offset, seed=2) as series:
        recorded = series(0)(RUN, good)
    assert "control.repeat allows" in recorded.ended
    assert not recorded.tripped
