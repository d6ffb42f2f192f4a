"""A diagnosis cut short: few candidates, iterations and resamples, in this process."""

import pytest

from smad.diagnosis.bank.running import Part, Task, Work

_SIZES = {
    "compare.select._SURVIVORS": 2,
    "compare.select._STARTS": 1,
    "compare.assess.DRAWS": 100,
    "compare.score_table.DRAWS": 100,
    "report.builder.DRAWS": 100,
    "fit.joint.DRAWS": 100,
    "fit.joint._LONGER_FITS": 2,
    "fit.joint.FIT_ITERATIONS": 2,
    "fit.baseline.FIT_ITERATIONS": 2,
    "fit.baseline._ROUNDS": 0,
    "fit.baseline._LAW_ROUNDS": 1,
    "fit.baseline._LAW_ROUNDS_LAST": 1,
    "fit.baseline.REFIT_ITERATIONS": 2,
    "fit.refit.REFIT_ITERATIONS": 2,
    "fit.stages.REFIT_ITERATIONS": 2,
}


def quicken(monkeypatch: pytest.MonkeyPatch, **sizes: int) -> None:
    """Cuts it short for a test; a check keeps its cases in this process. `sizes` by last name."""
    for name, size in _SIZES.items():
        monkeypatch.setattr(f"smad.gap.{name}", sizes.get(name.rpartition(".")[2], size))
    monkeypatch.setattr("smad.diagnosis.bank.running.apart", _here)


def _here(work: Work, task: Task) -> Part:
    return work(task)
