"""What stands in the way: each case of one effect that was missed or misnamed, asked once more.

The case is diagnosed with nothing but the right entry in the library, then with the names beside it
that were given; the numbers say which reason of `tests.withheld.reasons` holds.
"""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from smad.errors import SmadError
from smad.gap.check.bank import used
from smad.gap.check.case import Part, Task
from smad.gap.check.key import file_digest
from smad.gap.check.names import OUTCOMES
from smad.gap.check.score import Pair, name_credit, of_kind
from smad.gap.check.verdicts import CaseVerdict
from smad.report.page import text_table
from tests.withheld.entry import EntryRecord, examine
from tests.withheld.errors import WithheldError
from tests.withheld.reason_tables import case_table, count_table
from tests.withheld.reasons import (
    FORMAT,
    Report,
    counts,
    explained,
    given_beside,
    meanings,
    told,
)
from tests.withheld.second_pass import (
    Frozen,
    entries,
    opened,
    part_of,
    parts_beside,
    readied,
    require_known,
    through,
)


@dataclasses.dataclass(frozen=True)
class Question:
    """The entries of the right cause, and those of the names that were given beside it."""

    own: tuple[str, ...]
    others: tuple[str, ...] = ()


def question_of(pair: Pair, library: Sequence[str]) -> Question:
    """What to ask of a case; no entries of its own where the library lacks the cause."""
    given = [e for name in given_beside(pair) for e in entries(library, name)]
    return Question(entries(library, pair.truth.effects[0].name), tuple(given))


def examine_case(task: Task, asked: Mapping[str, Question], folder: Path) -> Part:
    """The right entry's numbers, kept in `folder`; the part says only that they are there."""
    question = asked[task.case.id]

    def say() -> CaseVerdict:
        # One cause is sought: further ones would answer another question.
        settings = dataclasses.replace(task.how.settings, max_effects=1)
        with readied(task, dataclasses.replace(task.how, settings=settings)) as prepared:
            entry = examine(prepared, question.own, question.others)
        _record(folder, task.case.id).write_bytes(msgspec.json.encode(entry))
        return CaseVerdict(outcome=OUTCOMES[entry.standing.outcome])

    return part_of(task, say)


def _record(folder: Path, case: str) -> Path:
    return folder / f"{case}.entry.json"


def wanted(frozen: Frozen, cases: Sequence[str], *, everything: bool) -> list[Pair]:
    """Cases of one effect whose name was not given, or not alone; with `everything`, all of them.

    Of a part of a bank only the cases that were judged count. Raises WithheldError when one of
    `cases` is not among them.
    """
    judged = [p for p in of_kind(frozen.pairs, "single") if p.case in frozen.file.verdicts]
    require_known(cases, {p.case for p in judged}, "a judged case of one effect")
    return [
        p for p in judged if (not cases or p.case in cases) and (everything or name_credit(p) < 1.0)
    ]


def run(
    verdicts: Path,
    key: Path,
    bank: Path,
    out: Path,
    *,
    jobs: int,
    cases: Sequence[str] = (),
    everything: bool = False,
) -> None:
    """Examine the cases, print the tables, write the report.

    Raises WithheldError as `second_pass.opened` and `wanted`.
    """
    try:
        frozen = opened(verdicts, key, bank)
        pairs = wanted(frozen, cases, everything=everything)
        digest = file_digest(verdicts)
        found = _examined(frozen, pairs, parts_beside(out, digest, FORMAT), jobs)
        explanations = explained(
            [told(p, found[p.case], _judged(frozen, p.case)) for p in pairs if p.case in found],
            frozen.how.settings,
        )
        report = Report(
            format=FORMAT,
            bank=frozen.bank.manifest.bank,
            key_sha256=frozen.bank.manifest.key_sha256,
            verdicts_sha256=digest,
            meanings=meanings(),
            counts=counts(explanations),
            cases=explanations,
            failed=[p.case for p in pairs if p.case not in found],
        )
        out.write_bytes(report.to_json())
    except SmadError as error:
        raise WithheldError(str(error)) from error
    if explanations:
        print(text_table(case_table(explanations)))
        print(text_table(count_table(explanations, frozen.how.settings)))
    print(f"{len(explanations)} of {len(pairs)} cases examined: {out}")


def _judged(frozen: Frozen, case: str) -> float:
    """How many times as many runs of a case are judged as are fitted."""
    roles = [r.role for r in used(frozen.bank.case(case))]
    return (roles.count("fit") + roles.count("hold_out")) / roles.count("fit")


def _examined(
    frozen: Frozen, pairs: Sequence[Pair], parts: Path, jobs: int
) -> dict[str, EntryRecord | None]:
    """The right entry's numbers by case; None where the library has no entry."""
    asked = {p.case: question_of(p, frozen.how.library()) for p in pairs}
    work = functools.partial(examine_case, asked=asked, folder=parts)
    some = [case for case, question in asked.items() if question.own]
    done = through(frozen, some, parts, work, jobs)
    records = {c: msgspec.json.decode(_record(parts, c).read_bytes(), type=EntryRecord)
               for c in done}  # fmt: skip
    return {c: records.get(c) for c in asked if c in records or c not in some}
