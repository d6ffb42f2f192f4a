"""Faulty records that people published, each as a small input of our own, and what smad says.

`python -m tests.smad.records.cases` makes the inputs, gives each command and prints its answer;
`test_cases.py` holds the answers to what is right. Numbers are those of the list of cases.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pythonfmu.builder import FmuBuilder

from smad.cli import execute
from tests.smad.fmi.heater import MAP, run_file
from tests.smad.records.kinds import as_csv, as_log, pair

UNIT = Path(__file__).parent.parent / "fmi" / "heater_unit.py"
BROKEN_UNITS = {
    "heater_stops": [("self.temperature < 1e4", "self.temperature < 42.0")],
    "heater_keeps": [
        ("    def exit_init", "    kept = 22.0\n\n    def exit_init"),
        ("self.temperature = self.room\n\n    def do_step",
         "self.temperature = Heater.kept\n\n    def do_step"),
        ("given / self.capacity", "given / self.capacity\n        Heater.kept = self.temperature"),
    ],
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A command on an input, the status it ends with, and words that it says."""

    number: int
    title: str
    command: str
    status: int
    words: tuple[str, ...]


D = "gap diagnose {0}/{1}0.csv {0}/{1}1.csv {0}/{1}2.csv --fmu {0}/{2}.fmu --map {0}/{3}.toml"


def asked(runs: str, unit: str = "heater", mapped: str = "map") -> str:
    return D.format("{folder}", runs, unit, mapped)


SEES = "other values of the parameters explain it"
CASES = (
    Case(0, "records without a fault", asked("plain"), 0, (SEES,)),
    Case(1, "a number of one locale read in another",
         "log import {folder}/german.csv --mapping {folder}/german.toml", 1,
         ("line 4: column 'current_x_mA' is not a number; got 1.500", '`thousands = "."`')),
    Case(1, "the same, with the sign of thousands declared",
         "log import {folder}/german.csv --mapping {folder}/thousands.toml", 0, ("3 rows to",)),
    Case(2, "an input outside its declared range", asked("counts"), 3,
         ("holds 0 to 229, declared 0 to 50 W: counts of 8 bits? give `scale = 0.196078`",)),
    Case(5, "a pause of three seconds, inputs unknown in it", asked("pause"), 0,
         (SEES, "what was applied from 39.9 to 43 s is not recorded: the run is used up to 39.9")),
    Case(7, "the code of a sensor as a reading", asked("code"), 0,
         (SEES, "temperature_degC holds -127 in 3 samples", "holds 85 in one sample")),
    Case(8, "a model that stops inside a run", asked("plain", "heater_stops"), 3,
         ("the model gives no number for temperature_degC from", "mend it there, or leave the run",
          "plain0: ", "plain1: ", "plain2: ")),
    Case(10, "a replay that is not repeatable", asked("plain", "heater_keeps"), 1,
         ("gives another temperature_degC for the same run and values; got up to",
          "keep no state from one call to the next")),
    Case(12, "a unit in the name of the time", asked("ms", mapped="ms"), 0, (SEES,)),
    Case(12, "a time without a unit whose step makes no sense", asked("noms", mapped="noms"), 1,
         ("column 'time' has no unit, and its samples would be seconds apart; got 100 s",
          'time_unit = "ms"')),
    Case(13, "a decimal comma, told by [csv] in the map", asked("comma", mapped="comma"), 0,
         (SEES,)),
    Case(13, "the same, not told", asked("comma"), 1,
         ("line 2: column 't_s' is not a number; got 0,0", "--map of smad gap diagnose)")),
    Case(13, "the same of the spring pair, told by --map alone (1.1 s long)",
         "gap diagnose {folder}/pair.csv --map {folder}/german.toml", 3,
         ("at least 8 s are needed",)),
    Case(13, "the same, not told", "gap diagnose {folder}/pair.csv", 1,
         ("is not a number; got 0,01", "under [csv]", "--map of smad gap diagnose)")),
    Case(14, "an input logged on change", asked("change"), 3,
         ("power_W holds a reading in", "of 600 samples only", "`hold = true`")),
    Case(14, "the same, with `hold = true`", asked("change", mapped="hold"), 0, (SEES,)),
    Case(15, "capital letters, and files that are passed over",
         "gap diagnose {folder}/capitals --fmu {folder}/heater.fmu --map {folder}/map.toml", 0,
         (SEES, "capitals: read 3 runs, passed over notes.txt")),
    Case(17, "a byte order mark in a mapping file",
         "log import {folder}/german.csv --mapping {folder}/marked.toml", 0, ("3 rows to",)),
    Case(17, "a byte order mark in a map", asked("plain", mapped="marked_map"), 0, (SEES,)),
    Case(17, "a byte order mark in a configuration", "config check {folder}/marked_config.toml", 0,
         ()),
    Case(18, "names in a comment, as savetxt writes them", "log import {folder}/savetxt.csv", 0,
         ("2 rows to", "temp_x_degC rtd_x_degC")),
    Case(18, "a line `sep=;` before the names", "log import {folder}/sep.csv", 0, ("2 rows to",)),
    Case(26, "stamps of ISO 8601", "log import {folder}/iso.csv", 0,
         ("2 rows to", "the time is column 'time_s', in s since its first stamp")),
    Case(24, "a log that was cut", "log recover {folder}/cut.mcap", 0, ("cut.recovered.mcap",)),
    Case(25, "a step that is on from the first row", asked("const"), 0,
         ("so the state that the model begins in decides temperature_degC; add runs",)),
    *(
        Case(26, f"{what} where a number should be", f"log import {{folder}}/{name}.csv", 1,
             (f"line {line}: column {column!r} is not a number; got",))
        for what, name, line, column in (
            ("a duration", "duration", 2, "time_s"),
            ("h:mm:ss", "clock", 3, "time_s"), ("a dash", "dash", 3, "temp_x_degC"),
            ("a line of names", "twice", 4, "time_s"),
        )
    ),
)  # fmt: skip

Change = Callable[[list[list[str]]], list[list[str]]]


def changed(folder: Path, name: str, change: Change, joined: str = ",") -> None:
    """Three runs of the heater under another name, each changed as rows of cells, names first."""
    for seed in range(3):
        run = run_file(folder / "plain.tmp", seed, capacity=31.0)
        rows = change([line.split(",") for line in run.read_text().splitlines()])
        text = "\n".join(joined.join(row) for row in rows) + "\n"
        (folder / f"{name}{seed}.csv").write_text(text)


def cell(row: int, column: int, text: str) -> Change:
    def change(rows: list[list[str]]) -> list[list[str]]:
        rows[row][column] = text
        return rows

    return change


def coded(rows: list[list[str]]) -> list[list[str]]:
    for row, text in ((50, "85"), (101, "-127"), (340, "-127"), (341, "-127")):
        rows[row][2] = text
    return rows


def scaled(column: int, factor: float, name: str) -> Change:
    def change(rows: list[list[str]]) -> list[list[str]]:
        head, *body = rows
        for row in body:
            row[column] = f"{float(row[column]) * factor:.0f}"
        head[column] = name
        return rows

    return change


def on_change(rows: list[list[str]]) -> list[list[str]]:
    before = ""
    for row in rows[1:]:
        before, row[1] = row[1], "" if row[1] == before else row[1]
    return rows


def constant(rows: list[list[str]]) -> list[list[str]]:
    """Power that is on from the first row, and how a plate of 31 J/K and 0.74 W/K warms."""
    plate = 22.0
    for row in rows[1:]:
        row[1:] = ["45", f"{plate:.2f}"]
        plate += 0.1 * (45.0 - 0.74 * (plate - 22.0)) / 31.0
    return rows


def prepare(folder: Path) -> None:
    """Make the units, maps and runs of all cases."""
    for name, changes in {"heater": [], **BROKEN_UNITS}.items():
        script = folder / name / f"{name}.py"
        script.parent.mkdir()
        text = UNIT.read_text()
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        script.write_text(text)
        FmuBuilder.build_FMU(script, dest=folder / f"{name}.fmu")
    held = MAP.replace('variable = "power"', 'variable = "power"\nhold = true')
    german = '[csv]\ndelimiter = ";"\ndecimal = ","\n'
    texts = {
        "map.toml": MAP,
        "ms.toml": 'time = "time_ms"\n' + MAP,
        "noms.toml": 'time = "time"\n' + MAP,
        "comma.toml": MAP + "\n" + german,
        "hold.toml": held,
        "marked_map.toml": "\ufeff" + MAP,
        "german.toml": german,
        "thousands.toml": german + 'thousands = "."\n',
        "marked.toml": "\ufeff" + german + 'thousands = "."\n',
        "marked_config.toml": "\ufeff[link]\nrate_hz = 100\n",
        "german.csv": "time_s;current_x_mA\n0,0;0\n0,1;850,5\n0,2;1.500\n",
        "savetxt.csv": "# time_s,temp_x_degC\n0.0e+00,2.2e+01\n1.0e+00,2.3e+01\n",
        "duration.csv": "time_s,temp_x_degC\nPT0S,22\nPT1S,23\n",
        "iso.csv": "time_s,temp_x_degC\n2026-11-25T10:00:00,22\n2026-11-25T10:00:01,23\n",
        "clock.csv": "time_s,temp_x_degC\n0,22\n0:00:01,23\n",
        "dash.csv": "time_s,temp_x_degC\n0,22\n1,-\n2,23\n",
        "twice.csv": "time_s,temp_x_degC\n0,22\n1,23\ntime_s,temp_x_degC\n2,24\n",
        "sep.csv": "sep=;\ntime_s;temp_x_degC\n0;22\n1;23\n",
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    changed(folder, "plain", lambda rows: rows)
    changed(folder, "counts", scaled(1, 255.0 / 50.0, "power_W"))
    changed(folder, "pause", lambda rows: rows[:401] + rows[431:])
    changed(folder, "code", coded)
    changed(folder, "ms", scaled(0, 1e3, "time_ms"))
    changed(folder, "noms", scaled(0, 1e3, "time"))
    changed(folder, "comma", lambda rows: [[c.replace(".", ",") for c in r] for r in rows], ";")
    short = {name: column[:110] for name, column in pair().columns.items()}
    text = as_csv(short, folder / "pair.csv").read_text().replace(",", ";").replace(".", ",")
    (folder / "pair.csv").write_text(text)
    changed(folder, "change", on_change)
    changed(folder, "const", constant)
    log = as_log(
        {name: column[:1000] for name, column in pair().columns.items()}, folder / "whole.mcap"
    )
    log.rename(folder / "whole.mcap.part")
    capitals = folder / "capitals"
    capitals.mkdir()
    for seed in range(3):
        text = (folder / f"plain{seed}.csv").read_text()
        (capitals / (f"LOG0000{seed}.CSV" if seed else "a.csv")).write_text(text)
    (capitals / "notes.txt").write_text("a note")


def answer(case: Case, folder: Path) -> tuple[int, str]:
    """The status of a case's command, and what it says."""
    for log in folder.glob("*.mcap"):
        log.unlink()
    whole = (folder / "whole.mcap.part").read_bytes()
    (folder / "cut.mcap").write_bytes(whole[: len(whole) * 3 // 4])
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = execute(case.command.format(folder=folder).split())
    return status, " ".join(said.getvalue().split())


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        prepare(folder)
        for case in CASES:
            status, said = answer(case, folder)
            right = status == case.status and all(word in said for word in case.words)
            print(f"{case.number:>2} {case.title}: {'right' if right else 'WRONG'}, {status}")
            print(f"   {said.replace(name, '…')[:300]}")


if __name__ == "__main__":
    main()
