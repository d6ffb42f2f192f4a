"""`smad tune` on a client that only notes: what is applied, and how an interruption ends."""

import contextlib
import io
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from sim_device.plant.models import built_in
from smad import api
from smad.cli import execute
from smad.config import Config, config_to_toml
from smad.control.commands import Tune
from smad.experiments.tuned import Trial
from smad.experiments.tuning import Session, tune
from smad.experiments.virtual import VirtualDriver
from tests.smad.cli.test_commands import STATUS


class Noting:
    def __init__(self) -> None:
        self.done: list[str] = []
        self.tunes: list[Tune] = []

    def config(self) -> str:
        return config_to_toml(Config())

    def status(self) -> api.Status:
        return STATUS

    def motion(self) -> api.Motion:
        return STATUS.motion

    def as_of(self, generation: int | None) -> None:
        self.generation = generation

    @contextlib.contextmanager
    def in_control(self, name: str, lease_s: float) -> Iterator[None]:
        yield

    def disarm(self) -> None:
        self.done.append("disarmed")

    def tune(self, command: Tune) -> None:
        self.done.append("tuned")
        self.tunes.append(command)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Noting:
    noting = Noting()

    @contextlib.contextmanager
    def connected(name: str, *, extra: str) -> Iterator[Noting]:
        yield noting

    monkeypatch.setattr("smad.cli.tune.ready_client", connected)
    return noting


def conducted(*_: Any, trial: bool) -> Session:

    config = Config()
    driver = VirtualDriver(built_in("A"), config=config)
    return tune(driver, config.control, None, trial=trial)


def test_gains_are_shown_kept_and_applied_only_when_asked(
    bench: Noting,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("smad.experiments.tuning.tune", conducted)
    assert execute(["tune", "--yes", "--no-trial"]) == 0
    assert bench.done == []
    assert "gain margin" in capsys.readouterr().out
    kept = tmp_path / "tuned.toml"
    assert execute(["tune", "--yes", "--no-trial", "--apply", "--save", str(kept)]) == 0
    assert bench.done == ["tuned", "tuned"]
    assert bench.tunes[0].kp_A_per_mm is not None
    assert bench.tunes[1].hold_band_mm == 0.01
    assert kept.read_text().startswith("[control]\nkp_A_per_mm = ")
    assert execute(["tune", "--yes", "--save", str(kept)]) == 1
    assert "nothing moved" in capsys.readouterr().err


def test_gains_that_did_worse_in_the_trial_are_neither_applied_nor_kept(
    bench: Noting,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    found = conducted(trial=False).tuned
    now, new = (Trial(r2, 0.0, 9.0, 30.0, 2) for r2 in (0.99, 0.98))
    monkeypatch.setattr("smad.experiments.tuning.tune", lambda *_, **__: Session(found, (now, new)))
    kept = tmp_path / "tuned.toml"
    assert execute(["tune", "--yes", "--apply", "--save", str(kept)]) == 0
    assert bench.done == []
    assert not kept.exists()
    assert "keep the gains you have: R² of the sinusoid is 0.9800" in capsys.readouterr().out
    assert Session(found, (new, now)).worse == ""


def test_an_interruption_ends_disarmed_and_applies_nothing(
    bench: Noting, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("smad.experiments.tuning.NEEDED", ())
    monkeypatch.setattr("smad.experiments.live.LiveDriver._run", interrupted)
    assert execute(["tune", "--yes", "--apply"]) == 130
    assert bench.done == ["disarmed"]


def test_nothing_is_armed_before_a_person_has_said_yes(
    bench: Noting, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("smad.experiments.tuning.tune", conducted)
    assert execute(["tune"]) == 1
    assert "add --yes" in capsys.readouterr().err
    monkeypatch.setattr("sys.stdin", io.StringIO("n\n"))
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True, raising=False)
    assert execute(["tune"]) == 1
    assert "nothing was armed" in capsys.readouterr().err
    assert bench.done == []
