"""Queries that the server answers itself: the past, the runs, the forms, and the one job."""

import asyncio
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct

from smad.client import NotReady
from smad.errors import SmadError
from smad.style.strips import CHANNELS
from smad.view import commands, preview, queue
from smad.view.feed import Feed, View
from smad.view.jobs import ON_THE_BENCH, JobError, Jobs, run_path
from smad.view.reader import work
from smad.view.reader.process import ReaderProcess
from smad.view.replies import Mark, Read
from smad.view.source import Axis, Source
from smad.view.tier import Curve, Frame, Moments

MOST_RUNS = 12
NO_TIME = (float("inf"), float("-inf"))


class Past(Struct, frozen=True, kw_only=True):
    """What a page gets that looks back: curves, moments for XY, marks, and where it is from."""

    frame: Frame
    moments: Moments | None
    marks: tuple[Mark, ...]
    source: str


class Queries:
    """Answers the queries of all pages of a server."""

    def __init__(self, source: Source) -> None:
        self.jobs = Jobs()
        self._source = source
        self._reader = ReaderProcess()

    async def close(self) -> None:
        """End reader and job."""
        self._reader.close()
        await self.jobs.close()

    async def past(self, axis: Axis, from_s: float, to_s: float, view: View) -> Past:
        """Return what was shown between two times: of the run log as far as it goes, or of memory.

        The log has every sample; memory has the extremes of stretches.
        """
        read = await self._of_log(axis, from_s, to_s, view)
        began_s, ended_s = NO_TIME if read is None else (read.first_s, read.last_s)
        parts: list[tuple[Frame, Moments]] = []
        if from_s < began_s:
            remembered = await of_memory(axis.feed, from_s, min(to_s, began_s), view)
            parts.append(_between(remembered, NO_TIME[1], began_s))
        if read is not None and read.frame.t:
            parts.append((read.frame, read.moments or Moments(0.0, [], [], [[] for _ in view.xy])))
        if read is not None and to_s > ended_s:
            remembered = await of_memory(axis.feed, max(from_s, ended_s), to_s, view)
            parts.append(_between(remembered, ended_s, NO_TIME[0]))
        named = [("memory", from_s < began_s), ("run log", read is not None and read.frame.t)]
        logged = () if read is None else read.marks
        marks = {
            (round(mark.x), mark.text): mark
            for mark in (*self._source.marks, *logged)
            if from_s <= mark.x <= to_s
        }
        return Past(
            frame=_one_frame([frame for frame, _ in parts], len(view.channels)),
            moments=_one_row([moments for _, moments in parts], len(view.xy)) if view.xy else None,
            marks=tuple(marks.values()),
            source=" and ".join(name for name, used in named if used) or "memory",
        )

    async def _of_log(self, axis: Axis, from_s: float, to_s: float, view: View) -> Read | None:
        path = self._source.log_path
        if not path or not Path(path).is_file():
            return None
        channels, xy = ([CHANNELS[k].name for k in places] for places in (view.channels, view.xy))
        try:
            span_s = from_s, to_s
            read = await self._reader.ask(work.past, path, axis.name, span_s, channels, xy)
        except SmadError:
            # Memory is there, whatever has become of the file.
            return None
        axis.log_first_s = read.first_s
        return read

    async def answer(self, ask: commands.Question) -> tuple[str, Any]:
        """Return what to say to a question, and what to show. Raises SmadError."""
        axis = self._source.axis(ask.axis)
        limits, rate = axis.config.limits, axis.config.control.handover_rate_mm_per_s
        match ask:
            case commands.Runs():
                return "", await self._reader.ask(work.runs, self._folder(), MOST_RUNS)
            case commands.Results(run=run):
                path = run_path(self._folder(), run)
                return "", await self._reader.ask(work.results, path, ask.axis)
            case commands.Experiments():
                return "", await self._reader.ask(work.experiments)
            case commands.Preview(trajectory=piece):
                return "", [preview.drawn(piece, axis.reference_mm, limits, rate)]
            case commands.PreviewExperiment(experiment=name, settings=settings):
                return "", await self._reader.ask(work.plans, name, settings, limits, rate)
            case commands.Begin():
                return await self._begin(ask, axis), None
            case commands.EndJob():
                ended = self.jobs.interrupt()
                return "the job is ending" if ended else "no job is under way", None
            case commands.ShowQueue():
                folder, bench = self._folder(), self._source.bench
                return "", await asyncio.to_thread(queue.queue_state, folder, bench)
            case commands.ChangeQueue(change=change):
                folder, bench = self._folder(), self._source.bench
                return await asyncio.to_thread(queue.carry_out, folder, bench, change)

    async def _begin(self, ask: commands.Begin, axis: Axis) -> str:
        now = axis.shown
        if now is not None and ask.generation not in (None, now.generation):
            raise NotReady(
                "the bench was stopped after this page last showed it",
                action="look at it, then begin the job again",
            )
        if self._source.armed and isinstance(ask.job, ON_THE_BENCH):
            raise NotReady(
                "the bench is armed already; a job must arm it itself, so that the bench is "
                "disarmed when the job crashes",
                action="disarm it, then begin the job again",
            )
        shown = None if now is None else now.generation
        known = shown if ask.generation is None else ask.generation
        folder, bench = self._folder(), self._source.bench
        return await self.jobs.begin(ask.job, folder, bench, axis.name, stops=known)

    def _folder(self) -> Path:
        if not self._source.folder:
            raise JobError(
                "the folder of the runs is not known yet", action="wait until the daemon answers"
            )
        return Path(self._source.folder)


async def of_memory(feed: Feed, from_s: float, to_s: float, view: View) -> tuple[Frame, Moments]:
    """Return what the feed keeps of a span; between two channels the loop does what waits."""
    tier = feed.tier_for(from_s, to_s)
    curves: list[Curve] = []
    for curve in tier.between(from_s, to_s, view.channels):
        curves.append(curve)
        await asyncio.sleep(0)
    t = [value for value in curves[0] if value is not None]
    return Frame(t[0] if t else 0.0, t, curves[1:]), tier.moments_between(from_s, to_s, view.xy)


def _between(
    remembered: tuple[Frame, Moments], after_s: float, before_s: float
) -> tuple[Frame, Moments]:
    """Return what lies between two times: memory has a neighbour more, which the log has, too."""
    frame, moments = remembered
    part = slice(bisect_right(frame.t, after_s), bisect_left(frame.t, before_s))
    row = slice(bisect_right(moments.t, after_s), bisect_left(moments.t, before_s))
    return (
        Frame(frame.from_s, frame.t[part], [curve[part] for curve in frame.y]),
        Moments(
            moments.from_s, moments.t[row], moments.cycle[row], [curve[row] for curve in moments.y]
        ),
    )


def _one_frame(parts: Sequence[Frame], channels: int) -> Frame:
    t = [value for part in parts for value in part.t]
    y = [[value for part in parts for value in part.y[k]] for k in range(channels)]
    return Frame(t[0] if t else 0.0, t, y)


def _one_row(parts: Sequence[Moments], channels: int) -> Moments:
    """Moments one after the other; cycles go on counting from one part to the next."""
    t: list[float] = []
    cycle: list[int] = []
    for part in parts:
        shift = (cycle[-1] - part.cycle[0]) if cycle and part.cycle else 0
        t += part.t
        cycle += [number + shift for number in part.cycle]
    y = [[value for part in parts for value in part.y[k]] for k in range(channels)]
    return Moments(t[0] if t else 0.0, t, cycle, y)
