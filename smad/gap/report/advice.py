"""What to do after a diagnosis, as commands to copy."""

from __future__ import annotations

import shlex
from dataclasses import dataclass

from smad.gap.records import NAMED, Diagnosis, Outcome


@dataclass(frozen=True)
class Asked:
    """How the diagnosis was asked for: its runs and options as typed, and the model it wrote."""

    arguments: str = "RUN…"
    model: str = ""


@dataclass(frozen=True)
class Step:
    """A thing to do: why, and the command that does it, "" where there is none."""

    why: str
    command: str = ""


def advice(d: Diagnosis, asked: Asked | None) -> list[Step]:
    """The next steps, the most useful first.

    Without `asked`, no command asked: the plant may be any, and only its own experiments have one.
    """
    if asked is None:
        own = {x.command for x in d.experiments}
        return [s if s.command in own else Step(s.why) for s in advice(d, Asked())]
    v = d.verdict
    ask = f"smad gap diagnose {asked.arguments}"
    if v.outcome is Outcome.REFUSED:
        return [Step("mend what the runs were refused for, and ask again", ask)]
    if v.outcome is Outcome.CONTRADICTING:
        return _one_state_at_a_time(d, ask)
    if v.outcome is Outcome.NO_EXCITATION:
        return [Step("list the runs that move more, and record some", "smad gap next")]
    steps = [Step(f"record: {x.title}", x.command) for x in d.experiments]
    if steps:
        steps.append(Step("ask again with them", f"{ask} --html gap.html"))
    elif v.outcome in (Outcome.UNKNOWN, Outcome.AMBIGUOUS) or v.imitated:
        steps.append(Step("see where the gap is, on the page", f"{ask} --html gap.html"))
    if v.outcome in NAMED or v.outcome is Outcome.PARAMETERS:
        model = asked.model or "better.toml"
        if not asked.model:
            steps.append(Step("keep the better model", f"{ask} --apply {model}"))
        verify = f"smad gap verify --model {model} NEW_RUN…"
        steps.append(Step("try it on runs that are new to it", verify))
    return steps


def _one_state_at_a_time(d: Diagnosis, ask: str) -> list[Step]:
    """Ask again without the runs that contradict the others, or for each run by itself."""
    apart = [r.run for r in d.agreement if r.contradicts]
    if len(apart) < len(d.agreement):
        left_out = " ".join(f"--leave-out {shlex.quote(name)}" for name in apart)
        return [Step("ask again without them", f"{ask} {left_out}")]
    return [Step(f"ask without {name}", f"{ask} --leave-out {shlex.quote(name)}") for name in apart]
