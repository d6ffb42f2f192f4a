"""A client in another folder than the daemon can use what it is told."""

from pathlib import Path

import pytest

from smad.config import RecorderConfig
from smad.daemon.telemetry.recorder import Recorder
from smad.runlog.header import RunHeader


async def test_where_run_logs_go_is_told_as_an_absolute_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    recorder = Recorder(RecorderConfig(folder="runs"), lambda name: RunHeader(), lambda: 0.0)
    try:
        assert recorder.status().folder == str(tmp_path / "runs")
        await recorder.start("one", by_command=True)
        path = Path(recorder.status().path)
        await recorder.stop()
    finally:
        recorder.close()
    assert path.is_absolute()
    assert path.parent == tmp_path / "runs"
    assert path.exists()
