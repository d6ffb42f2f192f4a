"""The gap of new runs with the nominal and an improved model: only drifts of a run are fitted."""

from collections.abc import Callable, Sequence

from smad.diagnosis.answer import signal_gaps
from smad.diagnosis.data.admission import admit, row_of_admitted_s
from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.errors import RunRefused
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import ModelPoint, PlantModel, nominal_point
from smad.diagnosis.rivals.evidence import recorded_evidence
from smad.diagnosis.rivals.rival import cannot_replay, question_of
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import Finding, SignalGap
from smad.progress import Say, silent


def verified(
    plant: PlantModel,
    runs: Sequence[GapRun],
    model: ModelPoint,
    *,
    found: Callable[[Sequence[Finding]], None] | None = None,
    progress: Say = silent,
) -> list[SignalGap]:
    """RMS of every channel with the nominal model (`raw`) and with `model` (`causes`).

    The last row is over all channels, in floors. Rows and floors are as in a diagnosis of these
    runs. `found` is given the findings on runs: what was refused, doubted or left out. Raises
    RunRefused when no run is admitted, GapError where a model cannot replay them.
    """
    period_s = row_of_admitted_s(runs, plant)
    admission = admit(runs, plant, period_s, progress=progress)
    if not admission.admitted:
        # Each text says what to do about its run, and an error shortens a value.
        why = "; ".join(f"{f.run}: {f.text}" for f in admission.findings if f.refuses)
        raise RunRefused(f"no run can be used: {why}", action="correct that, or give other runs")
    if found is not None:
        found(admission.findings)
    progress("replaying the runs without and with the model")
    floors = estimate_floors(admission.admitted, plant, period_s)
    placed = with_places(plant)
    start = nominal_point(placed)
    evidence = recorded_evidence(placed, admission.admitted, floors, period_s, start)
    question = question_of(placed, start, evidence, effects=(), say=silent)
    before, after = (question.of_point(x) for x in (start, model))
    if before is None or after is None:
        raise cannot_replay(question)
    return signal_gaps(question, (before, before, after))
