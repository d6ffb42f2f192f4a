"""Whether a recommended experiment gives a name where none, or none alone, was given.

It is carried out, and the case asked again. A cause that has a name already, if at even odds, is
left out: that it keeps it would say little.
"""

import functools
from pathlib import Path

import msgspec

from smad.errors import SmadError
from smad.gap.check.key import file_digest
from smad.gap.check.verdicts import CaseVerdict, write_verdicts
from tests.withheld.errors import WithheldError
from tests.withheld.more_runs import Follow, judge_again, recorded
from tests.withheld.second_pass import Frozen, opened, parts_beside, through

_OPEN = ("ambiguous", "unknown", "parameters_only", "no_gap")
"""Answers that give no name, or none alone: what an experiment may resolve."""


def recommended(frozen: Frozen) -> dict[str, list[str]]:
    """Case → the first experiment, where one was recommended for what is left."""
    return {
        p.case: [p.said.next_experiment.name]
        for p in frozen.pairs
        if p.said.outcome in _OPEN and p.said.next_experiment is not None
    }


def run(verdicts: Path, key: Path, bank: Path, out: Path, *, jobs: int, follow: Follow) -> None:
    """Carry out each recommended experiment, ask again, write the verdicts with `names_after`.

    Raises WithheldError as `second_pass.opened`.
    """
    try:
        frozen = opened(verdicts, key, bank)
        wanted = recommended(frozen)
        parts = parts_beside(out, file_digest(verdicts), "after-next")
        runs = recorded(frozen, wanted, parts, follow)
        work = functools.partial(judge_again, runs=runs)
        asked = through(frozen, list(wanted), parts, work, jobs)
        after = dict(frozen.file.verdicts)
        for case, said in asked.items():
            after[case] = _with(after[case], said)
        write_verdicts(out, msgspec.structs.replace(frozen.file, verdicts=after))
    except SmadError as error:
        raise WithheldError(str(error)) from error
    print(f"{len(asked)} of {len(wanted)} cases asked again: {out}")


def _with(before: CaseVerdict, said: CaseVerdict) -> CaseVerdict:
    assert before.next_experiment is not None
    assert said.next_experiment is not None
    whole = msgspec.structs.replace(
        before.next_experiment, names_after=said.next_experiment.names_after
    )
    return msgspec.structs.replace(before, next_experiment=whole)
