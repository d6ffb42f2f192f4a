"""The command line of the withheld check; every error ends in one sentence, not a traceback."""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path

from tests.withheld import bank, quiz
from tests.withheld.errors import WithheldError
from tests.withheld.follow import follow


def _make(options: argparse.Namespace) -> None:
    order = bank.Order(
        options.bank,
        Path(options.out),
        cases=options.cases,
        full=options.full,
        seed=options.seed,
        jobs=options.jobs,
        suffix=".csv.gz" if options.csv else ".parquet",
    )
    sha256 = bank.make_bank(order)
    print(f"bank  {order.folder}")
    print(f"key   {order.key_folder / 'KEY.json'}")
    print(f"SHA-256 of the key  {sha256}")


def _places(options: argparse.Namespace) -> tuple[Path, Path, Path, Path]:
    """Verdicts, key and bank of a second pass, and where its answer goes."""
    return Path(options.verdicts), Path(options.key), Path(options.bank), Path(options.out)


def _best_entry(options: argparse.Namespace) -> None:
    from tests.withheld.best_entry import run

    run(*_places(options), jobs=options.jobs)


def _recorder(options: argparse.Namespace) -> Callable[[str, Path, Path, int], None]:
    """What records a case's bench under a program."""
    bank, key = Path(options.bank), Path(options.key)

    def record(case: str, program: Path, out: Path, number: int) -> None:
        follow(bank, key, case, program, out, number=number)

    return record


def _after_next(options: argparse.Namespace) -> None:
    from tests.withheld.after_next import run

    run(*_places(options), jobs=options.jobs, follow=_recorder(options))


def _after_why(options: argparse.Namespace) -> None:
    from tests.withheld.after_why import run

    verdicts, key, bank, out = _places(options)
    run(
        verdicts,
        key,
        bank,
        Path(options.report),
        out,
        jobs=options.jobs,
        follow=_recorder(options),
        cases=_cases(options),
    )


def _cases(options: argparse.Namespace) -> list[str]:
    return [c for c in options.cases.split(",") if c]


def _why(options: argparse.Namespace) -> None:
    from tests.withheld.why import run

    run(
        *_places(options),
        jobs=options.jobs,
        cases=_cases(options),
        everything=options.all,
    )


def _follow(options: argparse.Namespace) -> None:
    print(follow(Path(options.bank), Path(options.key), options.case, Path(options.program)))


def _mystery(options: argparse.Namespace) -> None:
    link = Path(options.link) if options.link else None
    quiz.run(options.seed, good=options.good, link=link, note=Path(options.note))


def _reveal(options: argparse.Namespace) -> None:
    print(json.dumps(quiz.reveal(Path(options.note)), indent=1, ensure_ascii=False))


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.withheld", description=__doc__)
    commands = parser.add_subparsers(required=True)
    make = commands.add_parser("make", help="make a bank of recorded runs with a sealed key")
    make.add_argument("bank", choices=("dev", "sealed", "mini"))
    make.add_argument("--cases", type=int, help="about so many cases, in the same mixture")
    make.add_argument("--full", action="store_true", help="440 cases instead of 150")
    make.add_argument("--out", default="banks", help="where bank and key go (default ./banks)")
    make.add_argument("--seed", type=int, help="default: fixed for dev, secret for sealed")
    make.add_argument("--jobs", type=int, default=2)
    make.add_argument("--csv", action="store_true", help="gzipped CSV instead of Parquet")
    make.set_defaults(run=_make)
    answer = "the verdicts with the answer added"
    later = {}
    for name, run, told, out in (
        ("best-entry", _best_entry, "oracle O2: fit the right entry of the library", answer),
        ("after-next", _after_next, "carry out the recommended experiments and ask again", answer),
        ("why", _why, "why right names were not given", "the report, as JSON"),
        (
            "after-why",
            _after_why,
            "carry out the experiments that `why` names",
            "a report, as JSON",
        ),
    ):
        later[name] = commands.add_parser(name, help=told)
        later[name].add_argument("verdicts", help="frozen verdicts of `smad gap check`")
        later[name].add_argument("key")
        later[name].add_argument("bank")
        later[name].add_argument("--out", required=True, help=out)
        later[name].add_argument("--jobs", type=int, default=2)
        later[name].set_defaults(run=run)
    for name in ("why", "after-why"):
        later[name].add_argument("--cases", default="", help="only these, as case-001,case-007")
    later["why"].add_argument(
        "--all", action="store_true", help="rightly named ones too, to compare with"
    )
    later["after-why"].add_argument("--report", required=True, help="what `why` wrote")
    again = commands.add_parser("follow", help="run a recommended experiment on a case's bench")
    again.add_argument("bank")
    again.add_argument("key")
    again.add_argument("case")
    again.add_argument("program", help="CSV of what to do, see docs/withheld.md")
    again.set_defaults(run=_follow)
    mystery = commands.add_parser("mystery", help="a bench on a pty with a hidden effect")
    mystery.add_argument("seed", type=int)
    mystery.add_argument("--good", action="store_true", help="the same bench before the trouble")
    mystery.add_argument("--link", help="make a symbolic link to the pty here")
    mystery.add_argument("--note", default=str(quiz.NOTE), help="where the sealed note goes")
    mystery.set_defaults(run=_mystery)
    reveal = commands.add_parser("reveal", help="open the answer of the last mystery")
    reveal.add_argument("--note", default=str(quiz.NOTE))
    reveal.set_defaults(run=_reveal)
    return parser


def main(arguments: list[str] | None = None) -> None:
    """Run one command; exits with 2 and one sentence on an error, with 130 when interrupted."""
    options = _arguments().parse_args(arguments)
    try:
        options.run(options)
    except WithheldError as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("\nstopped; the same command goes on with what is not finished", file=sys.stderr)
        raise SystemExit(130) from None
