"""From a selection to the records: verdict in words, intervals, next experiment, figures."""

from __future__ import annotations

import dataclasses
import platform
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from importlib.metadata import version

import numpy as np

from smad.gap.compare.agreement import disagreement
from smad.gap.compare.cells import hangs_on_cells
from smad.gap.compare.localise import HeatMap, localise
from smad.gap.compare.nextexp import confused, parting_experiments
from smad.gap.compare.select import Selection
from smad.gap.compare.tracks import Track
from smad.gap.compare.verdict import Evidenced, decide, standing_out
from smad.gap.compare.weigh import weigh
from smad.gap.data.admission import Admission
from smad.gap.data.guards import FURTHER
from smad.gap.data.replay import Detail
from smad.gap.fit.candidate import Candidate, ending_at_bound
from smad.gap.fit.joint import JointFit, bootstrap, intervals, polished
from smad.gap.fit.judge import Judged, excess_by_key, predict_by_run
from smad.gap.fit.significance import DRAWS
from smad.gap.fit.stages import Prepared, open_loop
from smad.gap.plant import Array, ModelPoint, PlantModel
from smad.gap.records import (
    NAMED,
    Diagnosis,
    Finding,
    LeftOutRecord,
    Outcome,
    ValueRecord,
    Verdict,
)
from smad.gap.report.budget import Way, budget_of, way
from smad.gap.report.numbers import next_line, numbers
from smad.gap.report.plain import plain
from smad.gap.report.summary import (
    candidate_records,
    dominant_outputs,
    fitted_records,
    floor_records,
    heat_records,
    law_records,
    parameter_records,
    residual_test_records,
    run_records,
    traces,
    value_records,
    waterfall,
)
from smad.gap.runs import GapRun
from smad.gap.settings import Settings, enough_d2

LIMITS = (
    "Every figure is about this plant model and its library: a cause outside it can only be "
    "reported as unknown.",
    "Probabilities are relative to the library and to the runs given; since known-good runs they "
    "have been calibrated on simulated plants, not on a bench; without, on nothing.",
    "A refit can imitate an effect: the masked share of each candidate says how much of it these "
    "runs cannot show.",
)

_OWN_STEP = (
    "longer steps change what the plant's parameters and effects do: every replay was made at its "
    "own step, which takes longer"
)

SINGLE = (
    "There was a single run to fit, and none to judge on: every figure is of the run that was "
    "fitted to, and says how well it can be described, not what would be predicted."
)


@dataclasses.dataclass(frozen=True)
class Shell:
    """What every diagnosis carries, whatever it found."""

    plant: PlantModel
    settings: Settings
    findings: Sequence[Finding]
    roles: dict[str, Sequence[GapRun]]
    since_good: bool
    began: float

    @property
    def unseen(self) -> bool:
        """Whether the figures are of runs that were not fitted to."""
        return bool(self.roles["hold-out"]) or len(self.roles["fit"]) != 1

    @property
    def judged_on(self) -> str:
        """What the figures are of."""
        if self.roles["hold-out"]:
            return "runs held out"
        return "each run left out in turn" if self.unseen else "the run it was fitted to"

    def record(self, verdict: Verdict, **parts: object) -> Diagnosis:
        return Diagnosis(
            plant=self.plant.name,
            plant_version=self.plant.version,
            versions={
                "smad": version("smad"),
                "numpy": np.__version__,
                "scipy": version("scipy"),
                "python": platform.python_version(),
            },
            settings=dataclasses.asdict(self.settings),
            question="what has changed since the known-good runs"
            if self.since_good
            else "what differs between model and bench",
            judged_on=self.judged_on,
            verdict=verdict,
            runs=run_records(self.roles),
            findings=list(self.findings),
            limits=self._limits(),
            seconds=time.perf_counter() - self.began,
            **parts,  # type: ignore[arg-type]
        )

    def _limits(self) -> list[str]:
        times = (
            f"Samples were averaged over {self.settings.period_s:g} s, and runs judged in blocks "
            f"of {self.settings.block_s:g} s: what is quicker than the former is not seen."
        )
        return [*LIMITS, times, *([] if self.unseen else [SINGLE])]

    def refused(self, what: str, admission: Admission) -> Diagnosis:
        """No run of those `what` could be used: the verdict names why, and nothing else."""
        kinds = list(dict.fromkeys(f.kind for f in admission.findings if f.refuses))
        starved = set(kinds) <= {"too short", "no excitation"}
        outcome = Outcome.NO_EXCITATION if starved else Outcome.REFUSED
        reasons = "; ".join(f"{f.run}: {f.text}" for f in admission.findings if f.refuses)
        why = ", ".join(kinds) or "none was given"
        text = f"No run {what} can be used ({why}). {reasons}".strip()
        plain = text.partition(". ")[0].rstrip(".") + "."
        return self.record(Verdict(outcome, text, plain))


@dataclasses.dataclass(frozen=True)
class Place:
    """Where a gap lies, and the heat map of the refit that shows it."""

    sub_model: str
    regimes: list[str]
    channels: list[str]
    refit_heat: HeatMap

    @property
    def text(self) -> str:
        shown = ", ".join(self.channels[:4]) or "no single channel"
        return f"{self.sub_model}, in {' and '.join(self.regimes) or 'all regimes'}: {shown}"


def _heat(judged: Judged) -> HeatMap:
    """Of a held-out prediction."""
    return localise(judged.bench, judged.predicted)


class Closing:
    """From a selection to the records: worth, verdict, intervals, next experiment."""

    def __init__(
        self,
        prepared: Prepared,
        track: Track,
        shell: Shell,
        executor: Executor,
        progress: Callable[[str], None],
    ) -> None:
        self.prepared, self.track, self.shell = prepared, track, shell
        self.selection: Selection = track.selection
        self.executor, self.progress = executor, progress

    def diagnosis(self, left_out: Sequence[LeftOutRecord] = ()) -> Diagnosis:
        """All records of the diagnosis; `left_out` are verdicts with a cause withheld."""
        prepared, selection, settings = self.prepared, self.selection, self.prepared.settings
        best = selection.best
        self.progress("judging")
        own_step = _OWN_STEP if prepared.problem.evidence.detail is Detail.FINE else ""
        told = {
            "runs disagree": disagreement(best.fit),
            "own step": own_step,
            "cells": hangs_on_cells(selection, tied=self.track.tied),
        }
        more = [Finding("all runs", k, text, refuses=False) for k, text in told.items() if text]
        shell = dataclasses.replace(self.shell, findings=[*self.shell.findings, *more])
        weighed = weigh(prepared, self.track)
        outcome, p = decide(weighed, settings)
        first = weighed.effects[0] if weighed.effects else ""
        self.progress("intervals")
        final = self._final(outcome in NAMED)
        values = self._values(final) if outcome in NAMED else []
        bounded = ending_at_bound(final.fit) if outcome in NAMED else []
        if bounded:
            outcome, p = Outcome.UNKNOWN, settings.unsure_right
            final, values = self._final(False), []
        named = outcome in NAMED
        took = way(prepared, self._chain(), selection.base.judged)
        budget = budget_of(prepared, took, selection.base.judged, named=named)
        place = self._place(outcome, weighed)
        question = confused(prepared, self.track, outcome, weighed.groups)
        if question is not None:
            self.progress("next experiment")
        experiments = [] if question is None else parting_experiments(prepared, question)
        lines = numbers(
            outcome, weighed, prepared.plant.effects, p=p, where=place.text, values=values,
            unseen=self.shell.unseen,
        )  # fmt: skip
        model, holds = self._model(outcome, final, took)
        opened, open_rows, shown = self._open_loop(named)
        open_question = outcome is Outcome.UNKNOWN or weighed.imitated
        lines += [
            next_line(experiments, enough_d2(settings.odds), settled=not open_question),
            ("model to apply", holds),
        ]
        effects = list(weighed.effects) if named else []
        group = [n for e in effects[:1] for n in weighed.groups.get(e, ())]
        answer = plain(
            outcome,
            titles={e.name: e.title for e in prepared.plant.effects},
            effects=effects,
            group=group,
            values=values,
            budget=budget,
            bounded=bounded,
            since_good=shell.since_good,
            further=any(f.kind == FURTHER for f in shell.findings),
        )
        whole, bench = weighed.whole, best.judged.bench
        low, high = whole.interval
        verdict = Verdict(
            outcome=outcome,
            text="\n".join(f"{name}: {what}" for name, what in lines),
            plain=answer,
            probability=p,
            effects=effects,
            group=group,
            sub_model=place.sub_model,
            regimes=place.regimes,
            probabilities=selection.probability.get(first, {}),
            gap_raw=weighed.gap_raw,
            gap_refit=whole.gap_refit,
            gap_final=whole.gap_final,
            shrink=whole.shrink if named else 0.0,
            shrink_low=low,
            shrink_high=high,
            ceiling=whole.ceiling,
            open_loop=opened,
            imitated=named and weighed.imitated,
            instead=list(weighed.instead),
            gap_instead=weighed.gap_instead if weighed.instead else None,
            bounded=bounded,
        )
        return shell.record(
            verdict,
            missing=sorted(set(prepared.problem.evidence.missing)),
            floors=floor_records(prepared),
            steps=[list(c.names) for c in self._chain()],
            waterfall=waterfall("local", bench, self._steps(), prepared.plant) + open_rows,
            heat=heat_records(_heat(prepared.raw), place.refit_heat, _heat(best.judged)),
            windows=place.refit_heat.windows,
            candidates=candidate_records(self.track.asked, selection.probability.get(first, {})),
            values=values,
            parameters=parameter_records(
                prepared, final, bootstrap(final.fit, DRAWS, settings.seed)
            ),
            laws=law_records(prepared, final),
            residual_tests=residual_test_records(prepared, best),
            experiments=experiments,
            traces=shown,
            fitted=fitted_records(self.track.asked, selection),
            places=selection.probability,
            left_out=list(left_out),
            model={
                "theta": dict(model.theta),
                "effects": {k: dict(v) for k, v in model.effects.items()},
            },
            budget=budget,
        )

    def _final(self, named: bool) -> Candidate:
        """The model that the verdict stands for: the refit, or the fit of the cause, polished."""
        if not named:
            return self.selection.base
        best = self.selection.best
        # What coarser replays cost was learnt where the effect was not.
        end = polished(best.fit.recalibrated())
        return dataclasses.replace(best, joint=JointFit(end, best.joint.rivals))

    def _model(self, outcome: Outcome, final: Candidate, took: Way) -> tuple[ModelPoint, str]:
        """The model to apply, and in words all that it holds.

        Parameters that no better prediction asks for stay as they were.
        """
        prepared, point = self.prepared, final.fit.point
        named = set(final.names) if outcome in NAMED else set()
        quiet = outcome in (Outcome.NO_GAP, Outcome.NO_EXCITATION)
        moved = not quiet and (not named or took.parameters)
        if not moved:
            own = {k: dict(v) for k, v in point.effects.items() if k in named}
            point = ModelPoint(prepared.centre, {**prepared.fixed, **own})
        laws = sorted(set(point.effects) - named)
        what = [", ".join(sorted(named)) or "no effect"]
        if laws:
            what.append(f"the laws of the known-good runs ({', '.join(laws)})")
        as_good = "of the known-good runs" if prepared.background is not None else "as they were"
        what.append("the refitted parameters" if moved else f"the parameters {as_good}")
        return point, f"{', '.join(what[:-1])} and {what[-1]}"

    def _values(self, final: Candidate) -> list[ValueRecord]:
        """Strengths and shapes of the causes with their intervals."""
        prepared, settings = self.prepared, self.prepared.settings
        # How far the forms of laws differ has been seen on benches with known-good runs only.
        form = 0.0 if prepared.background is None else settings.form_share
        return value_records(intervals(final.joint, settings.seed, form), prepared.fixed)

    def _place(self, outcome: Outcome, numbers: Evidenced) -> Place:
        """Where the gap lies: on the cause's own outputs, or on those that stand out."""
        prepared, judged = self.prepared, self.selection.base.judged
        heat = _heat(judged)
        outputs = dominant_outputs(excess_by_key(judged.bench, judged.squares()))
        sub_model = heat.worst_sub_model
        if outcome in NAMED:
            first = next(e for e in prepared.plant.effects if e.name == numbers.effects[0])
            sub_model = first.sub_model
            touched = numbers.touched.keys
            outputs = [k for k in touched if k in outputs] or list(touched)
        elif output := standing_out(numbers, prepared.settings):
            outputs = [output]
            sub_model = prepared.outputs[output].sub_model
        part = prepared.outputs[outputs[0]].sub_model if outputs else sub_model
        channels = list(dict.fromkeys(prepared.outputs[k].channel for k in outputs))
        return Place(sub_model, heat.worst_regimes(part), channels, heat)

    def _steps(self) -> list[Array]:
        return [
            self.prepared.raw.predicted,
            self.selection.base.judged.predicted,
            *[c.judged.predicted for c in self._chain()],
        ]

    def _chain(self) -> list[Candidate]:
        """The way to the best model: accepted steps that are part of it, then itself."""
        s = self.selection
        if not s.best.names:
            return []
        return [c for c in s.steps if set(c.names) < set(s.best.names)] + [s.best]

    def _open_loop(self, named: bool) -> tuple[list[float], list[object], list[object]]:
        s, prepared = self.selection, self.prepared
        problem = open_loop(prepared, self.executor)
        ev = problem.evidence
        chain = self._chain() if named else []
        predictions = [ev.predict([ModelPoint(prepared.centre, prepared.fixed)])[0]]
        for c in (s.base, *chain):
            if prepared.hold is None:
                predictions.append(predict_by_run(problem, c.judged.points, c.fit.point))
            else:
                predictions.append(ev.predict([c.fit.point])[0])
        rows = waterfall("open loop", problem, predictions, prepared.plant)
        total = rows[-1]
        shown = traces("open loop", problem, predictions[1], predictions[-1], prepared.plant)
        return [total.raw, total.refit, *total.effects], list(rows), list(shown)
