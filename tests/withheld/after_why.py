"""Whether the experiment that `why` names parts what it says: it is carried out, and asked again.

`why` foretells how far one more run would take the right entry from the name that was given, or
from none. Here that run is recorded on the case's own bench, and the case is diagnosed with it, the
whole library at hand. A foretold separation that names nothing is told as plainly as one that does.
"""

import functools
from collections.abc import Sequence
from pathlib import Path

import msgspec

from smad.errors import SmadError
from smad.gap.check.key import file_digest
from smad.gap.check.names import NAMING, canonical
from smad.gap.check.reasons import REASONS, Explained, Report, parted, parting
from smad.gap.check.verdicts import CaseVerdict
from smad.gap.entry import Apart
from smad.report.page import Table, text_table
from tests.withheld.errors import WithheldError
from tests.withheld.one_more_run import Ask, Follow, judge_again, recorded
from tests.withheld.second_pass import opened, parts_beside, through

FORMAT = "smad-after-why-1"
_RIGHT = REASONS[0].name


class Again(msgspec.Struct, frozen=True):
    """A case after the one run: `names` are the causes that its verdict leaves standing."""

    case: str
    cause: str
    strength: float
    reason: str
    experiment: str
    d2: float
    before: str
    outcome: str
    names: list[str]

    @property
    def told(self) -> str:
        """How the run helped, in a word or three."""
        if self.cause not in self.names:
            return "not named"
        return "named alone" if len(self.names) == 1 else "named with others"


class AgainReport(msgspec.Struct, frozen=True):
    """Every case that was asked again, and those that were not parted even in prediction.

    `not_foretold` are cases whose experiment was foretold to reach less than `d2_limit`, so that
    nothing was recorded; `failed` those that could not be diagnosed.
    """

    format: str
    bank: str
    key_sha256: str
    verdicts_sha256: str
    d2_limit: float
    cases: list[Again]
    not_foretold: list[str]
    failed: list[str]

    def to_json(self) -> bytes:
        """Indented JSON."""
        return msgspec.json.format(msgspec.json.encode(self), indent=1) + b"\n"


def run(
    verdicts: Path,
    key: Path,
    bank: Path,
    report: Path,
    out: Path,
    *,
    jobs: int,
    follow: Follow,
    cases: Sequence[str] = (),
    ask: Ask = judge_again,
) -> None:
    """Carry out the experiments that a report of `why` names, ask again, print, write.

    Only those of `cases`, if any are given. Raises WithheldError as `second_pass.opened`, when the
    report is of other verdicts, and when it has no such case.
    """
    try:
        frozen = opened(verdicts, key, bank)
        digest = file_digest(verdicts)
        missed = _chosen(_missed(report, digest), cases)
        settings = frozen.how.settings
        wanted = {x.told.case: x for x in missed if parted(x, settings)}
        parts = parts_beside(out, digest)
        runs = recorded(frozen, {c: _apart(x).experiment for c, x in wanted.items()}, parts, follow)
        said = through(frozen, list(wanted), parts, functools.partial(ask, runs=runs), jobs)
        again = [_again(wanted[case], answer) for case, answer in said.items()]
        whole = AgainReport(
            format=FORMAT,
            bank=frozen.bank.manifest.bank,
            key_sha256=frozen.bank.manifest.key_sha256,
            verdicts_sha256=digest,
            d2_limit=settings.ambiguous_d2,
            cases=again,
            not_foretold=[x.told.case for x in missed if x.told.case not in wanted],
            failed=[case for case in wanted if case not in said],
        )
        out.write_bytes(whole.to_json())
    except SmadError as error:
        raise WithheldError(str(error)) from error
    if again:
        print(text_table(_table(again)))
    print(
        f"{len(again)} of {len(wanted)} cases asked again, {len(whole.not_foretold)} without an "
        f"experiment that is foretold to help: {out}"
    )


def _missed(path: Path, digest: str) -> list[Explained]:
    """The cases of a report of these verdicts that were not named rightly."""
    try:
        report = msgspec.json.decode(path.read_bytes(), type=Report)
    except (OSError, msgspec.DecodeError) as error:
        raise WithheldError(f"{path} is no report of why: {error}") from None
    if report.verdicts_sha256 != digest:
        raise WithheldError(f"{path} is about other verdicts: ask why of these first")
    return [x for x in report.cases if x.reason != _RIGHT]


def _chosen(missed: Sequence[Explained], cases: Sequence[str]) -> list[Explained]:
    known = {x.told.case for x in missed}
    for case in cases:
        if case not in known:
            raise WithheldError(f"{case} is not a missed or misnamed case of the report")
    return [x for x in missed if not cases or x.told.case in cases]


def _apart(x: Explained) -> Apart:
    apart = parting(x.told)
    assert apart is not None
    return apart


def _again(x: Explained, said: CaseVerdict) -> Again:
    apart = _apart(x)
    assert said.next_experiment is not None
    left = said.next_experiment.names_after or []
    return Again(
        case=x.told.case,
        cause=x.told.cause,
        strength=x.told.strength,
        reason=x.reason,
        experiment=apart.experiment,
        d2=apart.d2,
        before=_answer(x.told.outcome, x.told.said),
        outcome=said.outcome,
        names=list(dict.fromkeys(canonical(n) for n in left)),
    )


def _answer(outcome: str, names: Sequence[str]) -> str:
    return " + ".join(names) if outcome in NAMING else outcome


def _table(cases: Sequence[Again]) -> Table:
    heads = [
        "case",
        "cause",
        "floors",
        "said before",
        "experiment",
        "d² foretold",
        "said after",
        "",
    ]
    rows = [
        [c.case, c.cause, f"{c.strength:.0f}", c.before, c.experiment, f"{c.d2:.0f}",
         _answer(c.outcome, c.names), c.told]
        for c in cases
    ]  # fmt: skip
    return Table(heads, rows, numeric=frozenset({2, 5}))
