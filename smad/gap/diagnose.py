"""The whole pipeline: runs in, a diagnosis out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace

from firmware_protocol.nearest import instead
from smad.gap.compare.tracks import Track, follow_tracks
from smad.gap.compare.verdict import decide
from smad.gap.compare.weigh import weigh
from smad.gap.data.admission import RunSet, admit, in_common
from smad.gap.data.guards import goes_further, too_few, without_repeats
from smad.gap.errors import PlantMismatch, RunRefused
from smad.gap.fit.stages import Prepared, prepare
from smad.gap.fit.threads import repeatable
from smad.gap.model.scales import suited
from smad.gap.plant import Effect, PlantModel
from smad.gap.records import Diagnosis, Finding, LeftOutRecord, Outcome
from smad.gap.report.builder import Closing, Shell
from smad.gap.runs import GapRun, distinctly_named
from smad.gap.settings import Settings


@repeatable
def diagnose(
    runs: Sequence[GapRun],
    *,
    plant: PlantModel,
    good: Sequence[GapRun] = (),
    hold_out: Sequence[GapRun] = (),
    settings: Settings | None = None,
    candidates: Sequence[str] | None = None,
    leave_out: bool = False,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Where the plant model and the runs disagree, because of what, and how much of it goes.

    `good` are runs known to be good: they set the floor and the background, and the question
    becomes what has changed since. `hold_out` are runs to judge on; without them each run is left
    out in turn. `executor` runs the replays; by default a pool of two threads. `candidates` are the
    effects of the library that may be named; known-good runs are asked for all of them. `leave_out`
    asks once more without the first cause in the library, to see that the answer then is "unknown".
    Without `settings`, how long a row and a cell are follows from the records.
    The result depends on the runs, the plant and the settings only.
    """
    settings = settings or suited(Settings(), [*runs, *good, *hold_out], plant)
    began = time.perf_counter()
    library = _library(plant, candidates)
    progress("admission")
    given = {"fit": runs, "hold-out": hold_out, "good": good}
    order, admitted = _admitted(given, plant, settings)
    roles: dict[str, Sequence[GapRun]] = {
        role: a.admitted for role, a in zip(given, admitted, strict=True)
    }
    findings = [f for a in admitted for f in a.findings]
    findings += too_few(roles, asked_good=bool(good))
    roles["refused"] = tuple(
        r for group, a in zip(order, admitted, strict=True) for r in group if r.name in a.refused
    )
    shell = Shell(plant, settings, findings, roles, bool(good), began)
    if (refused := _none_left(order, admitted)) is not None:
        return shell.refused(*refused)
    shell = replace(shell, findings=[*findings, *goes_further(roles, plant)])
    own = nullcontext(executor) if executor else ThreadPoolExecutor(max_workers=2)
    with own as pool:
        prepared = _prepared(admitted, plant, settings, pool, progress)
        track = follow_tracks(prepared, library, progress)
        closing = Closing(prepared, track, shell, pool, progress)
        return closing.diagnosis(_left_out(prepared, track, library, progress) if leave_out else ())


def _prepared(
    admitted: Sequence[RunSet],
    plant: PlantModel,
    settings: Settings,
    executor: Executor | None,
    progress: Callable[[str], None],
) -> Prepared:
    """The refitted model, from the runs to fit, held out and known to be good."""
    fit, held, good = (a.admitted for a in admitted)
    return prepare(
        fit, plant, settings, good=good, hold_out=held, executor=executor, progress=progress
    )


def _library(plant: PlantModel, candidates: Sequence[str] | None) -> list[Effect]:
    """The effects that may be named. Raises PlantMismatch for one that the plant does not have."""
    known = {e.name for e in plant.effects}
    foreign = sorted(set(candidates or ()) - known)
    if foreign:
        raise PlantMismatch(
            "a candidate is no effect of this plant",
            value=foreign[0],
            action=instead(foreign[0], sorted(known), "name effects of the plant's library"),
        )
    return [e for e in plant.effects if candidates is None or e.name in candidates]


def _none_left(
    groups: Sequence[Sequence[GapRun]], admitted: Sequence[RunSet]
) -> tuple[str, RunSet] | None:
    """The first group of runs that were given, and of which none can be used; what it is for.

    Without it another question would be answered than was asked. Runs to fit must always be there.
    """
    for what, runs, admission in zip(("to fit", "held out", "known to be good"), groups, admitted,
                                     strict=True):  # fmt: skip
        if (runs or what == "to fit") and not admission.admitted:
            return what, admission
    return None


def _admitted(
    given: Mapping[str, Sequence[GapRun]], plant: PlantModel, settings: Settings
) -> tuple[list[list[GapRun]], list[RunSet]]:
    """Each group of runs, in an order that does not depend on the one given, and its admission.

    Runs are told apart by name, no recording is in two places, and groups have the same channels.
    """
    order = distinctly_named(
        [sorted(group, key=lambda r: (r.digest, r.name)) for group in given.values()]
    )
    once, repeats = without_repeats(dict(zip(given, order, strict=True)))
    admitted = [admit(group, plant, settings) for group in once.values()]
    with_repeats = [
        RunSet(a.admitted, (*a.findings, *_of(group, repeats)))
        for group, a in zip(order, admitted, strict=True)
    ]
    return order, in_common(with_repeats, plant)


def _of(runs: Sequence[GapRun], findings: Sequence[Finding]) -> list[Finding]:
    names = {r.name for r in runs}
    return [f for f in findings if f.run in names]


@repeatable
def ready(
    runs: Sequence[GapRun],
    *,
    plant: PlantModel,
    good: Sequence[GapRun] = (),
    hold_out: Sequence[GapRun] = (),
    settings: Settings | None = None,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Prepared:
    """As far as `diagnose` goes before effects are sought, to ask several questions from there.

    Raises RunRefused when no run can be used.
    """
    settings = settings or suited(Settings(), [*runs, *good, *hold_out], plant)
    progress("admission")
    given = {"fit": runs, "hold-out": hold_out, "good": good}
    order, admitted = _admitted(given, plant, settings)
    if (refused := _none_left(order, admitted)) is not None:
        what, admission = refused
        raise RunRefused(
            f"no run {what} can be used",
            value="; ".join(f.text for f in admission.findings if f.refuses) or "no runs",
            action="bring runs that the diagnosis admits",
        )
    return _prepared(admitted, plant, settings, executor, progress)


def _left_out(
    prepared: Prepared,
    track: Track,
    candidates: Sequence[Effect],
    progress: Callable[[str], None],
) -> list[LeftOutRecord]:
    """The verdict when the first cause is taken out of the library."""
    named = weigh(prepared, track).effects
    if not named:
        return []
    progress(f"once more without {named[0]}")
    library = [e for e in candidates if e.name != named[0]]
    numbers = weigh(prepared, follow_tracks(prepared, library, progress))
    outcome, p = decide(numbers, prepared.settings)
    names = [] if outcome is Outcome.UNKNOWN else list(numbers.effects)
    return [LeftOutRecord(named[0], outcome, names, p)]
