"""Commands of smad that a page starts as processes, one at a time.

`Job` says which there are, and `words` makes the command of one. A job that uses the bench is a
client like any other: it takes control under a lease of its own, and a stop ends its motion.
"""

import asyncio
import contextlib
import os
import secrets
import signal
import sys
import time
from asyncio.subprocess import DEVNULL, PIPE, STDOUT, Process
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from msgspec import Meta, Struct

from smad.errors import REFUSED_STATUS, SmadError
from smad.processes.stops import knowing
from smad.runlog.paths import SUFFIX, cut_to_bytes, free_path, make_folder

MOST_LINES = 200
LONGEST_LINE = 500
LARGEST_LINE = 2**20
MOST_REPORTS = 32
PATIENCE_S = 10.0
"""How long an interrupted job may take to disarm and say goodbye."""
NICER = 10
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}

RunName = Annotated[str, Meta(min_length=1, max_length=200)]
FolderName = Annotated[str, Meta(min_length=1, max_length=500)]
SettingName = Annotated[str, Meta(pattern=r"^\w+$", max_length=64)]
Settings = Annotated[Mapping[SettingName, bool | int | float | str], Meta(max_length=64)]


class JobError(SmadError):
    """A job cannot be started."""


class JobRequest(Struct, tag_field="kind", frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A job; `kind` says which."""


class PageOfRun(JobRequest, tag="page", frozen=True, kw_only=True):
    """The page of a run, or of several runs over each other."""

    runs: Annotated[tuple[RunName, ...], Meta(min_length=1, max_length=6)]


class Diagnose(JobRequest, tag="diagnose", frozen=True, kw_only=True):
    """Where model and run disagree; with `good`, what has changed since that run."""

    run: RunName
    good: RunName | None = None


class CheckUp(JobRequest, tag="checkup", frozen=True, kw_only=True):
    """What has changed since the baseline: plays its programme on the bench."""

    baseline: FolderName
    quick: bool = False


class RunExperiment(JobRequest, tag="experiment", frozen=True, kw_only=True):
    """An experiment of the paper on the bench."""

    experiment: RunName
    settings: Settings = {}


Job = PageOfRun | Diagnose | CheckUp | RunExperiment
ON_THE_BENCH = (CheckUp, RunExperiment)


class JobCommand(Struct, frozen=True):
    """A command: what it is called, the words after `smad`, and the page that it writes."""

    title: str
    words: tuple[str, ...]
    report: Path


def job_command(job: Job, folder: Path, bench: str, axis: str = "") -> JobCommand:
    """Return the command of a job. `folder` has the runs; `axis` is that of a bench of several.

    Raises JobError for a job that is none.
    """
    of_axis = [f"--axis={axis}"] if axis else []
    on_the_bench = [f"--bench={bench}", *of_axis]
    if isinstance(job, PageOfRun):
        paths = [run_path(folder, name) for name in job.runs]
        stem = cut_to_bytes("-with-".join(path.stem for path in paths), 120)
        report = folder / f"{stem}.html"
        words = ["log", "plot", *map(str, paths), "-o", str(report), *of_axis]
        title = " and ".join(job.runs)
    elif isinstance(job, Diagnose):
        path = run_path(folder, job.run)
        report = free_path(folder / f"{path.stem}-diagnosis.html")
        words = ["gap", "diagnose", str(path)]
        title = f"diagnosis of {job.run}"
        if job.good is not None:
            words += ["--good", str(run_path(folder, job.good))]
            title += f" against {job.good}"
        words += ["--report", str(report)]
    elif isinstance(job, CheckUp):
        report = free_path(folder / "check-up.html")
        words = ["gap", "checkup", f"--baseline={job.baseline}", f"--report={report}"]
        words += [*on_the_bench, *(["--quick"] if job.quick else [])]
        title = f"check-up against {job.baseline}"
    else:
        report = free_path(folder / f"{run_path(folder, job.experiment, of_run=False).name}.html")
        settings = (f"--set={name}={_word(value)}" for name, value in job.settings.items())
        words = ["run", job.experiment, *settings, f"--report={report}", *on_the_bench]
        title = f"experiment {job.experiment}"
    return JobCommand(title, tuple(words), report)


def run_path(folder: Path, name: str, *, of_run: bool = True) -> Path:
    """Return the path of a run by the name of its file. Raises JobError: no other file is read."""
    path = folder / name
    if name.startswith(("-", ".")) or path.name != name or (of_run and path.suffix != SUFFIX):
        raise JobError("there is no such run", value=name, action="choose one from the list")
    return path


def _word(value: bool | int | float | str) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


class JobState(Struct, frozen=True, kw_only=True):
    """A job as the pages show it. `report` is an address, once there is one."""

    title: str
    lines: tuple[str, ...]
    running: bool
    took_s: float
    failed: str = ""
    report: str = ""


class Jobs:
    """The job of one server, and the reports that jobs have written. `version` grows with news."""

    def __init__(self) -> None:
        self.version = 0
        self._job: Job | None = None
        self._command: JobCommand | None = None
        self._process: Process | None = None
        self._following: asyncio.Task[None] | None = None
        self._ended_early = False
        self._lines: deque[str] = deque(maxlen=MOST_LINES)
        self._began_s = self._ended_s = 0.0
        self._failed = self._address = ""
        self._reports: dict[str, Path] = {}
        self.running = False
        """Whether one is under way."""

    async def begin(
        self, job: Job, folder: Path, bench: str, axis: str = "", *, stops: int | None = None
    ) -> str:
        """Begin a job, which knows of the `stops` up to that generation; return what to say.

        Raises JobError, or RunLogError without a folder.
        """
        command = job_command(job, folder, bench, axis)
        if self.running:
            assert self._command is not None
            raise JobError(
                "another job is running",
                value=self._command.title,
                action="wait for its end, or end it",
            )
        make_folder(folder)
        self._job, self._command = job, command
        self._lines.clear()
        self._failed = self._address = ""
        self._began_s = time.monotonic()
        self._process, self._ended_early, self.running = None, False, True
        self._following = asyncio.create_task(self._follow(command, stops))
        self.version += 1
        return f"begun: {command.title}"

    async def _follow(self, command: JobCommand, stops: int | None) -> None:
        try:
            status = await self._carried_out(command, stops)
            if self._ended_early:
                self._failed = "it was interrupted"
            elif status == REFUSED_STATUS and command.report.exists():
                self._failed = "the question was refused; the report says why"
                self._address = self._serve(command.report)
            elif status:
                self._failed = f"it ended with status {status}"
            elif command.report.exists():
                self._address = self._serve(command.report)
        except (OSError, ValueError) as error:
            # A word with a NUL is a ValueError.
            self._failed = f"it cannot be started: {getattr(error, 'strerror', None) or error}"
        finally:
            self._ended_s = time.monotonic()
            self.running = False
            self.version += 1

    async def _carried_out(self, command: JobCommand, stops: int | None) -> int:
        nice = not isinstance(self._job, ON_THE_BENCH)
        self._process = process = await asyncio.create_subprocess_exec(
            *(("nice", "-n", str(NICER)) if nice else ()),
            sys.executable,
            "-m",
            "smad",
            *command.words,
            stdin=DEVNULL,
            stdout=PIPE,
            stderr=STDOUT,
            limit=LARGEST_LINE,
            env={**os.environ, **_ONE_THREAD, **knowing(stops)},
            # ctrl-C at the terminal is for the server, which ends its job in order.
            start_new_session=True,
        )
        if self._ended_early:
            self._signal(signal.SIGTERM)
        assert process.stdout is not None
        while line := await _line_of(process.stdout):
            self._lines.append(line.decode(errors="replace").rstrip()[:LONGEST_LINE])
            self.version += 1
        return await process.wait()

    def _serve(self, report: Path) -> str:
        # Nobody who has but the cookie can guess the address.
        address = f"/report/{secrets.token_urlsafe(32)}"
        while len(self._reports) >= MOST_REPORTS:
            del self._reports[next(iter(self._reports))]
        self._reports[address] = report
        return address

    def report(self, address: str) -> bytes | None:
        """Return a page that a job wrote, by its address; None for any other."""
        path = self._reports.get(address)
        try:
            return None if path is None else path.read_bytes()
        except OSError:
            return None

    def interrupt(self, *, on_the_bench: bool = False) -> bool:
        """Ask the job, or only one on the bench, to end: it disarms what it armed.

        Return whether there was one.
        """
        if not self.running or (on_the_bench and not isinstance(self._job, ON_THE_BENCH)):
            return False
        self._ended_early = True
        self._signal(signal.SIGTERM)
        return True

    def _signal(self, number: signal.Signals) -> None:
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                self._process.send_signal(number)

    async def close(self) -> None:
        """End the job, killed if it does not end by itself."""
        if self.interrupt() and self._following is not None:
            await asyncio.wait([self._following], timeout=PATIENCE_S)
            self._signal(signal.SIGKILL)
            await asyncio.wait([self._following], timeout=PATIENCE_S)

    def snapshot(self) -> JobState | None:
        """Return the job that runs, or ran last."""
        if self._command is None:
            return None
        until_s = time.monotonic() if self.running else self._ended_s
        return JobState(
            title=self._command.title,
            lines=tuple(self._lines),
            running=self.running,
            took_s=round(until_s - self._began_s, 1),
            failed=self._failed,
            report=self._address,
        )


async def _line_of(stream: asyncio.StreamReader) -> bytes:
    """The next line; of one that is too long, nothing is kept."""
    while True:
        try:
            return await stream.readline()
        except ValueError:
            continue
