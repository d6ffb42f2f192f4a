"""The reader of a page finds, in a log of several axes, the one that is asked for."""

import asyncio
from pathlib import Path

import numpy as np
import pytest

from smad.errors import RunLogError
from smad.runlog.header import RunHeader
from smad.runlog.one_axis import extract
from smad.runlog.reader import read_run
from smad.runlog.schema import Row
from smad.runlog.writer import write_run
from smad.style.strips import PLACES
from smad.view import jobs
from smad.view.feed import View
from smad.view.queries import Queries
from smad.view.reader.logs import Log
from smad.view.replies import Read
from smad.view.source import Source

BEGAN_S = 1_700_000_000.0
NAMES = ("pitch-1", "yaw-1")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("axes") / "two.mcap"
    header = RunHeader(source="sim", name="two", started_unix_s=BEGAN_S, axes=NAMES)
    rows = [
        (Row(t_s=n / 100, host_time_s=at_s, displacement_mm=mm, force_N=n / 100), axis, at_s)
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


@pytest.mark.parametrize("memory_from_s", [-600, 1])
def test_the_times_of_a_span_increase_where_the_log_has_only_a_part_of_it(
    log: Path, memory_from_s: int
) -> None:
    source, channel = Source("bench"), PLACES["displacement_mm"]
    axis = source.axis("")
    for n in range(memory_from_s, 600):
        axis.feed.add(BEGAN_S + n, (0.0,) * len(PLACES))
    queries = Queries(source)
    span_s, names = (BEGAN_S - 600.0, BEGAN_S + 600.0), ["displacement_mm"]
    read = Log(log, "yaw-1").read(*span_s, names, names)
    short = Log(log, "yaw-1").read(BEGAN_S - 28.0, BEGAN_S + 2.0, names, names)
    assert len(short.frame.t) == 200

    async def of_log(*asked: object) -> Read:
        return read

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(queries, "_of_log", of_log)
        view = View(channels=(channel,), xy=(channel,))
        past = asyncio.run(queries.past(axis, *span_s, view))
    assert past.source == "memory and run log"
    assert past.moments is not None
    for part in (short.frame, read.frame, past.frame, past.moments):
        assert len(part.t) == len(part.y[0])
        assert (np.diff(part.t) > 0).all()
    assert len(past.moments.cycle) == len(past.moments.t)
    assert set(read.frame.t) < set(past.frame.t)


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
