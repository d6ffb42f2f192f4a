"""The reader of a page finds, in a log of several axes, the one that is asked for."""

from pathlib import Path

import pytest

from smad.errors import RunLogError
from smad.runlog.header import RunHeader
from smad.runlog.one_axis import extract
from smad.runlog.reader import read_run
from smad.runlog.schema import Row
from smad.runlog.writer import write_run
from smad.view import jobs
from smad.view.reader.logs import Log

BEGAN_S = 1_700_000_000.0
NAMES = ("pitch-1", "yaw-1")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("axes") / "two.mcap"
    header = RunHeader(source="sim", name="two", started_unix_s=BEGAN_S, axes=NAMES)
    rows = [
        (Row(t_s=n * 0.01, host_time_s=BEGAN_S + n * 0.01, displacement_mm=mm), axis, at_s)
        for n in range(200)
        for axis, mm in (("pitch-1", 1.0), ("yaw-1", -2.0))
        for at_s in (BEGAN_S + n * 0.01,)
    ]
    write_run(path, header, rows)
    return path


@pytest.mark.parametrize(("axis", "mm"), [("pitch-1", 1.0), ("yaw-1", -2.0)])
def test_the_past_of_an_axis_is_read_from_its_own_samples(log: Path, axis: str, mm: float) -> None:
    read = Log(log, axis).read(BEGAN_S, BEGAN_S + 2.0, ["displacement_mm"], [])
    assert read.frame.t[0] == BEGAN_S
    assert set(read.frame.y[0]) == {mm}


def test_a_log_of_one_axis_that_was_made_of_several_is_that_axis(log: Path) -> None:
    alone = extract(log, "yaw-1")
    assert set(read_run(alone, axis="yaw-1").columns["displacement_mm"]) == {-2.0}
    with pytest.raises(RunLogError, match="one axis"):
        read_run(alone, axis="pitch-1")


def test_a_job_is_for_the_axis_that_the_page_shows(tmp_path: Path) -> None:
    made = jobs.job_command(jobs.RunExperiment(experiment="fig9-cycle"), tmp_path, "bench", "yaw-1")
    assert "--axis=yaw-1" in made.words
    made = jobs.job_command(jobs.PageOfRun(runs=("a.mcap",)), tmp_path, "bench", "yaw-1")
    assert "--axis=yaw-1" in made.words
    alone = jobs.job_command(jobs.CheckUp(baseline="b"), tmp_path, "bench")
    assert not [word for word in alone.words if word.startswith("--axis")]
