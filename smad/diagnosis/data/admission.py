"""Which runs can be used, up to where, and what is wrong with the others.

The one place where recordings become runs of the diagnosis. In this order: values that are no
readings are removed (`columns`), the run ends at its first hole, its length is checked, the plant
must fulfil its contract (`contract`), and the nominal model is compared (`opinions`). Each result
is a finding, which the JSON, the terminal and the page share. An admitted run says where its
replays start (`starts`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.counted import listed
from smad.diagnosis.data.columns import (
    EVEN,
    Note,
    filled,
    jitter,
    lost_share,
    readable,
    up_to_first_hole,
    with_lost,
)
from smad.diagnosis.data.contract import checked_replay, require_contract
from smad.diagnosis.data.doubts import doubted_columns
from smad.diagnosis.data.grid import LEAST_PERIODS, MOST_ROWS, row_length_s
from smad.diagnosis.data.guards import without_repeats
from smad.diagnosis.data.opinions import compare, used
from smad.diagnosis.data.rows import MOSTLY, binned, steps_in_gaps
from smad.diagnosis.data.starts import starting_as_read, unusable_starts
from smad.diagnosis.plant import PlantModel, traits_of
from smad.diagnosis.runs import GapRun, distinctly_named
from smad.diagnosis.verdict import COLUMN_DOUBTED, Finding
from smad.progress import Say, silent
from smad.records.readings import doubted_step

ROUNDED = 0.01
"""Share of a sample by which equal lengths may differ through rounding."""
_FEW = 0.005
"""Share of the samples that may be lost without a finding."""
_SHOWN = 0.0005
"""Share of the samples below which 0.0 % would be printed."""
_NAMED = 4
"""Most columns that a finding names."""


@dataclass(frozen=True)
class RunSet:
    """Runs that were given, those that are admitted (bad channels taken out), every finding."""

    given: tuple[GapRun, ...]
    admitted: tuple[GapRun, ...]
    findings: tuple[Finding, ...]

    @property
    def refused(self) -> list[str]:
        """Names of the runs that were refused, in order."""
        return list(dict.fromkeys(f.run for f in self.findings if f.refuses))


def admit(
    runs: Sequence[GapRun], plant: PlantModel, period_s: float, progress: Say = silent
) -> RunSet:
    """Check every run. A bad channel is removed from its run; a bad run is refused.

    The plant's contract is checked with the first run that can be replayed. Raises PlantMismatch
    for a plant that breaks it.
    """
    admitted, findings = list[GapRun](), list[Finding]()
    contract_checked = False
    for given in runs:
        progress(f"admission: {given.name}")
        of_run: list[Finding] = []
        run = _usable(given, plant, period_s, of_run)
        if not _refused(of_run):
            if not contract_checked:
                require_contract(plant, run)
                contract_checked = True
            run = _compared(run, given, plant, period_s, of_run)
        if not _refused(of_run):
            run = starting_as_read(plant, run)
            of_run += [Finding(run.name, "start", t, False) for t in unusable_starts(plant, run)]
            admitted.append(run)
        findings += of_run
    return RunSet(tuple(runs), tuple(admitted), tuple(findings))


def row_of_admitted_s(runs: Sequence[GapRun], plant: PlantModel) -> float:
    """Length of a row for the runs as they will be admitted, up to their first hole.

    Shorter runs need shorter rows, and shorter rows make more gaps count as holes: so both are
    determined in turn until the row gets no shorter.
    """
    read = [readable(run, plant.inputs, plant.channels, _quiet) for run in runs]

    def cut(row_s: float) -> list[GapRun]:
        return [up_to_first_hole(run, row_s, _quiet) for run in read]

    row_s = row_length_s(read, plant)
    while (next_s := row_length_s(cut(row_s), plant)) < row_s:
        row_s = next_s
    lengths = [[run.duration_s for run in cut(s)] for s in (row_s, next_s)]
    return next_s if lengths[0] == lengths[1] else row_s


def _quiet(kind: str, text: str, *, refuses: bool = False) -> None:
    """Ignore a finding: it is noted when the runs are admitted."""


def admit_groups(
    groups: Mapping[str, Sequence[GapRun]],
    plant: PlantModel,
    period_s: float,
    progress: Say = silent,
) -> dict[str, RunSet]:
    """Each group of runs (fit, hold-out, good), in an order that does not depend on the one given.

    Names become distinct, a recording is in one group only, and groups keep the channels that all
    of them have: what one group was fitted on could not be judged on a group without it. A run that
    loses its last channel is refused.
    """
    order = [sorted(group, key=lambda r: (r.digest, r.name)) for group in groups.values()]
    named = dict(zip(groups, distinctly_named(order), strict=True))
    once, repeats = without_repeats(named)
    every = admit([run for group in once.values() for run in group], plant, period_s, progress)
    sets = {}
    for role, group in named.items():
        names = {run.name for run in group}
        admitted = tuple(run for run in every.admitted if run.name in names)
        findings = (*(f for f in every.findings if f.run in names), *repeats[role])
        sets[role] = RunSet(tuple(group), admitted, findings)
    having = [{c for r in a.admitted for c in r.outputs} for a in sets.values() if a.admitted]
    common = set.intersection(*having) if having else set()
    return {role: _only(a, common) for role, a in sets.items()}


def _only(group: RunSet, channels: set[str]) -> RunSet:
    admitted, findings = [], list(group.findings)
    for run in group.admitted:
        outputs = {k: v for k, v in run.outputs.items() if k in channels}
        for name in (n for n in run.outputs if n not in channels):
            text = f"{name} is missing in another group of runs, so it is not compared"
            findings.append(Finding(run.name, "channel not shared", text, refuses=False))
        if outputs:
            admitted.append(replace(run, outputs=outputs))
        else:
            text = "none of its channels was recorded in all groups: runs to fit, held out and good"
            findings.append(Finding(run.name, "no channel", text, refuses=True))
    return RunSet(group.given, tuple(admitted), tuple(findings))


def _refused(findings: Sequence[Finding]) -> bool:
    return any(f.refuses for f in findings)


def _noting(run: GapRun, findings: list[Finding]) -> Note:
    """What adds findings about a run to a list."""

    def say(kind: str, text: str, *, refuses: bool = False) -> None:
        findings.append(Finding(run.name, kind, text, refuses))

    return say


def _usable(given: GapRun, plant: PlantModel, period_s: float, findings: list[Finding]) -> GapRun:
    """The run up to its first hole, with what can be used of its columns; no model is asked."""
    say = _noting(given, findings)
    if given.cut_short:
        say("truncated", f"the log is cut short; {given.duration_s:.1f} s were read up to the cut")
    for note in given.notes:
        say("note", note)
    lacking = [s.name for s in plant.inputs if s.name not in given.inputs]
    if lacking:
        text = f"inputs are missing: {', '.join(lacking)}; map the columns that have them"
        say("input missing", text, refuses=True)
    if len(given.t_s) and not (np.diff(given.t_s) > 0).all():
        say("time runs back", "the time axis is not increasing", refuses=True)
    run = readable(given, plant.inputs, plant.channels, say, traits_of(plant).longest_step_s)
    if _refused(findings):
        return run
    cut = up_to_first_hole(run, period_s, say)
    run = filled(with_lost(cut))
    _require_length(run, given, plant, period_s, say)
    if not _refused(findings):
        _require_channel(run, given, plant, say)
    if not _refused(findings):
        _require_rows(run, cut, plant, period_s, say)
    return run


def _compared(
    run: GapRun, given: GapRun, plant: PlantModel, period_s: float, findings: list[Finding]
) -> GapRun:
    """The run with the channels and samples that the nominal model does not rule out."""
    say = _noting(given, findings)
    predicted = checked_replay(plant, run)
    run = used(run, predicted, plant, say=say)
    if _refused(findings):
        return run
    # A replay may start from the measured channels.
    if run.outputs.keys() != given.outputs.keys():
        predicted = checked_replay(plant, run)
    compare(run, predicted, plant, period_s, say=say)
    for text in doubted_columns(plant, run, predicted):
        say(COLUMN_DOUBTED, text)
    return run


def _require_length(
    run: GapRun, given: GapRun, plant: PlantModel, period_s: float, say: Note
) -> None:
    """Refuse a run that is too short or sampled too slowly; note uneven times."""
    shortest_s = traits_of(plant).shortest_s
    least_s = max(LEAST_PERIODS * period_s, shortest_s)
    # Rows are whole samples: a rounded time stamp is no missing sample.
    if run.duration_s + run.dt_s < least_s - ROUNDED * run.dt_s:
        cut = "" if run.duration_s == given.duration_s else ", up to where it can be used"
        # Runs too short for the plant had no say in the length of a row: giving fewer beside such
        # a run would not help it.
        if run.duration_s + run.dt_s < shortest_s and period_s > 1.5 * run.dt_s:
            least_s = shortest_s
        by_rows = least_s > shortest_s
        why = f": {LEAST_PERIODS} rows of {period_s:g} s" if by_rows else ""
        if by_rows and period_s > 1.5 * run.dt_s:
            why += f", so that all runs have at most {MOST_ROWS}; give fewer beside it"
        text = f"{run.duration_s:.1f} s long{cut}; at least {least_s:g} s are needed{why}"
        say("too short", text, refuses=True)
        return
    if text := doubted_step(run.t_s, 5 * period_s):
        say("time step", text, refuses=True)
    elif (off := jitter(run.t_s)) > EVEN:
        text = (
            f"steps of its time differ from {run.dt_s:.6g} s by {off:.0%} (median), more than "
            f"{EVEN:.0%}: if samples were taken evenly, and only stamped late, give even times"
        )
        say("time uneven", text)


def _require_channel(run: GapRun, given: GapRun, plant: PlantModel, say: Note) -> None:
    """Refuse a run without a reading of any channel of the plant."""
    names = [c.name for c in plant.channels]
    if any(n in run.outputs and np.isfinite(run.outputs[n]).any() for n in names):
        return
    absent = [n for n in names if n not in given.outputs]
    few = [n for n in names if n in given.outputs]
    why = [f"{listed(absent, _NAMED)} not recorded"] * bool(absent)
    why += [f"{listed(few, _NAMED)} with too few readings"] * bool(few)
    others = [n for n in given.outputs if n not in names]
    instead = f" (the run has {listed(others, _NAMED)})" if others else ""
    say(
        "no channel",
        f"{', '.join(why)}{instead}, so no channel is left to compare: record one, give its column "
        "the channel's name, or leave the run out",
        refuses=True,
    )


def _require_rows(run: GapRun, cut: GapRun, plant: PlantModel, period_s: float, say: Note) -> None:
    """Refuse a run with too few usable rows; note lost samples of others.

    `cut`: the run with NaN where there is no reading, and without the samples that were lost.
    """
    lost, marked = lost_share(cut.t_s), 1.0 - float(np.mean(filled(cut).good))
    lacking = [n for n, c in {**cut.inputs, **cut.outputs}.items() if not np.isfinite(c).all()]
    of_which = f" (of {listed(lacking, _NAMED)})" if lacking else ""
    shares = {"lost": lost, f"marked bad or no readings{of_which}": marked}
    shown = {how: share for how, share in shares.items() if share > _SHOWN}
    said = [f"{share:.1%} of the samples are {how}" for how, share in shown.items()]
    stepped = steps_in_gaps(run, plant.inputs).items()
    rows = int(run.duration_s / period_s)
    usable = binned(run, rows, plant, run.begins_s, period_s, partly=True).valid.any(axis=1)
    if (whole := int(usable.sum())) < LEAST_PERIODS:
        why = " and ".join(said) or "samples are lost, or their times uneven"
        text = (
            f"{why}: {whole} of {rows} rows of {period_s:g} s have {MOSTLY:.0%} of their samples; "
            f"at least {LEAST_PERIODS} must: find out what loses them, or record longer runs"
        )
        say("samples lost", text, refuses=True)
    elif lost + marked > _FEW or (said and stepped):
        steps = [f"{n} steps meanwhile, first after {run.t_s[b[0]]:.6g} s" for n, (b, _) in stepped]
        say("samples lost", "; ".join([f"{' and '.join(said)}, and not used", *steps]))
