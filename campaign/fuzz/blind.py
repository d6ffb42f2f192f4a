"""The corpus and mutations of it through a harness in this process: for want of atheris."""

from __future__ import annotations

import time
import traceback
from collections.abc import Iterator

from campaign.fuzz.limits import kind_of, within_limits
from campaign.fuzz.mutate import mutations
from campaign.fuzz.outcome import Finding, Outcome
from campaign.fuzz.targets import Target

_MOST_RUNS = 10**9


def fuzz_blindly(target: Target, *, seconds: float | None, runs: int | None, seed: int) -> Outcome:
    """Try the corpus, then mutations, for so long or so many inputs; keep each kind of finding."""
    limited = within_limits(target.harness(), target.allowed_s)
    corpus = list(target.corpus().values())
    findings: dict[str, Finding] = {}
    began_s = time.monotonic()
    executions = 0
    for data in _inputs(target, corpus, runs, seed):
        if seconds is not None and time.monotonic() - began_s > seconds:
            break
        executions += 1
        try:
            limited(data)
        except Exception as error:
            kind = kind_of(error)
            text = "".join(traceback.format_exception(error))
            findings.setdefault(kind, Finding(kind, text, data))
    return Outcome(
        target=target.name,
        executions=executions,
        seconds=round(time.monotonic() - began_s, 1),
        inputs_before=len(corpus),
        inputs=len(corpus),
        findings=tuple(findings.values()),
    )


def _inputs(target: Target, corpus: list[bytes], runs: int | None, seed: int) -> Iterator[bytes]:
    yield from corpus[:runs]
    wanted = _MOST_RUNS if runs is None else runs
    yield from mutations(target, corpus, max(0, wanted - len(corpus)), seed)
