"""Whether the experiments that `why` names part what they should: carried out, and asked again.

`why` says how far more runs should take the right entry from the name that was given, or from none.
As many of the best as should do are recorded on the case's own bench, each on another day, and the
case is diagnosed with them, the whole library at hand. A separation that was counted on and names
nothing is told as plainly as one that does.
"""

import functools
from collections.abc import Sequence
from pathlib import Path

import msgspec

from smad.errors import SmadError
from smad.gap.check.key import file_digest
from smad.gap.check.names import NAMING, canonical
from smad.gap.check.verdicts import CaseVerdict
from smad.report.page import Table, text_table
from tests.withheld.errors import WithheldError
from tests.withheld.more_runs import Ask, Follow, judge_again, recorded
from tests.withheld.reasons import FORMAT as REPORT_FORMAT
from tests.withheld.reasons import REASONS, Explained, Report, Way, parting
from tests.withheld.second_pass import opened, parts_beside, require_known, through

FORMAT = "smad-after-why-2"
_RIGHT = REASONS[0].name


class _Versioned(msgspec.Struct):
    """The beginning of any report; the rest of an older one has another form."""

    format: str


class Again(msgspec.Struct, frozen=True):
    """A case after the experiments: `names` are the causes that its verdict leaves.

    `counted` is the separation d² that they were to bring from what was said before, `errors` what
    the right entry's gain was to come to, in standard errors.
    """

    case: str
    cause: str
    strength: float
    reason: str
    experiments: list[str]
    counted: float
    errors: float
    before: str
    outcome: str
    names: list[str]

    @property
    def told(self) -> str:
        """How the runs helped, in a word or three."""
        if self.cause not in self.names:
            return "not named"
        return "named alone" if len(self.names) == 1 else "named with others"


class AgainReport(msgspec.Struct, frozen=True):
    """Every case that was asked again, and those that no few experiments were to part.

    `too_few` are cases for which the best experiments of the catalogue together do not reach what
    is wanted, so that nothing was recorded; `failed` those that could not be diagnosed.
    """

    format: str
    bank: str
    key_sha256: str
    verdicts_sha256: str
    cases: list[Again]
    too_few: list[str]
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
        ways = {x.told.case: parting(x.told, settings) for x in missed}
        wanted = {c: way for c, way in ways.items() if way is not None and way.enough}
        # Other experiments than before are other questions: their answers are kept apart.
        parts = parts_beside(out, digest, file_digest(report))
        todo = {c: way.experiments for c, way in wanted.items()}
        runs = recorded(frozen, todo, parts, follow)
        said = through(frozen, list(wanted), parts, functools.partial(ask, runs=runs), jobs)
        by_case = {x.told.case: x for x in missed}
        again = [_again(by_case[c], wanted[c], answer) for c, answer in said.items()]
        whole = AgainReport(
            format=FORMAT,
            bank=frozen.bank.manifest.bank,
            key_sha256=frozen.bank.manifest.key_sha256,
            verdicts_sha256=digest,
            cases=again,
            too_few=[c for c in ways if c not in wanted],
            failed=[c for c in wanted if c not in said],
        )
        out.write_bytes(whole.to_json())
    except SmadError as error:
        raise WithheldError(str(error)) from error
    if again:
        print(text_table(_table(again)))
    print(
        f"{len(again)} of {len(wanted)} cases asked again, {len(whole.too_few)} that the best "
        f"experiments are not likely to part: {out}"
    )


def _missed(path: Path, digest: str) -> list[Explained]:
    """The cases of a report of these verdicts that were not named rightly."""
    try:
        data = path.read_bytes()
        version = msgspec.json.decode(data, type=_Versioned).format
        if version.startswith("smad-why-") and version != REPORT_FORMAT:
            raise WithheldError(f"{path} is of another version: ask why of these verdicts again")
        report = msgspec.json.decode(data, type=Report)
    except (OSError, msgspec.DecodeError) as error:
        raise WithheldError(f"{path} is no report of why: {error}") from None
    if report.verdicts_sha256 != digest:
        raise WithheldError(f"{path} is about other verdicts: ask why of these first")
    return [x for x in report.cases if x.reason != _RIGHT]


def _chosen(missed: Sequence[Explained], cases: Sequence[str]) -> list[Explained]:
    known = {x.told.case for x in missed}
    require_known(cases, known, "a missed or misnamed case of the report")
    return [x for x in missed if not cases or x.told.case in cases]


def _again(x: Explained, way: Way, said: CaseVerdict) -> Again:
    assert said.next_experiment is not None
    left = said.next_experiment.names_after or []
    return Again(
        case=x.told.case,
        cause=x.told.cause,
        strength=x.told.strength,
        reason=x.reason,
        experiments=way.experiments,
        counted=way.counted,
        errors=way.errors,
        before=_answer(x.told.outcome, x.told.said),
        outcome=said.outcome,
        names=list(dict.fromkeys(canonical(n) for n in left)),
    )


def _answer(outcome: str, names: Sequence[str]) -> str:
    return " + ".join(names) if outcome in NAMING else outcome


def _table(cases: Sequence[Again]) -> Table:
    heads = ["case", "cause", "floors", "said before", "experiments", "d²", "gain/se",
             "said after", ""]  # fmt: skip
    rows = [
        [c.case, c.cause, f"{c.strength:.0f}", c.before, ", ".join(c.experiments),
         f"{c.counted:.0f}", f"{c.errors:.1f}", _answer(c.outcome, c.names), c.told]
        for c in cases
    ]  # fmt: skip
    return Table(heads, rows, numeric=frozenset({2, 5, 6}))
