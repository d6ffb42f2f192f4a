"""An endurance run: blocks of cycles on a driver, their statistics, check-ups, and its end."""

import contextlib
import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import msgspec
import numpy as np
from msgspec import Struct, structs

from smad.config import Config
from smad.control.plan import Plan
from smad.counted import counted
from smad.errors import RunLogError, SmadError
from smad.experiments.endurance.limits import EndLimits, LimitMonitor
from smad.experiments.endurance.profile import Profile
from smad.experiments.endurance.room import Reserve, Room, longest_block_s, room_for
from smad.experiments.endurance.statistics import NAMES, Cycle, bounds, cycles_of
from smad.experiments.errors import ExperimentError
from smad.experiments.logs import recording_of
from smad.experiments.recording import Recording
from smad.files import append_lines, replacing
from smad.progress import Say, silent
from smad.runlog.paths import SUFFIX, make_folder
from smad.runlog.reader import Run, read_run, recorded
from smad.runlog.recover import recovered_path
from smad.runlog.schema import Event, Record, Row
from smad.runlog.writer import write_run

CYCLES_FILE = "cycles.csv"
NO_LIMITS = EndLimits()


class BlockDriver(Protocol):
    """Carries out a block."""

    @property
    def log(self) -> Path | None:
        """Where it was recorded; None where nothing is."""

    def run(self, plan: Plan) -> Recording:
        """Carry out the plan from rest and return what was recorded."""


class Judgement(Struct, frozen=True):
    """What a check-up said: its headline, and the probability that a place has changed."""

    headline: str
    place_probability: float


@dataclass(frozen=True, kw_only=True)
class Endurance:
    """Settings of an endurance run. Every `check_every` cycles `check` is called; 0: never.

    `first` is the number of its first cycle; `longest_s` how long one arming and one file of the
    run log may last.
    """

    profile: Profile
    cycles: int
    limits: EndLimits = NO_LIMITS
    check_every: int = 0
    full_every: int = 1
    first: int = 1
    longest_s: float = 3600.0


@dataclass
class EnduranceResult:
    """How a run ended: after how many cycles, why, and what the check-ups said."""

    cycles: int = 0
    reason: str = ""
    judgements: list[tuple[int, Judgement]] = field(default_factory=list)


def earlier_cycles(folder: Path) -> int:
    """Return the number of the last cycle that a run in this folder wrote; 0: there is none."""
    path = folder / CYCLES_FILE
    if not path.exists():
        return 0
    return max((int(row["number"]) for row in csv.DictReader(whole_lines(path))), default=0)


def first_cycle(folder: Path, *, go_on: bool) -> int:
    """Return the number of the first cycle of a run in this folder.

    Raises SmadError where the folder has cycles and the run is not to `go_on` after them.
    """
    earlier = earlier_cycles(folder)
    if earlier and not go_on:
        raise SmadError(
            f"{folder} has {counted(earlier, 'cycle')} already",
            action="name another folder, or give --go-on to go on after them",
        )
    return earlier + 1


def whole_lines(path: Path) -> list[str]:
    """Return the lines of a file, without a last one that a power loss cut."""
    text = path.read_text(encoding="utf-8")
    return text[: text.rfind("\n") + 1].splitlines()


def endure(
    settings: Endurance,
    driver: BlockDriver,
    folder: Path,
    room: Room,
    *,
    logs: Path | None = None,
    check: Callable[[int], Judgement] | None = None,
    say: Say = silent,
) -> EnduranceResult:
    """Carry the run out; `cycles.csv` in `folder` has each cycle's statistics as soon as known.

    `logs` is where the driver's run logs go, left out: `folder`; the room is reserved there.

    Raises what the driver raises: a stop or a fault ends it, with all that was recorded kept.
    """
    ended = EnduranceResult(cycles=settings.first - 1)
    watch = LimitMonitor(settings.limits)
    reserve = Reserve(logs or folder, room)
    last = settings.first + settings.cycles - 1
    try:
        while ended.cycles < last and not ended.reason:
            count = _block(settings, ended.cycles, last)
            cycles = _carried_out(settings, driver, folder, ended.cycles + 1, count)
            ended.cycles += len(cycles)
            ended.reason = next(filter(None, map(watch.add, cycles)), "")
            say(f"{ended.cycles} of {last} cycles")
            reserve.use((ended.cycles - settings.first + 1) / settings.cycles)
            due = settings.check_every and ended.cycles % settings.check_every == 0
            if check is not None and due and not ended.reason:
                _check(settings, ended, check)
    finally:
        reserve.close()
    ended.reason = ended.reason or "all cycles were done"
    return ended


def prepared(
    settings: Endurance, config: Config, folder: Path, logs: Path, *, go_on: bool, tell: Say
) -> tuple[Endurance, Room]:
    """The settings on a bench, and the room that they take in `logs`; `tell` says what is ahead.

    To `go_on`, it first takes over the cycles that a killed block has in `logs`.
    """
    make_folder(folder)
    profile, cycles, longest_s = settings.profile, settings.cycles, longest_block_s(config)
    late = take_over_killed(logs, profile, folder, settings.first) if go_on else 0
    if late:
        tell(f"{counted(late, 'cycle')} of a killed block taken over from its run log")
    block = profile.cycles_a_block(settings.check_every or cycles, longest_s)
    room = room_for(profile, cycles, settings.full_every, block, float(config.link.rate_hz))
    hours = cycles * profile.period_s / 3600.0
    tell(f"{counted(cycles, 'cycle')}, about {hours:.1f} h of board time; {room.in_words()}")
    return replace(settings, first=settings.first + late, longest_s=longest_s), room


def _block(settings: Endurance, done: int, last: int) -> int:
    most = last - done
    if settings.check_every:
        most = min(most, settings.check_every - done % settings.check_every)
    return settings.profile.cycles_a_block(most, settings.longest_s)


def _carried_out(
    settings: Endurance, driver: BlockDriver, folder: Path, first: int, count: int
) -> list[Cycle]:
    """A block of `count` cycles; the last has no rise after it, so one more is played.

    Of a block that was ended early the whole cycles count, as far as they were recorded.
    """
    before = driver.log
    try:
        recording = driver.run(settings.profile.plan(first, count + 1))
    except SmadError:
        if driver.log is not None and driver.log != before:
            take_over(driver.log, settings.profile, folder, first)
        raise
    cycles = list(cycles_of(recording.columns, settings.profile, first))[:count]
    if not cycles:
        raise ExperimentError(
            "no complete cycle was recorded", action="look at its run log and at the profile"
        )
    _append(folder / CYCLES_FILE, cycles)
    if settings.full_every > 1 and driver.log is not None:
        stretches = bounds(recording[settings.profile.reference], settings.profile)
        whole_cycles = [
            stretch
            for cycle, stretch in zip(cycles, stretches, strict=False)
            if (cycle.number - settings.first) % settings.full_every == 0
        ]
        note = f"one cycle in {settings.full_every}; statistics in {CYCLES_FILE}"
        thin(driver.log, whole_cycles, note)
    return cycles


def take_over(log: Path, profile: Profile, folder: Path, first: int) -> int:
    """Add the whole cycles of a run log that was ended early, from number `first` on.

    Returns how many; a log that cannot be read has none.
    """
    with contextlib.suppress(RunLogError):
        cycles = list(cycles_of(recording_of(read_run(log)).columns, profile, first))
        if cycles:
            _append(folder / CYCLES_FILE, cycles)
        return len(cycles)
    return 0


def take_over_killed(logs: Path, profile: Profile, folder: Path, first: int) -> int:
    """Add the cycles of the last block in `logs`, whose player was killed before it counted them.

    Returns how many; `first` is the number after the last one that is known.
    """
    name = profile.plan(first, 1).name
    recorded = sorted(
        path
        for path in (*logs.glob(f"*-{name}{SUFFIX}"), *logs.glob(f"*-{name}.recovered{SUFFIX}"))
        if not recovered_path(path).exists()
    )
    return take_over(recorded[-1], profile, folder, first) if recorded else 0


def _check(settings: Endurance, ended: EnduranceResult, check: Callable[[int], Judgement]) -> None:
    judgement = check(ended.cycles)
    ended.judgements.append((ended.cycles, judgement))
    limit = settings.limits.place_probability
    if limit is not None and judgement.place_probability >= limit:
        ended.reason = (
            f"a place changed with probability {judgement.place_probability:.2f} at cycle "
            f"{ended.cycles} (limit {limit:g}): {judgement.headline}"
        )


def _append(path: Path, cycles: list[Cycle]) -> None:
    rows = ([_as_text(value) for value in structs.astuple(cycle)] for cycle in cycles)
    append_lines(path, _csv(rows), head=_csv([NAMES]))


def _csv(rows: Iterable[Sequence[str]]) -> bytes:
    text = io.StringIO()
    csv.writer(text).writerows(rows)
    return text.getvalue().encode()


def _as_text(value: float) -> str:
    if not isinstance(value, float):
        return str(value)
    # Board time of weeks has more digits in front of the point.
    return f"{value:.6g}" if abs(value) < 1e5 else f"{value:.2f}"


def thin(path: Path, stretches: Sequence[tuple[int, int]], note: str) -> int:
    """Replace the log by one with these samples (first, last excluded) and all of its events.

    Returns how many samples it has. The new log is on the disk whole before the old one goes.
    Raises RunLogError.
    """
    run = read_run(path)
    chosen = np.zeros(len(run), bool)
    for begin, end in stretches:
        chosen[begin:end] = True
    rows = [_row(run, int(place)) for place in np.flatnonzero(chosen)]
    records: list[Record] = sorted([*rows, *run.events], key=lambda record: record.t_s or 0.0)
    records.append(Event(t_s=run.columns["t_s"][-1], kind="note", text=note))
    header = msgspec.structs.replace(run.header, notes=[*run.header.notes, note])
    with replacing(path, durable=True) as draft:
        draft.unlink(missing_ok=True)
        write_run(draft, header, records)
    return len(rows)


def _row(run: Run, place: int) -> Row:
    values = {name: column[place] for name, column in run.columns.items()}
    return Row(**{name: value.item() for name, value in values.items() if recorded(value)})
