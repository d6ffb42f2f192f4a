"""`smad run six-axes` on a simulated bench: table, skew, page."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from unittest.mock import MagicMock

import pytest

from smad.cli import execute
from smad.client.endpoints import FOLDER_VARIABLE
from smad.config import Config, PlantConfig, RecorderConfig, config_to_toml
from smad.experiments.circles import draw
from smad.processes.daemon import running_daemon
from smad.processes.simulator import PACED
from smad.progress import silent


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    config = tmp_path / "bench.toml"
    runs = RecorderConfig(folder=str(tmp_path / "runs"), automatic=False)
    fast = PlantConfig(speed_ratio=50.0)
    config.write_text(config_to_toml(Config(recorder=runs, plant=fast)))
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    # One segment, whose boards wait for the host: as fast as it goes.
    arguments = ["--sim", *PACED, "--axes", "2", "--config", str(config)]
    with running_daemon(arguments, tmp_path):
        yield tmp_path


def test_an_interruption_disarms_before_the_log_is_closed() -> None:
    bench, ended = MagicMock(), list[str]()
    for name in ("armed", "record"):
        getattr(bench, name).return_value.__exit__.side_effect = lambda *_, n=name: ended.append(n)
    bench.wait_until_done.side_effect = KeyboardInterrupt
    with pytest.raises(KeyboardInterrupt):
        draw(bench, MagicMock(segments={"segment-1": None}), 15.0, 20.0, silent)
    assert ended == ["armed", "record"]


def test_it_draws_each_segment_and_all_and_writes_table_and_page(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = folder / "page.html"
    asked = ["run", "six-axes", "--radius", "1", "--period", "2", "--report", str(page)]
    assert execute(asked) == 0
    said = capsys.readouterr().out
    rows = [line for line in said.splitlines() if line.startswith("segment-1")]
    assert [row.split()[1] for row in rows] == ["alone", "together"]
    # The radius is 1°: an error as large would be that of a tip which stands still.
    assert all(float(row.split()[2]) < 1.0 for row in rows)
    assert "apart" in said
    assert "Tip" in page.read_text()
    assert len(list((folder / "runs").glob("*six-axes.mcap"))) == 1
