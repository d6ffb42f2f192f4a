"""Runs of a programme on a bench: what becomes of one that trips."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from smad import api
from smad.cli.benches import _LivePlayer, simulated
from smad.experiments.driver import log_path
from smad.experiments.errors import TrippedError
from smad.runlog.reader import read_run
from tests.smad.checkup.short import SHORT
from tests.smad.experiments.fake_client import FakeClient
from tests.smad.experiments.helpers import driver

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


@pytest.fixture
def client(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Tripping:
    own = Tripping(tmp_path)
    monkeypatch.setattr("smad.cli.benches.time.sleep", own.let_pass)
    return own


def test_a_repeat_that_trips_is_kept_as_far_as_it_goes(client: Tripping, tmp_path: Path) -> None:
    plan = RUN.plan()
    driver(folder=tmp_path).run(plan)
    recorded = _LivePlayer(client, "bench", "test")(RUN, log_path(tmp_path, plan))  # type: ignore[arg-type]
    assert recorded.ended == "run short: the board left ARMED (FAULT, no_cooling)"
    assert 0.3 < read_run(recorded.path).duration_s < 5.0


def test_a_first_recording_that_trips_is_no_good_run(client: Tripping) -> None:
    with pytest.raises(TrippedError, match=r"left ARMED; got FAULT, no_cooling"):
        _LivePlayer(client, "bench", "test")(RUN, None)  # type: ignore[arg-type]


def test_a_simulated_repeat_that_trips_is_kept_as_far_as_it_goes(tmp_path: Path) -> None:
    weak = ("driver_gain:gain=-0.25",)
    with simulated(seed=1, effects=()) as play:
        good = tmp_path / "good.mcap"
        good.write_bytes(play(RUN, None).path.read_bytes())
    with simulated(seed=2, effects=weak) as play:
        recorded = play(RUN, good)
        assert "the board left ARMED" in recorded.ended
        assert "CURRENT_LOW" in recorded.ended
        assert 0.3 < read_run(recorded.path).duration_s < RUN.duration_s
    with simulated(seed=2, effects=weak) as play, pytest.raises(TrippedError, match="CURRENT_LOW"):
        play(RUN, None)
