"""What the product says of a case of the recovery bank."""

from __future__ import annotations

import functools
import time
import traceback

import msgspec

from evaluation.recovery.cases import NONE, Case, bench_parameters
from evaluation.recovery.playing import FIT, HELD_OUT, REPEATS, Bench
from evaluation.score.first_step import ScoredVerdict, scored
from smad.checkup.judge import commissioned, judge_runs
from smad.diagnosis.diagnose import diagnose
from smad.diagnosis.paired.good import GoodRuns
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.verdict import CHANGED, CHECK_UP, DIFFERS

_GOOD_SEED = 500


class Answer(msgspec.Struct, frozen=True, kw_only=True):
    """A case with its verdict, or with why there is none; processor time of the diagnosis alone."""

    case: Case
    verdict: ScoredVerdict | None = None
    error: str = ""
    cpu_s: float = 0.0


def answer(case: Case, seed: int) -> Answer:
    """Play a case and diagnose it. An error in it becomes part of the answer."""
    try:
        verdict, cpu_s = _diagnosed(case, seed)
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        words = f"{type(error).__name__}: {error} ({last.filename.rsplit('/')[-1]}:{last.lineno})"
        return Answer(case=case, error=words)
    # Model files and what runs would not have shown are long, and nothing here reads them.
    short = msgspec.structs.replace(verdict, models=[], unseen=[])
    return Answer(case=case, verdict=short, cpu_s=round(cpu_s, 2))


def _diagnosed(case: Case, seed: int) -> tuple[ScoredVerdict, float]:
    plant = _plant()
    good, now = bench_parameters(plant, case, seed)
    bench = Bench(plant, now, case.effects)
    if case.question == DIFFERS:
        fit = bench.everyday(FIT, case.seed)
        held_out = bench.everyday(HELD_OUT, case.seed + len(FIT))
        began = time.process_time()
        return scored(diagnose(fit, plant=plant, hold_out=held_out)), _since(began)
    if case.question == CHANGED:
        before = Bench(plant, good, {}).everyday(FIT, case.seed + _GOOD_SEED, word="good ")
        runs = bench.everyday(FIT, case.seed)
        began = time.process_time()
        return scored(diagnose(runs, plant=plant, good=before)), _since(began)
    return _checked_up(plant, case, seed, bench.programme(case.seed))


def _since(began: float) -> float:
    return time.process_time() - began


def _checked_up(
    plant: SmaPlant, case: Case, seed: int, now: list[GapRun]
) -> tuple[ScoredVerdict, float]:
    reference = _commissioned(case.bench, seed)
    began = time.process_time()
    verdict = scored(judge_runs(plant, reference, [(run, run.name) for run in now]))
    return verdict, _since(began)


@functools.cache
def _plant() -> SmaPlant:
    return SmaPlant()


@functools.lru_cache(maxsize=3)
def _commissioned(bench: int, seed: int) -> GoodRuns:
    """The good bench of that number, from its repeats."""
    plant = _plant()
    case = Case(name="", question=CHECK_UP, kind=NONE, seed=0, bench=bench)
    good, _ = bench_parameters(plant, case, seed)
    days = [Bench(plant, good, {}).programme(_GOOD_SEED * (bench + 1) + k) for k in range(REPEATS)]
    return commissioned(plant, list(zip(*days, strict=True)))
