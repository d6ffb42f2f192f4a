"""From a selection to the records: verdict in words, intervals, next experiment, figures."""

from __future__ import annotations

import dataclasses
import platform
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import cached_property
from importlib.metadata import version

import numpy as np

from smad.gap.compare.cells import hangs_on_cells
from smad.gap.compare.contradiction import agreement_of
from smad.gap.compare.localise import HeatMap, localise
from smad.gap.compare.nextexp import confused, parting_experiments
from smad.gap.compare.select import Selection
from smad.gap.compare.tracks import Track
from smad.gap.compare.verdict import Evidenced, decide, standing_out
from smad.gap.compare.weigh import weigh
from smad.gap.data.admission import RunSet
from smad.gap.data.guards import FURTHER
from smad.gap.data.replay import Detail
from smad.gap.fit.hypothesis import Hypothesis, ending_at_bound
from smad.gap.fit.joint import JointFit, intervals, polished, posterior
from smad.gap.fit.judge import excess_by_key, predict_by_run
from smad.gap.fit.resample import DRAWS
from smad.gap.fit.stages import Prepared, open_loop
from smad.gap.plant import ModelPoint, PlantModel
from smad.gap.records import (
    NAMED,
    Budget,
    Diagnosis,
    ExperimentRecord,
    Finding,
    LeftOutRecord,
    Outcome,
    RunAgreement,
    Trace,
    ValueRecord,
    Verdict,
    WaterfallRow,
)
from smad.gap.report import summary
from smad.gap.report.budget import Way, budget_of, point_with, way
from smad.gap.report.numbers import next_line, numbers
from smad.gap.report.plain import plain
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
            runs=summary.run_records(self.roles),
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

    def refused(self, what: str, admission: RunSet) -> Diagnosis:
        """No run of those `what` could be used: the verdict names why, and nothing else."""
        refusals = [f for f in admission.findings if f.refuses]
        kinds = dict.fromkeys(f.kind for f in refusals)
        starved = bool(kinds) and kinds.keys() <= {"too short", "no excitation"}
        outcome = Outcome.NO_EXCITATION if starved else Outcome.REFUSED
        reasons = "; ".join(f"{f.run}: {f.text}" for f in refusals)
        why = ", ".join(kinds) or "none was given"
        text = f"No run {what} can be used ({why}). {reasons}".strip()
        plain = text.partition(". ")[0].rstrip(".") + "."
        return self.record(Verdict(outcome, text, plain))


@dataclasses.dataclass(frozen=True)
class Answer:
    """The outcome and its probability, and what they rest on.

    `final` is the model that it stands for: the refit, or the fit of the causes, whose parameters
    are `values`. `bounded` are causes that are not named because their strength ran into a bound.
    """

    outcome: Outcome
    probability: float
    weighed: Evidenced
    final: Hypothesis
    values: Sequence[ValueRecord] = ()
    bounded: Sequence[str] = ()

    @property
    def named(self) -> bool:
        return self.outcome in NAMED

    @property
    def effects(self) -> list[str]:
        """The causes that are named, in order of importance."""
        return list(self.weighed.effects) if self.named else []

    @property
    def group(self) -> list[str]:
        """What the first of them cannot be told from."""
        return [n for e in self.effects[:1] for n in self.weighed.groups.get(e, ())]


@dataclasses.dataclass(frozen=True)
class Place:
    """Where a gap lies."""

    sub_model: str
    regimes: list[str]
    channels: list[str]

    @property
    def text(self) -> str:
        shown = ", ".join(self.channels[:4]) or "no single channel"
        return f"{self.sub_model}, in {' and '.join(self.regimes) or 'all regimes'}: {shown}"


@dataclasses.dataclass(frozen=True)
class Closing:
    """From a selection to the records: worth, verdict, intervals, next experiment."""

    prepared: Prepared
    track: Track
    shell: Shell
    executor: Executor
    progress: Callable[[str], None]

    @property
    def selection(self) -> Selection:
        return self.track.selection

    @cached_property
    def chain(self) -> list[Hypothesis]:
        """The way to the best model: accepted steps that are part of it, then itself."""
        s = self.selection
        if not s.best.names:
            return []
        return [c for c in s.steps if set(c.names) < set(s.best.names)] + [s.best]

    def diagnosis(self, left_out: Sequence[LeftOutRecord] = ()) -> Diagnosis:
        """All records of the diagnosis; `left_out` are verdicts with a cause withheld."""
        prepared, selection = self.prepared, self.selection
        refit, best = selection.base.judged, selection.best.judged
        self.progress("judging")
        shell = dataclasses.replace(self.shell, findings=[*self.shell.findings, *self._findings()])
        answer = self._answer()
        took = way(prepared, self.chain, refit)
        budget = budget_of(prepared, took, refit, named=answer.named)
        heat = [localise(j.bench, j.predicted) for j in (prepared.raw, refit, best)]
        place = self._place(answer, heat[1])
        experiments = self._experiments(answer)
        model, holds = self._model(answer, took)
        text = self._text(answer, place, experiments, holds)
        opened, shown = self._open_loop(answer)
        verdict = self._verdict(answer, place, text, self._plain(answer, budget), opened[-1])
        predictions = [j.predicted for j in (prepared.raw, refit, *(c.judged for c in self.chain))]
        draws = posterior(answer.final.fit, DRAWS, prepared.settings.seed)
        return shell.record(
            verdict,
            missing=sorted(set(prepared.problem.dataset.missing)),
            floors=summary.floor_records(prepared),
            steps=[list(c.names) for c in self.chain],
            waterfall=summary.waterfall("local", best.bench, predictions, prepared.plant) + opened,
            heat=summary.heat_records(*heat),
            windows=heat[1].windows,
            candidates=summary.candidate_records(self.track.asked, verdict.probabilities),
            values=list(answer.values),
            parameters=summary.parameter_records(prepared, answer.final, draws),
            laws=summary.law_records(prepared, answer.final),
            residual_tests=summary.residual_test_records(prepared, selection.best),
            experiments=experiments,
            traces=shown,
            fitted=summary.fitted_records(self.track.asked, selection),
            places=selection.probability,
            left_out=list(left_out),
            model={
                "theta": dict(model.theta),
                "effects": {name: dict(values) for name, values in model.effects.items()},
                "covariance": summary.covariance_record(answer.final, model, draws),
            },
            budget=budget,
            agreement=self.agreement,
        )

    @cached_property
    def agreement(self) -> list[RunAgreement]:
        """Each run to fit by itself, before it is pooled with the others."""
        asked = self.track.asked
        models = [asked.base, asked.best, *asked.tried, self.selection.best]
        fits = list({id(m.fit): m.fit for m in models}.values())
        return agreement_of(fits, self.selection.best.fit, self.prepared.raw.left_out)

    def _findings(self) -> list[Finding]:
        """What is to be known of all runs together."""
        fine = self.prepared.problem.dataset.detail is Detail.FINE
        told = {
            "own step": _OWN_STEP if fine else "",
            "cells": hangs_on_cells(self.selection, tied=self.track.tied),
        }
        return [Finding("all runs", k, text, refuses=False) for k, text in told.items() if text]

    def _answer(self) -> Answer:
        """The verdict, and the model that it stands for with the values of its causes."""
        prepared, settings = self.prepared, self.prepared.settings
        base, best = self.selection.base, self.selection.best
        weighed = weigh(prepared, self.track)
        outcome, p = decide(weighed, settings)
        if any(r.contradicts for r in self.agreement):
            return Answer(Outcome.CONTRADICTING, 1.0, weighed, base)
        self.progress("intervals")
        if outcome not in NAMED:
            return Answer(outcome, p, weighed, base)
        # What coarser replays cost was learnt where the effect was not.
        joint = JointFit(polished(best.fit.recalibrated()), best.joint.rivals)
        if bounded := ending_at_bound(joint.fit):
            return Answer(Outcome.UNKNOWN, settings.unsure_right, weighed, base, bounded=bounded)
        # How far the forms of laws differ has been seen on benches with known-good runs only.
        form = 0.0 if prepared.reference is None else settings.form_share
        values = summary.value_records(intervals(joint, settings.seed, form), prepared.fixed)
        return Answer(outcome, p, weighed, dataclasses.replace(best, joint=joint), values)

    def _place(self, answer: Answer, heat: HeatMap) -> Place:
        """Where the gap lies: on the cause's own outputs, or on those that stand out."""
        prepared, weighed, judged = self.prepared, answer.weighed, self.selection.base.judged
        outputs = summary.dominant_outputs(excess_by_key(judged.bench, judged.squares()))
        sub_model = heat.worst_sub_model
        if answer.named:
            first = next(e for e in prepared.plant.effects if e.name == answer.effects[0])
            sub_model = first.sub_model
            touched = weighed.touched.keys
            outputs = [k for k in touched if k in outputs] or list(touched)
        elif output := standing_out(weighed, prepared.settings):
            outputs = [output]
            sub_model = prepared.outputs[output].sub_model
        part = prepared.outputs[outputs[0]].sub_model if outputs else sub_model
        channels = list(dict.fromkeys(prepared.outputs[k].channel for k in outputs))
        return Place(sub_model, heat.worst_regimes(part), channels)

    def _experiments(self, answer: Answer) -> list[ExperimentRecord]:
        """Those that would part what the verdict leaves confused, best first."""
        if answer.outcome is Outcome.CONTRADICTING:
            return []
        question = confused(self.prepared, self.track, answer.outcome, answer.weighed.groups)
        if question is None:
            return []
        self.progress("next experiment")
        return parting_experiments(self.prepared, question)

    def _model(self, answer: Answer, took: Way) -> tuple[ModelPoint, str]:
        """The model to apply, and in words all that it holds.

        Parameters that no better prediction asks for stay as they were.
        """
        prepared, final = self.prepared, answer.final
        named = sorted(final.names) if answer.named else []
        quiet = answer.outcome in (Outcome.NO_GAP, Outcome.NO_EXCITATION, Outcome.CONTRADICTING)
        moved = not quiet and (not named or took.parameters)
        point = final.fit.point if moved else point_with(prepared, prepared.centre, final, named)
        what = [", ".join(named) or "no effect"]
        if laws := sorted(set(point.effects) - set(named)):
            what.append(f"the laws of the known-good runs ({', '.join(laws)})")
        as_good = "of the known-good runs" if prepared.reference is not None else "as they were"
        what.append("the refitted parameters" if moved else f"the parameters {as_good}")
        return point, f"{', '.join(what[:-1])} and {what[-1]}"

    def _open_loop(self, answer: Answer) -> tuple[list[WaterfallRow], list[Trace]]:
        """Gaps and courses of the whole simulator; effects count in it once they are named."""
        prepared, plant = self.prepared, self.prepared.plant
        problem = open_loop(prepared, self.executor)
        predict = problem.dataset.predict
        predictions = [predict([ModelPoint(prepared.centre, prepared.fixed)])[0]]
        for c in (self.selection.base, *(self.chain if answer.named else ())):
            if prepared.hold is None:
                predictions.append(predict_by_run(problem, c.judged.points, c.fit.point))
            else:
                predictions.append(predict([c.fit.point])[0])
        rows = summary.waterfall("open loop", problem, predictions, plant)
        shown = summary.traces("open loop", problem, predictions[1], predictions[-1], plant)
        return rows, shown

    def _text(
        self, answer: Answer, place: Place, experiments: Sequence[ExperimentRecord], holds: str
    ) -> str:
        """The numbers behind the verdict, a line each; `holds` says what is in the model."""
        outcome, weighed = answer.outcome, answer.weighed
        lines = numbers(
            outcome, weighed, self.prepared.plant.effects, p=answer.probability, where=place.text,
            values=answer.values, unseen=self.shell.unseen,
        )  # fmt: skip
        wanted = enough_d2(self.prepared.settings.odds)
        settled = not (outcome is Outcome.UNKNOWN or weighed.imitated)
        lines += [next_line(experiments, wanted, settled=settled), ("model to apply", holds)]
        return "\n".join(f"{name}: {what}" for name, what in lines)

    def _plain(self, answer: Answer, budget: Budget) -> str:
        """The answer in a sentence or two."""
        return plain(
            answer.outcome,
            titles={e.name: e.title for e in self.prepared.plant.effects},
            effects=answer.effects,
            group=answer.group,
            values=answer.values,
            budget=budget,
            bounded=answer.bounded,
            since_good=self.shell.since_good,
            agreement=self.agreement,
            further=any(f.kind == FURTHER for f in self.shell.findings),
        )

    def _verdict(
        self, answer: Answer, place: Place, text: str, said: str, opened: WaterfallRow
    ) -> Verdict:
        """The verdict with its numbers; `opened` are those of the whole simulator."""
        weighed, whole = answer.weighed, answer.weighed.whole
        low, high = whole.interval
        first = weighed.effects[0] if weighed.effects else ""
        return Verdict(
            outcome=answer.outcome,
            text=text,
            plain=said,
            probability=answer.probability,
            effects=answer.effects,
            group=answer.group,
            sub_model=place.sub_model,
            regimes=place.regimes,
            probabilities=self.selection.probability.get(first, {}),
            gap_raw=weighed.gap_raw,
            gap_refit=whole.gap_refit,
            gap_final=whole.gap_final,
            shrink=whole.shrink if answer.named else 0.0,
            shrink_low=low,
            shrink_high=high,
            ceiling=whole.ceiling,
            open_loop=[opened.raw, opened.refit, *opened.effects],
            imitated=answer.named and weighed.imitated,
            instead=list(weighed.instead),
            gap_instead=weighed.gap_instead if weighed.instead else None,
            bounded=list(answer.bounded),
        )
