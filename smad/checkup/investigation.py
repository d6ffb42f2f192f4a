"""The loop of an investigation: play, judge, play what separates best, until one rival is left.

Every run is kept under its number, so that an interrupted investigation can continue.
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import msgspec

from smad.checkup.baseline import FIRST, require_same
from smad.checkup.errors import BaselineError
from smad.checkup.files import read_file
from smad.checkup.judge import Judgement, judge_runs
from smad.checkup.programme import Programme, ProgrammeRun
from smad.checkup.proposal import Proposal, propose, unpaired_offers
from smad.checkup.series import NOW, Play, Player, keep, newest_open, write_whole
from smad.checkup.store import load
from smad.counted import counted
from smad.diagnosis.answer import gaps_on
from smad.diagnosis.errors import TooLittleRecorded
from smad.diagnosis.paired.difference import pair_runs
from smad.diagnosis.paired.good import GoodRuns
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.verdict import QUIET, SignalGap, Verdict
from smad.progress import Say

REPORT = "investigation.json"
REST_S = 60.0
"""Assumed rest before a run, until one has been measured."""


class Record(msgspec.Struct, frozen=True, kw_only=True):
    """A run of an investigation: its file, the good run that it repeats, why it was played, whether
    it was held out as proof, the time that it took with the rest before it, and why it ended early.

    `tripped`: a fault ended it; None in a file of an earlier version of smad.
    """

    file: str
    run: str
    why: str
    held_out: bool
    took_s: float
    ended: str = ""
    tripped: bool | None = None

    @property
    def trip(self) -> str:
        """The fault that ended it, or what may have been one: nothing is played after that."""
        if self.tripped is None and self.ended:
            return f"{self.ended}; whether that was a fault, its {REPORT} is too old to say"
        return self.ended if self.tripped else ""


class Report(msgspec.Struct, frozen=True, kw_only=True):
    """`investigation.json`: the runs, why each was played, and the result.

    `proof` has the gap of each signal in the held-out runs, by the model fitted to the others.
    `offers` are runs that the baseline lacks, with their modelled separation d².
    """

    records: list[Record]
    why_over: str = ""
    verdict: Verdict | None = None
    proof: list[SignalGap] = []
    offers: dict[str, float] = {}
    model: str = ""

    @property
    def spent_s(self) -> float:
        """Bench time so far."""
        return sum(r.took_s for r in self.records)

    def ending_lines(self) -> list[str]:
        """Why it is over, after what time, and the runs that the baseline lacks."""
        runs = counted(len(self.records), "run")
        return [
            f"{self.why_over}; {runs} in {self.spent_s / 60.0:.1f} min",
            *(
                f"the baseline has no run {run}; recorded on the good bench, it would be expected "
                f"to separate the remaining causes by d² = {separation:.0f}"
                for run, separation in self.offers.items()
            ),
        ]


def read_report(path: Path) -> Report:
    """The report of an investigation. Raises BaselineError for a file that is none."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Report)
    except (OSError, msgspec.MsgspecError) as error:
        raise BaselineError(
            f"{path} cannot be read: {getattr(error, 'strerror', None) or error}",
            action=f"move {path.parent} away, and investigate anew",
        ) from None


def recorded_runs(
    folder: Path, report: Report, *, held_out: bool = False
) -> list[tuple[GapRun, str]]:
    """The runs that are judged, or `held_out`, each with the name of the good run it repeats."""
    records = [r for r in report.records if r.held_out == held_out]
    return [(read_file(folder / r.file).run, r.run) for r in records]


def open_folder(folder: Path) -> Path:
    """Where the investigation of a baseline's folder goes on, or the next one begins."""

    def goes_on(place: Path) -> bool:
        report = place / REPORT
        return report.exists() and not read_report(report).why_over

    return newest_open(folder, "investigation", goes_on)


def investigate(
    folder: Path,
    plant: SmaPlant,
    programme: Programme,
    opened: AbstractContextManager[Player],
    *,
    bench: str,
    seconds: float,
    say: Say,
    progress: Say,
) -> tuple[Path, Report]:
    """Investigate the bench of a baseline; return the folder of the runs, and the report.

    `opened` yields the player. Raises BaselineError for a baseline of another bench or programme,
    and what the player raises.
    """
    baseline = load(folder, plant)
    require_same(folder, baseline, bench, programme, part=True)
    place = open_folder(folder)
    played = len(list(place.glob("*.mcap")))
    with opened as player:
        investigation = Investigation(
            plant=plant,
            reference=baseline.reference,
            programme=programme,
            originals=folder / FIRST,
            folder=place,
            play=player(NOW + played),
            say=say,
            seconds=seconds,
        )
        return place, investigation.carry_out(progress)


@dataclass
class Investigation:
    """An investigation in a folder: it begins with the quick runs of the programme, and plays them
    again at the end, held out as proof."""

    plant: SmaPlant
    reference: GoodRuns
    programme: Programme
    originals: Path
    folder: Path
    play: Play
    say: Say
    seconds: float

    def carry_out(self, progress: Say) -> Report:
        """Play and judge until it is over. What was recorded is kept whatever happens.

        Raises BaselineError if the runs were ended before anything could be judged.
        """
        report, path = Report(records=[]), self.folder / REPORT
        if path.exists():
            report = read_report(path)
            self.say(f"goes on with {counted(len(report.records), 'run')} of {self.folder}")
        names = self.reference.names
        quick = [run for run in self.programme.runs if run.quick and run.name in names]
        quick = quick or [self.programme.run(r.name) for r in self.reference.runs[:2]]
        for run in quick[sum(not r.held_out for r in report.records) :]:
            if any(r.trip for r in report.records):
                break
            report = self._played(report, run, "for the check-up", held_out=False)
        while True:
            try:
                judgement, proposal = self._judged(report, quick, progress)
            except TooLittleRecorded as error:
                raise self._over_without_verdict(report, error) from error
            self.say(f"verdict: {judgement.verdict.headline}")
            # A bench that only left its recording may be played on: each run begins from rest.
            tripped = next((r.trip for r in report.records if r.trip), "")
            if tripped or proposal.run is None:
                break
            report = self._played(
                report, self.programme.run(proposal.run), proposal.why, held_out=False
            )
        why = f"a run was ended early: {tripped}" if tripped else proposal.why
        self.say(why)
        report = msgspec.structs.replace(report, verdict=judgement.verdict)
        if judgement.verdict.outcome != QUIET:
            report = report if tripped else self._proved(report, quick, judgement)
            model = self.folder / "model.toml"
            write_whole(model, judgement.verdict.model_text().encode())
            report = msgspec.structs.replace(report, model=str(model))
        if proposal.staying:
            offers = unpaired_offers(judgement, self.programme)
            rounded = {run: round(separation, 1) for run, separation in offers.items()}
            report = msgspec.structs.replace(report, offers=rounded)
        # Last of all: an investigation that lost its bench during the proof is not over.
        report = msgspec.structs.replace(report, why_over=why)
        self._write(report)
        return report

    def _played(self, report: Report, run: ProgrammeRun, why: str, *, held_out: bool) -> Report:
        number = len(report.records) + 1
        self.say(f"{number}: {run.name}, {run.duration_s:.0f} s, {why}")
        recorded = self.play(run, self.originals / f"{run.name}.mcap")
        if recorded.ended:
            self.say(f"{run.name} was ended early: {recorded.ended}")
        file = f"{number:02d}-{run.name}{recorded.path.suffix}"
        keep(recorded.path, self.folder / file)
        record = Record(
            file=file,
            run=run.name,
            why=why,
            held_out=held_out,
            took_s=recorded.took_s or run.duration_s,
            ended=recorded.ended,
            tripped=recorded.tripped,
        )
        report = msgspec.structs.replace(report, records=[*report.records, record])
        self._write(report)
        return report

    def _judged(
        self, report: Report, quick: Sequence[ProgrammeRun], progress: Say
    ) -> tuple[Judgement, Proposal]:
        """The verdict so far, and what to play next if each rest is as long as the longest."""
        runs = recorded_runs(self.folder, report)
        judgement = judge_runs(self.plant, self.reference, runs, progress=progress)
        costs = self._costs_s(report)
        # Without a cause there is nothing to prove yet.
        proof_s = sum(costs[run.name] for run in quick) if judgement.verdict.causes else 0.0
        left_s = self.seconds - report.spent_s - proof_s
        return judgement, propose(judgement, costs, left_s)

    def _over_without_verdict(self, report: Report, error: TooLittleRecorded) -> BaselineError:
        """The error to raise; the report says that it is over, so that the next begins anew."""
        ended = [f"{r.run} was ended early: {r.ended}" for r in report.records if r.ended]
        why = "; ".join([error.cause, *ended])
        self._write(msgspec.structs.replace(report, why_over=why))
        action = f"mend what ended them, and repeat the command; the runs are in {self.folder}"
        return BaselineError(why, **(error.parts | {"action": action}))

    def _costs_s(self, report: Report) -> dict[str, float]:
        """Time for each run: its duration and the longest rest so far."""
        lengths = {run.name: run.duration_s for run in self.programme.runs}
        rests = [r.took_s - lengths[r.run] for r in report.records if not r.ended]
        rest = max(rests, default=REST_S)
        return {r.name: lengths[r.name] + rest for r in self.reference.runs}

    def _proved(
        self, report: Report, quick: Sequence[ProgrammeRun], judgement: Judgement
    ) -> Report:
        """The report with the quick runs played again while time is left, and the gap of the model
        on them."""
        for run in quick[sum(r.held_out for r in report.records) :]:
            if report.spent_s + self._costs_s(report)[run.name] > self.seconds:
                self.say(f"no time is left to play {run.name} for proof")
                break
            report = self._played(report, run, "for proof", held_out=True)
            if report.records[-1].trip:
                break
        runs = recorded_runs(self.folder, report, held_out=True)
        if not runs:
            return report
        try:
            pairs = pair_runs(with_places(self.plant), self.reference, runs)
        except TooLittleRecorded as error:
            self.say(f"no proof: {error.cause}")
            return report
        return msgspec.structs.replace(report, proof=gaps_on(judgement, pairs.evidence()))

    def _write(self, report: Report) -> None:
        text = msgspec.json.format(msgspec.json.encode(report), indent=1)
        write_whole(self.folder / REPORT, text)
