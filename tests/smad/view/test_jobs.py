"""What the live page offers of a run, and what it shows of a diagnosis that is refused."""

import asyncio
import re
from pathlib import Path

import pytest
from msgspec import ValidationError, convert

import smad.view
from smad.diagnosis.plant import Traits
from smad.errors import REFUSED_STATUS
from smad.view.jobs import Diagnose, JobCommand, JobRequest, Jobs, PageOfRun, RunExperiment


@pytest.mark.parametrize(
    ("status", "failed", "served"),
    [
        (0, "", True),
        (REFUSED_STATUS, "the question was refused; the report says why", True),
        (1, "it ended with status 1", False),
    ],
)
def test_the_report_of_a_refused_diagnosis_is_served_all_the_same(
    status: int, failed: str, served: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def carried_out(jobs: Jobs, command: JobCommand, stops: int | None) -> int:
        command.report.write_text("why")
        return status

    monkeypatch.setattr(Jobs, "_carried_out", carried_out)

    async def told() -> tuple[str, str]:
        jobs = Jobs()
        await jobs.begin(Diagnose(run="a.mcap"), tmp_path, "bench")
        while jobs.running:
            await asyncio.sleep(0)
        job = jobs.snapshot()
        assert job is not None
        return job.failed, job.report

    said, report = asyncio.run(told())
    assert said == failed
    assert bool(report) == served


@pytest.mark.parametrize(
    "job",
    [
        PageOfRun(runs=["a\0.mcap"]),
        Diagnose(run="a\0.mcap"),
        RunExperiment(experiment="fig10-thermal", settings={"amplitude_mm": "\0"}),
    ],
)
def test_a_job_with_a_nul_in_its_words_is_shown_as_one_that_cannot_be_begun(
    job: JobRequest, tmp_path: Path
) -> None:
    async def told() -> str:
        jobs = Jobs()
        await jobs.begin(job, tmp_path, "bench")  # type: ignore[arg-type]
        while jobs.running:
            await asyncio.sleep(0)
        snapshot = jobs.snapshot()
        assert snapshot is not None
        return snapshot.failed

    assert asyncio.run(told()) == "it cannot be started: embedded null byte"


def in_the_page(name: str) -> int:
    """A number of the page's script."""
    script = Path(smad.view.__file__).with_name("static") / "runs.js"
    found = re.search(rf"{name} = (\d+);", script.read_text())
    assert found is not None
    return int(found[1])


def test_the_page_offers_a_diagnosis_of_runs_that_are_long_enough_for_one() -> None:
    assert in_the_page("SHORTEST_S") == Traits().shortest_s


def test_the_page_offers_to_compare_as_many_runs_as_a_job_takes() -> None:
    job = {"kind": "page", "runs": ["a.mcap"] * in_the_page("MOST_COMPARED")}
    convert(job, PageOfRun)
    with pytest.raises(ValidationError):
        convert({**job, "runs": [*job["runs"], "b.mcap"]}, PageOfRun)
