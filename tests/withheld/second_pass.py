"""What is asked of the diagnosis once its verdicts are frozen and the key may be used.

`best_entry`, `after_next`, `why` and `after_why` stand on this, and the two that record a run on
`more_runs`. Beside the tests, these six are the modules here that use the product; no module
that makes a bank reaches them, and they do not reach the plant.
"""

import hashlib
import sys
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import msgspec

from smad.errors import SmadError
from smad.gap.check.bank import Bank, open_bank, read_case, require_files
from smad.gap.check.case import How, Part, Task
from smad.gap.check.key import read_key
from smad.gap.check.names import canonical
from smad.gap.check.running import Order, Progress, check
from smad.gap.check.score import Pair, matched
from smad.gap.check.verdicts import CaseVerdict, VerdictFile, read_verdict_file, read_verdicts
from smad.gap.diagnose import ready
from smad.gap.fit.stages import Prepared
from tests.withheld.errors import WithheldError
from tests.withheld.seals import require_logged


@dataclass(frozen=True)
class Frozen:
    """Verdicts as they stand, with the truth beside them, their bank, and how they were made."""

    file: VerdictFile
    pairs: list[Pair]
    bank: Bank
    how: How


def opened(verdicts: Path, key: Path, folder: Path) -> Frozen:
    """Verdicts with their key and bank.

    Raises WithheldError or SmadError when the three do not belong together, or when verdicts on the
    sealed bank have not been scored, and thereby logged, before.
    """
    file = read_verdict_file(verdicts)
    truth, key_sha256 = read_key(key)
    require_logged(truth.bank, key_sha256, verdicts)
    pairs = matched(read_verdicts(verdicts), truth, key_sha256)
    bank = open_bank(folder)
    if bank.manifest.key_sha256 != key_sha256:
        raise WithheldError(f"{folder} belongs to another key than {key}: bring the bank's own key")
    if "how" not in file.tool:
        raise WithheldError(
            f"{verdicts} was not made by smad gap check: bring a file that it wrote"
        )
    return Frozen(file, pairs, bank, msgspec.convert(file.tool["how"], How))


def parts_beside(out: Path, *about: str) -> Path:
    """The folder beside `out` in which answers about some verdicts, and whatever else the question
    depends on, are kept; made if need be."""
    digest = hashlib.sha256("\n".join(about).encode()).hexdigest()
    parts = out.with_name(f"{out.name}.{digest[:12]}.parts")
    parts.mkdir(parents=True, exist_ok=True)
    return parts


def require_known(cases: Sequence[str], known: Collection[str], what: str) -> None:
    """Raises WithheldError when one of `cases` is not among `known`; `what` says what those are."""
    for case in cases:
        if case not in known:
            raise WithheldError(f"{case} is not {what}: name such cases, or leave --cases out")


def entries(library: Sequence[str], name: str) -> tuple[str, ...]:
    """The entries of a library that are one cause of the list; none when it lacks the cause."""
    return tuple(e for e in library if canonical(e) == name)


@contextmanager
def readied(task: Task, how: How) -> Iterator[Prepared]:
    """A case as far as it goes before effects are sought, while its replays have their thread."""
    runs = read_case(task.bank, task.case)
    with ThreadPoolExecutor(max_workers=1) as one:
        yield ready(
            runs.fit,
            plant=how.plant(),
            good=runs.good,
            hold_out=runs.hold_out,
            settings=how.settings,
            executor=one,
        )


def part_of(task: Task, say: Callable[[], CaseVerdict]) -> Part:
    """What `say` says of a case, or the error that prevented it."""
    began = time.perf_counter()
    try:
        verdict = say()
    except SmadError as error:
        return Part(task.case.id, time.perf_counter() - began, error=str(error))
    return Part(task.case.id, time.perf_counter() - began, verdict)


def through(
    frozen: Frozen, names: Sequence[str], parts: Path, work: Callable[[Task], Part], jobs: int
) -> dict[str, CaseVerdict]:
    """What `work` says of some cases; resumed like a check, and like it past failed cases."""
    cases = [c for c in frozen.bank.manifest.cases if c.id in names]
    require_files(frozen.bank, cases)
    order = Order(frozen.bank, cases, frozen.how, parts)
    done = check(order, jobs=jobs, report=_tell, work=work)
    return done.verdicts


def _tell(progress: Progress) -> None:
    part, left = progress.part, f"{progress.left_s / 60.0:.0f} min left"
    said = part.error or f"done in {part.seconds:.0f} s"
    print(f"{part.case}  {said}  [{progress.done}/{progress.total}, {left}]", file=sys.stderr)
