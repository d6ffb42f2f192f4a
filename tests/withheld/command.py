"""The command line of the withheld check; every error ends in one sentence, not a traceback."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from tests.withheld import bank, playing, quiz
from tests.withheld.errors import BankError, WithheldError
from tests.withheld.follow import follow

if TYPE_CHECKING:
    _Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def _make(options: argparse.Namespace) -> None:
    order = bank.Order(
        options.bank,
        Path(options.out),
        cases=options.cases,
        full=options.full,
        differs=options.differs,
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


def _score(options: argparse.Namespace) -> None:
    from tests.withheld.scoring import run

    run(
        Path(options.verdicts),
        Path(options.key),
        kept=Path(options.kept) if options.kept else None,
        json_path=Path(options.json) if options.json else None,
        html_path=Path(options.html) if options.html else None,
        documents=[Path(d) for d in options.readme],
        answered_only=options.answered_only,
    )


def _decide(options: argparse.Namespace) -> None:
    from tests.withheld.deciding import decide_constants

    banks, out = [Path(bank) for bank in options.banks], Path(options.out)
    decide_constants(banks, out, _cases(options), as_is=options.as_is, write=options.write)


def _follow(options: argparse.Namespace) -> None:
    print(follow(Path(options.bank), Path(options.key), options.case, Path(options.program)))


def _play(options: argparse.Namespace) -> None:
    if options.sealed and options.seed is not None:
        raise BankError("a sealed bank draws its seed in secret: leave --seed out")
    order = playing.Order(
        Path(options.bank),
        Path(options.programme),
        cases=options.cases,
        benches=options.benches,
        repeats=options.repeats,
        seed=28 if options.seed is None else options.seed,
        mixture=options.mixture,
        sealed=options.sealed,
    )
    sha256 = playing.make(order, jobs=options.jobs)
    print(f"bank  {order.folder}")
    print(f"key   {order.key_folder / 'KEY.json'}")
    print(f"SHA-256 of the key  {sha256}")


def _check_up(options: argparse.Namespace) -> None:
    from tests.withheld.check_up import run

    benches = [b for b in options.benches.split(",") if b]
    key = Path(options.leave_out) if options.leave_out else None
    run(
        Path(options.bank),
        Path(options.out),
        benches=benches,
        repeats=options.repeats,
        key=key,
        jobs=options.jobs,
    )


def _calibrate(options: argparse.Namespace) -> None:
    from tests.withheld.calibrating import calibrate

    benches = [b for b in options.benches.split(",") if b]
    out = Path(options.out) if options.out else None
    banks = [Path(b) for b in options.banks]
    kept = Path(options.kept)
    calibrate(banks, kept, out, benches, jobs=options.jobs)


def _curves(options: argparse.Namespace) -> None:
    from tests.withheld.curves import report

    page = Path(options.page) if options.page else None
    report(Path(options.verdicts), Path(options.key), page, options.note, options.mark)


def _beside(options: argparse.Namespace) -> None:
    from tests.withheld.curves import beside, put_into

    files = {label: Path(name) for label, name in (pair.split("=", 1) for pair in options.verdicts)}
    text = beside(files, Path(options.key), options.title)
    print(text)
    if options.page:
        put_into(Path(options.page), f"{options.note}\n\n{text}", options.mark)


def _mystery(options: argparse.Namespace) -> None:
    link = Path(options.link) if options.link else None
    sitting = quiz.Sitting(
        good=options.good,
        day=options.day,
        pace=quiz.Pace(by_host=options.paced_by_host),
        with_parent=options.with_parent,
    )
    quiz.run(options.seed, sitting, link=link, note=Path(options.note))


def _inquiries(options: argparse.Namespace) -> None:
    from tests.withheld import inquiries

    out, programme = Path(options.out), Path(options.programme)

    def begin(seed: int, folder: Path) -> quiz.PlayedMystery:
        return quiz.PlayedMystery(seed, programme, folder)

    inquiries.run(options.seeds, out, inquiries.asked(begin, options.minutes))
    inquiries.report(out, Path(options.page) if options.page else None, options.note)


def _over_the_wire(options: argparse.Namespace) -> None:
    from tests.withheld import inquiries, mysteries

    out = Path(options.out)
    order = mysteries.Order(options.minutes, options.quick, options.days)
    inquiries.run(options.seeds, out, mysteries.asked(out, order, quiz.reveal))
    page = Path(options.page) if options.page else None
    inquiries.report(out, page, options.note, mysteries.MARK)


def _reveal(options: argparse.Namespace) -> None:
    print(json.dumps(quiz.reveal(Path(options.note)), indent=1, ensure_ascii=False))


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.withheld", description=__doc__)
    commands = parser.add_subparsers(required=True)
    for add in (_any_runs, _check_ups, _mysteries):
        add(commands)
    return parser


def _any_runs(commands: _Commands) -> None:
    make = commands.add_parser("make", help="make a bank of recorded runs with a sealed key")
    make.add_argument("bank", choices=("dev", "sealed", "mini"))
    make.add_argument("--cases", type=int, help="about so many cases, in the same mixture")
    make.add_argument("--full", action="store_true", help="440 cases instead of 150")
    make.add_argument(
        "--differs", type=int, default=bank.DIFFERS, help="cases without good runs (default 4)"
    )
    make.add_argument("--out", default="banks", help="where bank and key go (default ./banks)")
    make.add_argument("--seed", type=int, help="default: fixed for dev, secret for sealed")
    make.add_argument("--jobs", type=int, default=2)
    make.add_argument("--csv", action="store_true", help="gzipped CSV instead of Parquet")
    make.set_defaults(run=_make)
    score = commands.add_parser("score", help="scores as they are published, with their goals")
    score.add_argument("verdicts")
    score.add_argument("key")
    score.add_argument("--kept", help="whole diagnoses of `--keep`: what simpler rules say")
    score.add_argument("--json", help="write all scores here")
    score.add_argument("--html", help="write the page here")
    score.add_argument(
        "--readme", action="append", default=[], help="put the tables between this file's markers"
    )
    score.add_argument("--answered-only", action="store_true", help="leave out the other cases")
    score.set_defaults(run=_score)
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
    deciding = commands.add_parser("decide", help="constants of the diagnosis's decision")
    deciding.add_argument("banks", nargs="+", help="development banks, keys beside them")
    deciding.add_argument("--out", required=True, help="folder for the answers of each case")
    deciding.add_argument("--as-is", action="store_true", help="shares of right answers only")
    deciding.add_argument("--cases", default="", help="only these, as case-001,case-007")
    deciding.add_argument("--write", action="store_true", help="write them to the package")
    deciding.set_defaults(run=_decide)
    again = commands.add_parser("follow", help="run a recommended experiment on a case's bench")
    again.add_argument("bank")
    again.add_argument("key")
    again.add_argument("case")
    again.add_argument("program", help="CSV of what to do, see docs/withheld.md")
    again.set_defaults(run=_follow)


def _check_ups(commands: _Commands) -> None:
    play = commands.add_parser("play", help="a bank of check-ups: a programme, good and now")
    play.add_argument("bank", help="the folder to make; its key goes beside it")
    play.add_argument("--programme", required=True, help="folder of the programme's files")
    play.add_argument("--cases", type=int, default=66)
    play.add_argument("--benches", type=int, default=6)
    play.add_argument("--repeats", type=int, default=2, help="good repeats of each bench")
    play.add_argument("--seed", type=int, help="default: 28; secret for sealed")
    play.add_argument("--sealed", action="store_true", help="with effects nobody has looked at")
    play.add_argument("--mixture", choices=tuple(playing.MIXTURES), default="scores")
    play.add_argument("--jobs", type=int, default=2)
    play.set_defaults(run=_play)
    fitted = commands.add_parser("calibrate", help="constants of the check-up from banks")
    fitted.add_argument("banks", nargs="+", help="development banks of `play`, keys beside them")
    fitted.add_argument("--kept", required=True, help="folder for what the check-ups found")
    fitted.add_argument("--out", help="write them to this TOML")
    fitted.add_argument("--benches", default="", help="only these, separated by commas")
    fitted.add_argument("--jobs", type=int, default=1, help="benches at a time")
    fitted.set_defaults(run=_calibrate)
    curves = commands.add_parser("curves", help="scores of check-ups over strength")
    curves.add_argument("verdicts", help="what `check-up` wrote")
    curves.add_argument("key", help="the folder of the bank's key")
    curves.add_argument("--page", help="put the tables between the marks of this page")
    curves.add_argument("--note", default="", help="a line above them, with --page")
    curves.add_argument("--mark", default="scores", help="which marks of the page")
    curves.set_defaults(run=_curves)
    several = commands.add_parser("beside", help="verdict files of one bank, a row each")
    several.add_argument("key", help="the folder of the bank's key")
    several.add_argument("verdicts", nargs="+", metavar="LABEL=FILE")
    several.add_argument("--title", default="verdicts", help="head of the first column")
    several.add_argument("--page", help="put the table between the marks of this page")
    several.add_argument("--mark", default="repeats", help="which marks of the page")
    several.add_argument("--note", default="", help="a line above it, with --page")
    several.set_defaults(run=_beside)
    judged = commands.add_parser("check-up", help="judge a bank of `play` with the product")
    judged.add_argument("bank")
    judged.add_argument("--out", required=True, help="the verdicts, for `score`")
    judged.add_argument("--benches", default="", help="only these, as bench-1,bench-4")
    judged.add_argument("--repeats", type=int, help="only so many of the good repeats")
    judged.add_argument("--jobs", type=int, default=1, help="benches at a time")
    judged.add_argument(
        "--leave-out", metavar="KEY",
        help="judge single effects once more, the right entry out of the library; the key's folder",
    )  # fmt: skip
    judged.set_defaults(run=_check_up)


def _mysteries(commands: _Commands) -> None:
    mystery = commands.add_parser("mystery", help="a bench on a pty with a hidden effect")
    mystery.add_argument("seed", type=int)
    mystery.add_argument("--good", action="store_true", help="the same bench before the trouble")
    mystery.add_argument("--day", type=int, default=0, help="another day of the same bench")
    mystery.add_argument(
        "--paced-by-host",
        action="store_true",
        help="armed, wait for each setpoint, and else hurry: as fast as the machine goes",
    )
    mystery.add_argument(
        "--with-parent", action="store_true", help="end with the process that started it"
    )
    mystery.add_argument("--link", help="make a symbolic link to the pty here")
    mystery.add_argument("--note", default=str(quiz.NOTE), help="where the sealed note goes")
    mystery.set_defaults(run=_mystery)
    asked = commands.add_parser("inquiries", help="`investigate` on mystery benches, scored")
    asked.add_argument("seeds", type=int, nargs="*", help="of the benches; none: the table only")
    asked.add_argument("--programme", default="smad/gap/paired/data/spring-pair")
    asked.add_argument("--minutes", type=float, default=20.0, help="bench time for each")
    asked.add_argument("--out", required=True, help="folder for what became of each")
    asked.add_argument("--page", help="put the table between the marks of this page")
    asked.add_argument("--note", default="", help="a line above it, with --page")
    asked.set_defaults(run=_inquiries)
    live = commands.add_parser("mysteries", help="the same over the wire, with the daemon")
    live.add_argument("seeds", type=int, nargs="*", help="of the benches; none: the table only")
    live.add_argument("--minutes", type=float, default=20.0, help="bench time for each")
    live.add_argument("--quick", action="store_true", help="commission the quick part only")
    live.add_argument(
        "--days", type=int, choices=(1, 2), default=2, help="days of the two good repeats"
    )
    live.add_argument("--out", required=True, help="folder for what became of each")
    live.add_argument("--page", help="put the table between the marks of this page")
    live.add_argument("--note", default="", help="a line above it, with --page")
    live.set_defaults(run=_over_the_wire)
    reveal = commands.add_parser("reveal", help="open the answer of the last mystery")
    reveal.add_argument("--note", default=str(quiz.NOTE))
    reveal.set_defaults(run=_reveal)


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
