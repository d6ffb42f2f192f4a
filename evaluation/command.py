"""The command line of the evaluation; every error ends in one sentence, not a traceback."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evaluation.bank import any_inputs, check_ups
from evaluation.bank.making import Order
from evaluation.errors import WithheldError
from evaluation.quiz import mystery
from smad.checkup.programme import SHIPPED
from smad.errors import SmadError

if TYPE_CHECKING:
    _Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def _make(options: argparse.Namespace) -> None:
    _reported(_any_inputs(options, options.bank, seed=options.seed))


def _any_inputs(options: argparse.Namespace, folder: Path, **more: Any) -> any_inputs.AnyInputs:
    return any_inputs.AnyInputs(
        folder=folder,
        changed=options.changed,
        differs=options.differs,
        jobs=options.jobs,
        minutes=options.minutes,
        **more,
    )


def _play(options: argparse.Namespace) -> None:
    _reported(_check_ups(options, options.bank, seed=options.seed, mixture=options.mixture))


def _check_ups(options: argparse.Namespace, folder: Path, **more: Any) -> check_ups.CheckUps:
    return check_ups.CheckUps(
        folder=folder,
        programme=options.programme,
        cases=options.cases,
        benches=options.benches,
        repeats=options.repeats,
        jobs=options.jobs,
        minutes=options.minutes,
        **more,
    )


def _reported(order: Order) -> str:
    sha256 = any_inputs.make(order) if isinstance(order, any_inputs.AnyInputs) else ""
    if isinstance(order, check_ups.CheckUps):
        sha256 = check_ups.make(order)
    if not sha256:
        print(f"{order.folder} is not finished: the same command goes on")
        return ""
    print(f"bank  {order.folder}")
    print(f"key   {order.key_folder / 'KEY.json'}")
    print(f"SHA-256 of the key  {sha256}")
    return sha256


def _seal(options: argparse.Namespace) -> None:
    from evaluation.score.openings import Ledger

    orders: dict[Order, int] = {
        _any_inputs(options, options.folder / "any-inputs", sealed=True): (
            options.changed + options.differs
        ),
        _check_ups(options, options.folder / "check-ups", sealed=True): options.cases,
    }
    for order, cases in orders.items():
        if not cases or (order.folder / "manifest.json").exists():
            continue
        sha256 = _reported(order)
        if not sha256:
            return
        Ledger.of().seal(sha256, f"{order.key_folder.name}/KEY.json")


def _usual(options: argparse.Namespace) -> None:
    from evaluation.bank.usual import usual

    for name in options.effects:
        print("{}  {:.3g}, {:.2f} floors".format(name, *usual(name)))


def _check(options: argparse.Namespace) -> None:
    from evaluation.run.running import run

    run(
        options.bank,
        options.out,
        benches=_named(options.benches),
        only=_named(options.only),
        repeats=options.repeats,
        key=options.leave_out,
        jobs=options.jobs,
        params=options.params,
        variant=options.variant,
    )


def _score(options: argparse.Namespace) -> None:
    from evaluation.score.scoring import run

    run(
        options.verdicts,
        options.key,
        out=options.out,
        title=options.title,
        note=options.note,
        answered_only=options.answered_only,
    )


def _recover(options: argparse.Namespace) -> None:
    from evaluation.recovery.running import run

    run(
        options.answers,
        seed=options.seed,
        only=options.only,
        count=options.cases,
        jobs=options.jobs,
        result_path=options.out,
        title=options.title or "Recovery on the simulator of the product",
        note=options.note,
    )


def _calibrate(options: argparse.Namespace) -> None:
    from evaluation.calibrate.command import calibrate

    calibrate(options.files, options.key, out=options.out, result=options.result)


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
    from smad.view.terminal.tables import print_table

    order = session.Order(options.minutes, options.quick, options.days, unchanged=options.unchanged)
    ends.run(options.seeds, options.folder, session.asked(options.folder, order, mystery.reveal))
    table = ends.table(ends.ended(options.folder))
    print_table(table)
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
        "design": "design the programme of the check-up",
    }


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m evaluation", description="Test the diagnosis on runs of known cause."
    )
    commands = parser.add_subparsers(required=True)
    for add in (_recovery, _banks, _runs, _constants, _quiz):
        add(commands)
    for name, about in _elsewhere().items():
        commands.add_parser(name, help=about)
    results = commands.add_parser("results", help="write the page of results from what is kept")
    results.add_argument("--check", action="store_true", help="only say whether it is stale")
    results.set_defaults(run=_results)
    return parser


def _banks(commands: _Commands) -> None:
    make = commands.add_parser("make", help="a bank of any inputs: what has changed, what differs")
    make.add_argument("bank", type=Path, help="the folder to make; its key goes beside it")
    make.add_argument("--seed", type=int, required=True)
    _of_any_inputs(make, changed=24, differs=8)
    make.set_defaults(run=_make)
    play = commands.add_parser("play", help="a bank of check-ups: a programme, good and now")
    play.add_argument("bank", type=Path, help="the folder to make; its key goes beside it")
    play.add_argument("--seed", type=int, required=True)
    play.add_argument("--mixture", choices=tuple(check_ups.MIXTURES), default="scores")
    _of_check_ups(play, cases=66, benches=6)
    play.set_defaults(run=_play)
    seal = commands.add_parser("seal", help="both kinds, seeds secret, effects nobody looked at")
    seal.add_argument("folder", type=Path, help="for banks and keys, outside of the repository")
    _of_any_inputs(seal, changed=60, differs=30)
    _of_check_ups(seal, cases=408, benches=24, once=False)
    seal.set_defaults(run=_seal)
    sizes = commands.add_parser("usual", help="the magnitude of effects near three floors")
    sizes.add_argument("effects", nargs="+", help="names of the plant's table")
    sizes.set_defaults(run=_usual)


def _of_any_inputs(command: argparse.ArgumentParser, changed: int, differs: int) -> None:
    command.add_argument("--changed", type=int, default=changed, help="cases with good runs")
    command.add_argument("--differs", type=int, default=differs, help="cases without")
    _of_all(command)


def _of_check_ups(
    command: argparse.ArgumentParser, cases: int, benches: int, *, once: bool = True
) -> None:
    command.add_argument("--programme", type=Path, default=SHIPPED, help="its folder, if another")
    command.add_argument("--cases", type=int, default=cases)
    command.add_argument("--benches", type=int, default=benches)
    command.add_argument("--repeats", type=int, default=2, help="good repeats of each bench")
    if once:
        _of_all(command)


def _of_all(command: argparse.ArgumentParser) -> None:
    command.add_argument("--jobs", type=int, default=2)
    command.add_argument(
        "--minutes", type=float, default=float("inf"), help="stop after so long; go on later"
    )


def _runs(commands: _Commands) -> None:
    check = commands.add_parser("check", help="judge a bank with the product; goes on from V")
    check.add_argument("bank", type=Path, help="a bank of `make` or `play`, or one of your own")
    check.add_argument("--out", type=Path, required=True, metavar="V", help="the verdicts")
    check.add_argument("--only", default="", help="only these cases, as case-001,case-004")
    check.add_argument("--jobs", type=int, default=1, help="cases, or benches, at a time")
    check.add_argument("--params", default="A", help="of the model: a file, or A, B, conserving")
    check.add_argument("--variant", choices=("extended", "printed"), default="extended")
    check.add_argument("--benches", default="", help="of check-ups: only these, as bench-1,bench-4")
    check.add_argument("--repeats", type=int, help="of check-ups: only so many good repeats")
    check.add_argument(
        "--leave-out",
        metavar="KEY",
        type=Path,
        help="judge single effects once more, the right entry out of the library; the key's folder",
    )
    check.set_defaults(run=_check)
    score = commands.add_parser("score", help="scores as they are published, with their goals")
    score.add_argument("verdicts", type=Path)
    score.add_argument("key", type=Path)
    score.add_argument("--answered-only", action="store_true", help="leave out the other cases")
    _kept_as(score)
    score.set_defaults(run=_score)


def _recovery(commands: _Commands) -> None:
    recover = commands.add_parser("recover", help="the product's simulator with known effects")
    recover.add_argument("answers", type=Path, help="file of the answers; goes on from it")
    recover.add_argument("--seed", type=int, default=1)
    recover.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="QUESTION",
        help="differs, changed or check-up; may be given twice",
    )
    recover.add_argument("--cases", type=int, help="only so many of each question, of all kinds")
    recover.add_argument("--jobs", type=int, default=1, help="cases at a time")
    _kept_as(recover)
    recover.set_defaults(run=_recover)


def _kept_as(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, help="keep it: evaluation/results/NAME.json")
    command.add_argument("--title", default="", help="its heading, with --out")
    command.add_argument("--note", default="", help="what it is of, with --out")


def _constants(commands: _Commands) -> None:
    fitted = commands.add_parser("calibrate", help="constants from development banks")
    fitted.add_argument("files", type=Path, nargs="+", help="files of `recover` and of `check`")
    fitted.add_argument(
        "--key", type=Path, action="append", default=[], help="KEY.json of a bank; one for each"
    )
    fitted.add_argument("--out", type=Path, help="write them to this TOML")
    fitted.add_argument("--result", type=Path, help="keep what they are worth in this JSON")
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
    many.add_argument("--unchanged", action="store_true", help="nothing is wrong with any of them")
    many.add_argument("--folder", type=Path, required=True, help="for what became of each")
    _kept_as(many)
    many.set_defaults(run=_mysteries)
    reveal = commands.add_parser("reveal", help="open the answer of the last mystery")
    reveal.add_argument("--note", type=Path, default=mystery.NOTE)
    reveal.set_defaults(run=_reveal)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command; exits with 2 and one sentence on an error, with 130 when interrupted."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    try:
        match words[:1]:
            case ["design"]:
                from evaluation.programme.design import main as design

                design(words[1:])
            case _:
                options = _arguments().parse_args(words)
                options.run(options)
    except (WithheldError, SmadError) as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("\nstopped; the same command goes on with what is not finished", file=sys.stderr)
        raise SystemExit(130) from None
