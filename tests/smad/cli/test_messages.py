"""What a person types wrong is answered in words of what they typed."""

import os
from pathlib import Path

import pytest
from click.testing import CliRunner

from sim_device.errors import FaultSpecError
from sim_device.faults import FAULT_KINDS, parse_injection
from smad.cli import execute
from smad.cli.log import plot
from smad.cli.sim import sim
from smad.client.endpoints import Connection, running_benches, write_connection
from smad.config.bounds import in_words
from smad.errors import SmadError


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("stop", "There is no command 'stop'; did you mean smad disarm or smad estop? See smad"),
        ("statsu", "There is no command 'statsu'; did you mean status or start? See smad --help."),
        ("log shwo", "Did you mean 'show'? See smad log --help."),
        ("pump x 50", "'50' is not within 0 to 1 (0% to 100%)"),
        ("pump x 101%", "'101%' is not within 0 to 1 (0% to 100%)"),
        ("pump x nan", "'nan' is not a finite number"),
        ("pump x full", "'DUTY': 'full' is not a number"),
        ("move step 5000", "'DISPLACEMENT_MM': 5000 mm: it has to be at most 50 mm"),
        ("move step 5000 --deg", "'DISPLACEMENT_MM': 800 mm: it has to be at most 50 mm"),
        ("move sine 2 -7", "'PERIOD_S': -7 s: it has to be above 0 s"),
        ("move sine 2 7 --cycles 0", "'--cycles': 0: it has to be at least 1"),
        ("heat x 500", "'DEGC': 500 °C: it has to be at most 120 °C"),
        ("heat x 50 --for -1", "'--for': -1 s: it has to be above 0 s"),
        ("current y 50", "'A': 50 A: it has to be at most 4 A"),
        ("clear nosuch", "there is no fault 'nosuch'; there are 31; smad faults list shows them."),
        ("clear over-temprature", "there is no fault 'over-temprature'; did you mean "),
        ("clear 0", "there is no fault '0'"),
        ("link test --for 2h", "'2h' is not within 0.01 to 3600 s"),
        ("design --wire 2kg", "'2kg': give it in mm, alone or with m, cm, mm, um (µm), in."),
        ("robot circle a 400", "'400' is not within 0 to 180 °"),
        ("log plot a.mcap --width 2cm", "'2cm' is not within 40 to 400 mm. See"),
        ("log plot a.mcap --width nan", "'nan' is not a finite number. See"),
        ("queue resume --hours 0", "'0' is not above 0, up to 744 h. See"),
        ("queue resume --cycles 0", "'0' is not above 0. See"),
        ("queue messages --after -1", "'-1' is not at least 0. See"),
        ("demo --seed 1.5", "'1.5' is not a whole number. See"),
        ("demo --seed 5s", "'5s' is not a whole number. See"),
        ("run endurance --cycles 9 --end-place 5", "'5' is not above 0, up to 1. See"),
        ("queue remove x", "'x' is not a whole number. See"),
        (
            "params set cold_cC 3A",
            "'3A': give it in cC, alone or with K, degC (°C), degF (°F), cC.",
        ),
        ("params set jump_cC 40F", "'40F': give it in cC or °C"),
        ("params set cold_cC warm", "'warm' is not a number of cC. See"),
        ("record last --seconds soon", "'soon' is not a number of s"),
        ("record last --seconds -5", "'-5' is not within 1 to 600 s"),
        ("heat x 50 --for 1,5s", "'1,5s': a number has a decimal point and no comma, as 1.5."),
        ("move step -1,5", "'-1,5': a number has a decimal point"),
        ("health --folder . --limit stroke_mm=nan", "'nan' is not a finite number"),
        ("health --folder . --limit stroke_mm=8,5", "'8,5': a number has a decimal point"),
        ("tune --yes --spring y", "--spring is for the temperature loop; leave it out."),
    ],
)
def test_a_slip_is_answered_in_words(
    words: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert execute(words.split()) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("name", ["run.mcap", "Run.CSV", "run.parquet"])
def test_what_is_written_never_replaces_a_recording(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / name
    run.write_text("t_s\n0\n")
    for words in (
        f"gap diagnose {run} --apply",
        f"gap diagnose {run} --json",
        f"gap checkup --baseline {tmp_path} --report",
        f"log plot {run} -o",
        "run dsc --sim --report",
        "design --report",
    ):
        assert execute([*words.split(), str(run)]) == 2
        assert "is a recording, and would be lost. Name another file" in capsys.readouterr().err
    assert run.read_text() == "t_s\n0\n"


def test_what_is_written_replaces_no_file_that_the_command_reads_or_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("run.csv", "mine.toml", "verdict.json"):
        (tmp_path / name).write_text("text")
    for words, told in (
        ("gap diagnose run.csv --map mine.toml --apply ./mine.toml", "'--map'"),
        ("gap diagnose run.csv --params mine.toml --apply mine.toml", "'--params'"),
        ("gap diagnose run.csv --json out --report out", "'--report'"),
        ("gap apply verdict.json --out verdict.json", "'VERDICT'"),
        ("design mine.toml --report mine.toml", "'[GEOMETRY]'"),
        ("run dsc --sim --parameters mine.toml --save-parameters mine.toml", "'--parameters'"),
    ):
        assert execute(words.split()) == 2
        said = capsys.readouterr().err
        assert f"is the file of {told}, too, and would be replaced. Name another file" in said
    assert (tmp_path / "mine.toml").read_text() == "text"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("run dsc --jobs 2", "--jobs needs --sim; add --sim, or leave --jobs out."),
        ("run dsc --sim --air", "--air and --sim exclude each other; leave --air out, or --sim."),
        ("run dsc --sim --from a.mcap", "--from and --sim exclude"),
        ("run repeat a.mcap --sim --as-is", "--as-is and --sim exclude"),
        ("run repeat a.mcap --seed 0", "--seed needs --sim"),
        ("run endurance --cycles 9 --sim --spring y", "--spring needs --temperature"),
        ("run endurance --cycles 9 --baseline good", "--baseline needs --every"),
        ("gap checkup --good . --now . --quick", "--quick needs --baseline"),
        ("gap checkup --baseline . --now . --out b", "--out and --now exclude"),
        ("gap next --run pulses --folder a", "--folder needs --sim"),
        ("gap next --map pyproject.toml", "--map need RUNs"),
        ("gap plan --mjcf README.md --map README.md --params B", "--mjcf and --params exclude"),
        ("log plot a.mcap --figure a.svg -o a.html", "--output and --figure exclude"),
        ("log plot a.mcap --width 90", "--width needs --figure"),
        ("log list here --folder there", "--folder and PATH exclude"),
        ("model export a.toml --fmi a.fmu --params B", "--params and MODEL exclude"),
        ("sim --speed nan", "'nan' is not a finite number"),
    ],
)
def test_an_option_that_would_be_ignored_is_refused(
    words: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert execute(words.split()) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("words", ["design none.toml", "model export none.toml --fmi a.fmu"])
def test_a_file_that_is_not_there_is_told_with_what_to_give(
    words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert execute(words.split()) == 1
    assert (
        "none.toml cannot be read (No such file or directory); give a " in capsys.readouterr().err
    )


def test_one_of_a_kind_is_told_in_the_singular(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for rows, told in (("0,0\n", "1 row to "), ("0,0\n1,0\n", "2 rows to ")):
        (tmp_path / "run.csv").write_text(f"t_s,force_N\n{rows}")
        assert execute(["log", "import", "run.csv", "-o", f"{len(rows)}.mcap"]) == 0
        assert capsys.readouterr().out.startswith(told)


def test_a_range_without_an_end_is_told_by_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run.csv").write_text("t_s,force_N\n0,0\n1,0\n")
    execute(["log", "import", "run.csv"])
    for words, told in (
        ("--from 500", "got at least 500 s"),
        ("--to -1", "got at most -1 s"),
        ("--from 500 --to 600", "got 500 to 600 s"),
    ):
        assert execute(["log", "plot", "run.mcap", *words.split()]) == 1
        assert told in capsys.readouterr().err


def test_the_help_shows_ranges_as_messages_do() -> None:
    shown = " ".join(CliRunner().invoke(plot, ["--help"]).output.split())
    assert "[40 to 400 mm]" in shown
    assert "<=" not in shown


def test_fault_list_names_every_fault_and_an_unknown_one_is_told_them_too() -> None:
    listed = CliRunner().invoke(sim, ["--fault", "list"]).output.splitlines()
    assert [line.split()[0] for line in listed[1:]] == list(FAULT_KINDS)
    with pytest.raises(FaultSpecError, match="no fault is named 'nosuch'; there are "):
        parse_injection("nosuch")
    with pytest.raises(FaultSpecError, match="gives no time"):
        parse_injection("stall")


@pytest.mark.parametrize(
    ("schema", "words"),
    [
        ("Expected `float` <= 1.0", "it has to be at most 1"),
        ("Expected `int` >= 1", "it has to be at least 1"),
        ("Expected `array` of length >= 1", "it has to be a list of at least 1"),
        ("Expected `str` of length >= 1", "it has to be text of at least 1 character"),
        ("Expected `float` > 0.0", "it has to be above 0"),
        ("Expected `bool`, got `str`", "it has to be true or false, not text"),
        ("Expected `float`, got `null`", "it has to be a number, not nothing"),
        ("Invalid enum value 'z'", "Invalid enum value 'z'"),
    ],
)
def test_a_bound_is_told_without_the_words_of_a_schema(schema: str, words: str) -> None:
    assert in_words(schema) == words


@pytest.mark.parametrize(
    ("typed", "meant"), [("mark", "smad record note"), ("checkup", "smad gap checkup")]
)
def test_a_word_of_a_group_is_answered_with_the_whole_command(
    typed: str, meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert execute([typed]) == 2
    assert f"did you mean {meant}?" in capsys.readouterr().err


def test_only_benches_whose_daemon_lives_are_named(tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text("{")
    for bench, pid in (("here", os.getpid()), ("gone", 2**22 + 1)):
        connection = Connection(
            bench=bench,
            pid=pid,
            version="1",
            command="ipc://c",
            stop="ipc://s",
            telemetry="ipc://t",
        )
        write_connection(tmp_path / f"{bench}.json", connection, 0o077)
    assert running_benches([tmp_path, tmp_path / "none"]) == ["here"]


def test_a_number_in_an_error_is_told_without_the_noise_of_its_last_digits() -> None:
    assert str(SmadError("too far", value=3.1660000000000004, limit=0.1 + 0.2)) == (
        "too far; got 3.166; allowed: 0.3"
    )
    assert "got 200.0" in str(SmadError("too far", value=200.0))
