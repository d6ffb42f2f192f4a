"""The command line of the evaluation; every error ends in one sentence, not a traceback."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from evaluation.bank import check_ups, recorded
from evaluation.bank.cases import DIFFERS
from evaluation.errors import BankError, WithheldError
from evaluation.quiz import mystery

if TYPE_CHECKING:
    _Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def _make(options: argparse.Namespace) -> None:
    order = recorded.Order(
        options.bank,
        options.out,
        cases=options.cases,
        full=options.full,
        differs=options.differs,
        seed=options.seed,
        jobs=options.jobs,
        suffix=".csv.gz" if options.csv else ".parquet",
    )
    _made(order, recorded.make_bank(order))


def _play(options: argparse.Namespace) -> None:
    if options.sealed and options.seed is not None:
        raise BankError("a sealed bank draws its seed in secret: leave --seed out")
    order = check_ups.Order(
        options.bank,
        options.programme,
        cases=options.cases,
        benches=options.benches,
        repeats=options.repeats,
        seed=28 if options.seed is None else options.seed,
        mixture=options.mixture,
        sealed=options.sealed,
    )
    _made(order, check_ups.make(order, jobs=options.jobs))


def _made(order: recorded.Order | check_ups.Order, sha256: str) -> None:
    print(f"bank  {order.folder}")
    print(f"key   {order.key_folder / 'KEY.json'}")
    print(f"SHA-256 of the key  {sha256}")


def _check_up(options: argparse.Namespace) -> None:
    from evaluation.run.check_ups import run

    run(
        options.bank,
        options.out,
        benches=_named(options.benches),
        repeats=options.repeats,
        key=options.leave_out,
        jobs=options.jobs,
    )


def _score(options: argparse.Namespace) -> None:
    from evaluation.score.scoring import run

    run(
        options.verdicts,
        options.key,
        diagnoses=options.kept,
        out=options.out,
        title=options.title,
        note=options.note,
        answered_only=options.answered_only,
    )


def _decide(options: argparse.Namespace) -> None:
    from evaluation.calibrate.decision import decide_constants

    decide_constants(
        options.banks,
        options.out,
        _named(options.cases),
        as_is=options.as_is,
        write=options.write,
    )


def _calibrate(options: argparse.Namespace) -> None:
    from evaluation.calibrate.check_up import calibrate

    benches = _named(options.benches)
    calibrate(options.banks, options.kept, options.out, benches, jobs=options.jobs)


def _named(text: str) -> list[str]:
    return [name for name in text.split(",") if name]


def _mystery(options: argparse.Namespace) -> None:
    sitting = mystery.Sitting(
        good=options.good,
        day=options.day,
        pace=mystery.Pace(by_host=options.paced_by_host),
        with_parent=options.with_parent,
    )
    mystery.run(options.seed, sitting, link=options.link, note=options.note)


def _mysteries(options: argparse.Namespace) -> None:
    from evaluation.quiz import ends, session
    from evaluation.results.record import keep
    from smad.report.page import text_table

    order = session.Order(options.minutes, options.quick, options.days)
    ends.run(options.seeds, options.folder, session.asked(options.folder, order, mystery.reveal))
    table = ends.table(ends.ended(options.folder))
    print(text_table(table))
    if options.out:
        command = "python -m evaluation mysteries"
        keep(options.out, {"": table}, title=options.title, command=command, note=options.note)


def _reveal(options: argparse.Namespace) -> None:
    print(json.dumps(mystery.reveal(options.note), indent=1, ensure_ascii=False))


def _results(options: argparse.Namespace) -> None:
    from evaluation.results.page import main as write

    if write(["--check"] if options.check else []):
        raise SystemExit(1)


def _elsewhere() -> dict[str, str]:
    """Commands that parse their own arguments, and what they are for."""
    return {
        "where": "how often the place of an effect comes first",
        "design": "design the programme of the check-up",
    }


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m evaluation", description=__doc__)
    commands = parser.add_subparsers(required=True)
    for add in (_banks, _runs, _constants, _quiz):
        add(commands)
    for name, told in _elsewhere().items():
        commands.add_parser(name, help=told)
    results = commands.add_parser("results", help="write the page of results from what is kept")
    results.add_argument("--check", action="store_true", help="only say whether it is stale")
    results.set_defaults(run=_results)
    return parser


def _banks(commands: _Commands) -> None:
    make = commands.add_parser("make", help="make a bank of recorded runs with a sealed key")
    make.add_argument("bank", choices=("dev", "sealed", "mini"))
    make.add_argument("--cases", type=int, help="about so many cases, in the same mixture")
    make.add_argument("--full", action="store_true", help="440 cases instead of 150")
    make.add_argument(
        "--differs", type=int, default=DIFFERS, help="cases without good runs (default 4)"
    )
    make.add_argument("--out", type=Path, default=Path("banks"), help="where bank and key go")
    make.add_argument("--seed", type=int, help="default: fixed for dev, secret for sealed")
    make.add_argument("--jobs", type=int, default=2)
    make.add_argument("--csv", action="store_true", help="gzipped CSV instead of Parquet")
    make.set_defaults(run=_make)
    play = commands.add_parser("play", help="a bank of check-ups: a programme, good and now")
    play.add_argument("bank", type=Path, help="the folder to make; its key goes beside it")
    play.add_argument("--programme", type=Path, required=True, help="folder of the programme")
    play.add_argument("--cases", type=int, default=66)
    play.add_argument("--benches", type=int, default=6)
    play.add_argument("--repeats", type=int, default=2, help="good repeats of each bench")
    play.add_argument("--seed", type=int, help="default: 28; secret for sealed")
    play.add_argument("--sealed", action="store_true", help="with effects nobody has looked at")
    play.add_argument("--mixture", choices=tuple(check_ups.MIXTURES), default="scores")
    play.add_argument("--jobs", type=int, default=2)
    play.set_defaults(run=_play)


def _runs(commands: _Commands) -> None:
    judged = commands.add_parser("check-up", help="judge a bank of `play` with the product")
    judged.add_argument("bank", type=Path)
    judged.add_argument("--out", type=Path, required=True, help="the verdicts, for `score`")
    judged.add_argument("--benches", default="", help="only these, as bench-1,bench-4")
    judged.add_argument("--repeats", type=int, help="only so many of the good repeats")
    judged.add_argument("--jobs", type=int, default=1, help="benches at a time")
    judged.add_argument(
        "--leave-out", metavar="KEY", type=Path,
        help="judge single effects once more, the right entry out of the library; the key's folder",
    )  # fmt: skip
    judged.set_defaults(run=_check_up)
    score = commands.add_parser("score", help="scores as they are published, with their goals")
    score.add_argument("verdicts", type=Path)
    score.add_argument("key", type=Path)
    score.add_argument("--kept", type=Path, help="whole diagnoses of `--keep`, for simpler rules")
    score.add_argument("--answered-only", action="store_true", help="leave out the other cases")
    _kept_as(score)
    score.set_defaults(run=_score)


def _kept_as(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, help="keep it: evaluation/results/NAME.json")
    command.add_argument("--title", default="", help="its heading, with --out")
    command.add_argument("--note", default="", help="what it is of, with --out")


def _constants(commands: _Commands) -> None:
    deciding = commands.add_parser("decide", help="constants of the diagnosis's decision")
    deciding.add_argument("banks", type=Path, nargs="+", help="development banks, keys beside them")
    deciding.add_argument("--out", type=Path, required=True, help="folder for the answers")
    deciding.add_argument("--as-is", action="store_true", help="shares of right answers only")
    deciding.add_argument("--cases", default="", help="only these, as case-001,case-007")
    deciding.add_argument("--write", action="store_true", help="write them to the package")
    deciding.set_defaults(run=_decide)
    fitted = commands.add_parser("calibrate", help="constants of the check-up from banks")
    fitted.add_argument("banks", type=Path, nargs="+", help="development banks of `play`")
    fitted.add_argument("--kept", type=Path, required=True, help="folder for what was found")
    fitted.add_argument("--out", type=Path, help="write them to this TOML")
    fitted.add_argument("--benches", default="", help="only these, separated by commas")
    fitted.add_argument("--jobs", type=int, default=1, help="benches at a time")
    fitted.set_defaults(run=_calibrate)


def _quiz(commands: _Commands) -> None:
    hidden = commands.add_parser("mystery", help="a bench on a pty with a hidden effect")
    hidden.add_argument("seed", type=int)
    hidden.add_argument("--good", action="store_true", help="the same bench before the trouble")
    hidden.add_argument("--day", type=int, default=0, help="another day of the same bench")
    hidden.add_argument(
        "--paced-by-host",
        action="store_true",
        help="armed, wait for each setpoint, and else hurry: as fast as the machine goes",
    )
    hidden.add_argument(
        "--with-parent", action="store_true", help="end with the process that started it"
    )
    hidden.add_argument("--link", type=Path, help="make a symbolic link to the pty here")
    hidden.add_argument("--note", type=Path, default=mystery.NOTE, help="where the note goes")
    hidden.set_defaults(run=_mystery)
    many = commands.add_parser("mysteries", help="`investigate` on many, over the wire")
    many.add_argument("seeds", type=int, nargs="*", help="of the benches; none: the table only")
    many.add_argument("--minutes", type=float, default=20.0, help="bench time for each")
    many.add_argument("--quick", action="store_true", help="commission the quick part only")
    many.add_argument(
        "--days", type=int, choices=(1, 2), default=2, help="days of the two good repeats"
    )
    many.add_argument("--folder", type=Path, required=True, help="for what became of each")
    _kept_as(many)
    many.set_defaults(run=_mysteries)
    reveal = commands.add_parser("reveal", help="open the answer of the last mystery")
    reveal.add_argument("--note", type=Path, default=mystery.NOTE)
    reveal.set_defaults(run=_reveal)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command; exits with 2 and one sentence on an error, with 130 when interrupted."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    try:
        match given[:1]:
            case ["where"]:
                from evaluation.score.where import main as where

                where(given[1:])
            case ["design"]:
                from evaluation.programme.design import main as design

                design(given[1:])
            case _:
                options = _arguments().parse_args(given)
                options.run(options)
    except WithheldError as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("\nstopped; the same command goes on with what is not finished", file=sys.stderr)
        raise SystemExit(130) from None
