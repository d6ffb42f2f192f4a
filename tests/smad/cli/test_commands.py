"""What the commands print, and how they fail: one line, a status, never a traceback."""

import asyncio
import errno
import io
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import msgspec
import numpy as np
import pytest

from sim_device.plant import Inputs, load_parameters, simulate
from sim_device.plant.laws import Law, Term
from sim_device.plant.models import save_model
from smad import api
from smad.cli import COMMANDS, LazyGroup, execute, main, root
from smad.client import Client
from smad.client.endpoints import new_key_file
from smad.client.following import follow
from smad.config import Config
from smad.processes.boards import build
from smad.runlog.schema import Row
from smad.view.state import bench_state
from smad.view.terminal.progress import Progress
from smad.view.terminal.status_lines import lines, motion_words
from tests.smad.fakedaemon import MOTION, FakeDaemon, fake_daemon
from tests.smad.runlog.helpers import write_small_run

SPREAD = api.Percentiles(count=10, p50_us=30.0, p99_us=60.0, p999_us=90.0, max_us=99.0)
STATUS = api.Status(
    bench="bench",
    version="0",
    pid=7,
    uptime_s=12.0,
    memory_MiB=60.0,
    link=api.LinkStatus(
        port="/dev/pts/9",
        baud=115200,
        rate_hz=100,
        state="running",
        notes=("low latency not granted",),
        bytes_in=1,
        bytes_out=1,
        short_writes=0,
        losses=0,
        frames={"crc_errors": 0},
        board_stats={},
    ),
    board=api.Board(
        uid="00",
        firmware="smad-sim",
        protocol="1.0",
        reset_cause="power on",
        boot_count=1,
        capabilities=("encoder", "force_sensor"),
        schema_agrees=True,
        params_agree=True,
    ),
    motion=MOTION,
    limiter="none",
    faults=(),
    warnings=(),
    sample=Row(t_s=1.0, displacement_mm=1.25, rtd_x_degC=30.0),
    counts=api.Counts(
        samples=100,
        missed=0,
        skipped=0,
        setpoints=100,
        setpoints_dropped=0,
        setpoints_refused=0,
        commands=3,
        refused=0,
        telemetry_dropped=0,
    ),
    timing=api.Timing(
        own_share=SPREAD, setpoint_age=SPREAD, jitter=SPREAD, round_trip_us=500.0, collections=0
    ),
    realtime=(api.Measure("SCHED_FIFO", True, False, "refused (Operation not permitted)"),),
    recorder=api.RecorderStatus(recording=True, path="runs/a.mcap", rows=100),
    control=api.Control(),
    events=(api.Entry(0.0, "connected"),),
)


@pytest.fixture
def daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeDaemon]:
    monkeypatch.setenv("SMAD_RUNTIME_DIR", str(tmp_path))
    with fake_daemon(tmp_path) as daemon:
        daemon.answers["status"] = STATUS
        yield daemon


@pytest.fixture
def nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SMAD_RUNTIME_DIR", str(tmp_path))


def failed(capfd: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Run a command that must fail; return the one line it fails with."""
    assert execute(arguments) != 0
    complaint = capfd.readouterr().err.strip().splitlines()
    assert len(complaint) == 1
    assert complaint[0].startswith("smad: ")
    return complaint[0]


def test_every_command_of_the_table_exists_and_has_help() -> None:
    assert isinstance(root, LazyGroup)
    for name in COMMANDS:
        command = root.get_command(None, name)  # type: ignore[arg-type]
        assert command is not None, name
        assert command.get_short_help_str(200), name


def test_no_line_in_a_list_of_commands_is_cut(capfd: pytest.CaptureFixture[str]) -> None:
    for name in ("", *COMMANDS):
        assert execute([*name.split(), "--help"]) == 0
        assert "..." not in capfd.readouterr().out.partition("Commands:")[2], name


def test_a_letter_that_the_terminal_lacks_ends_no_command(monkeypatch: pytest.MonkeyPatch) -> None:
    printed = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(printed, "latin-1"))
    with pytest.raises(SystemExit) as ended:
        main(["start", "--help"])
    assert ended.value.code == 0
    assert rb"/dev/serial/by-id/\u2026" in printed.getvalue()


def test_no_colours_are_printed_where_none_are_wanted(
    daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    for wanted, escapes in (("", True), ("1", False)):
        monkeypatch.setenv("NO_COLOR", wanted)
        assert execute(["status"]) == 0
        assert ("\x1b[" in capfd.readouterr().out) is escapes


def test_status_is_quick_to_import() -> None:
    heavy = ("numpy", "scipy", "matplotlib", "numba", "pyarrow", "mcap", "asyncio", "jinja2")
    code = (
        "import sys, smad.cli, smad.cli.status, smad.client\n"
        f"print([name for name in {heavy!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.usefixtures("nobody")
@pytest.mark.parametrize(
    "arguments",
    [("status",), ("arm",), ("move", "step", "5"), ("params", "list"), ("record", "stop")],
)
def test_without_a_daemon_every_command_says_how_to_start_one(
    capfd: pytest.CaptureFixture[str], arguments: tuple[str, ...]
) -> None:
    assert "smad start --sim" in failed(capfd, *arguments)


def test_a_mistyped_command_is_one_line_with_where_to_look(
    capfd: pytest.CaptureFixture[str],
) -> None:
    assert "smad --help" in failed(capfd, "stauts")
    assert "smad move step --help" in failed(capfd, "move", "step", "five")


def test_a_mistake_of_ours_is_one_line_too(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def explode(**options: object) -> None:
        raise KeyError("injected")

    monkeypatch.setattr(root, "main", explode)
    line = failed(capfd, "config")
    assert "KeyError" in line
    assert "report" in line


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["gap", "next", "--sim", "--run", "mixed", "--folder", "{file}"], "cannot create folder"),
        (["gap", "next", "--sim", "--run", "mixed", "--folder", "{file}/x"], "Not a directory"),
        (["gap", "next", "--sim", "--run", "mixed", "--folder", "a\0b"], "NUL"),
        (["log", "list", "--folder", "{file}"], "Not a directory"),
        (["log", "list", "--folder", "a\0b"], "NUL"),
        (["log", "show", "a\0b"], "NUL"),
        (["config", "check", "a\0b"], "NUL"),
    ],
)
def test_a_path_that_cannot_be_used_is_one_line_and_no_mistake_of_ours(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.write_text("")
    assert execute([word.replace("{file}", str(file)) for word in arguments]) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert "internal error" not in error
    assert "\0" not in error


def test_a_refusal_is_printed_with_its_next_action(
    capfd: pytest.CaptureFixture[str], daemon: FakeDaemon
) -> None:
    daemon.answers["arm"] = api.ErrorData(
        reason=api.Reason.BOARD_REFUSED, cause="too hot", value=51.0, limit="45 °C", action="wait"
    )
    assert failed(capfd, "arm") == "smad: too hot; got 51.0; allowed: 45 °C; wait"


def test_status_shows_what_matters_and_what_was_not_granted(
    capfd: pytest.CaptureFixture[str], daemon: FakeDaemon
) -> None:
    assert execute(["status"]) == 0
    text = capfd.readouterr().out
    for words in ("ARMED", "1.250 mm", "low latency not granted", "no SCHED_FIFO", "p99 60 µs"):
        assert words in text
    assert "\x1b" not in text


def test_status_shows_a_fault_with_value_and_limit() -> None:
    fault = api.Fault(
        number=6, name="OVER_TEMPERATURE", channel="SPRING_X", measured=9050, limit=9000, unit="cC"
    )
    motion = msgspec.structs.replace(MOTION, armed=False, mode="FAULT", fault=fault)
    now = msgspec.structs.replace(STATUS, motion=motion, sample=None)
    text = "\n".join(line.text for line in lines(now))
    assert "OVER_TEMPERATURE at SPRING_X: 90.5 °C, limit 90 °C" in text
    assert "A spring got hotter than the limit" in text
    assert "Then smad clear." in text


def test_nothing_clears_an_estop_and_status_and_explanation_do_not_say_so(
    capfd: pytest.CaptureFixture[str],
) -> None:
    fault = api.Fault(number=30, name="ESTOP_PRESSED", channel="BOARD")
    motion = msgspec.structs.replace(MOTION, armed=False, mode="ESTOP", fault=fault)
    text = "\n".join(line.text for line in lines(msgspec.structs.replace(STATUS, motion=motion)))
    assert execute(["faults", "explain", "estop_pressed"]) == 0
    for said in (text, capfd.readouterr().out):
        assert "power-cycle the board" in said
        assert "smad clear" not in said


def test_a_motion_that_was_ended_early_is_not_called_done() -> None:
    ended = msgspec.structs.replace(MOTION, armed=False, ended="stopped by disarm of a client")
    now = msgspec.structs.replace(STATUS, motion=ended)
    for text in ("\n".join(line.text for line in lines(now)), now._repr_html_()):
        assert "idle, stopped by disarm of a client" in text


@pytest.mark.parametrize(
    ("ended", "told"), [("", "stopped"), ("stopped by the board", "stopped by the board")]
)
def test_a_motion_that_a_fault_ended_is_not_called_under_way(ended: str, told: str) -> None:
    fault = api.Fault(number=6, name="OVER_TEMPERATURE")
    motion = msgspec.structs.replace(MOTION, armed=False, done=False, fault=fault, ended=ended)
    now = msgspec.structs.replace(STATUS, motion=motion)
    assert bench_state(now).running == f"idle, {told}"
    assert f"idle, {told}" in now._repr_html_()


@pytest.mark.parametrize(("age_s", "shown"), [(0.02, ""), (6.2, " (6 s old)")])
def test_every_reading_of_a_lost_link_is_shown_with_its_age(age_s: float, shown: str) -> None:
    row = Row(t_s=1.0, displacement_mm=1.25, rtd_x_degC=30.0, rtd_y_degC=25.0, i_meas_x_A=2.0)
    motion = msgspec.structs.replace(MOTION, sample_age_s=age_s)
    now = msgspec.structs.replace(STATUS, motion=motion, sample=row)
    told = (line.text for line in lines(now))
    readings = [line for line in told if "°C" in line or "mm," in line]
    assert len(readings) == 4
    assert all(line.endswith(shown) and ("old" in line) == bool(shown) for line in readings)
    assert motion_words(motion).startswith(f"idle, board ARMED, at 1.25 mm{shown}")


class Follower:
    """Keeps the first status, and ends with it."""

    def __init__(self) -> None:
        self.told: list[api.Status] = []

    def on_config(self, config: Config) -> None: ...
    def on_sample(self, axis: str, data: bytes) -> None: ...
    def on_unreachable(self, why: str) -> None: ...
    def on_status(self, status: api.Status) -> None:
        self.told.append(status)
        raise KeyError


def test_who_follows_a_bench_of_one_axis_with_a_name_gets_it_by_that_name(
    daemon: FakeDaemon,
) -> None:
    daemon.answers["config"] = api.ConfigText(toml="[[axes]]\nname = 'pitch'\n")
    param = api.Param(name="cold_cC", value=4500.0, minimum=3000.0, maximum=4500.0)
    daemon.answers["params.list"] = api.ParamList(params=(param,))
    follower, params = Follower(), dict[str, Mapping[str, float]]()
    with pytest.raises(ExceptionGroup):
        asyncio.run(follow("bench", follower, 0.0, params.__setitem__))
    assert follower.told[0].of("pitch").motion == MOTION
    assert params == {"pitch": {"cold_cC": 4500}}


def test_who_follows_a_daemon_without_telemetry_gets_the_status_and_reads_no_parameters(
    daemon: FakeDaemon,
) -> None:
    daemon.answers["config"] = api.ConfigText(toml="")
    path = daemon.endpoints.connection_file
    connection = json.loads(path.read_bytes())
    path.write_text(json.dumps({**connection, "telemetry": ""}))
    follower = Follower()
    with pytest.raises(ExceptionGroup):
        asyncio.run(follow("bench", follower, 0.0))
    assert follower.told
    assert "params.list" not in {asked["method"] for asked in daemon.asked}


def test_status_as_json_is_the_whole_status(
    capfd: pytest.CaptureFixture[str], daemon: FakeDaemon
) -> None:
    assert execute(["status", "--json"]) == 0
    text = capfd.readouterr().out
    assert msgspec.json.decode(text, type=api.Status) == STATUS
    assert json.loads(text)["counts"]["samples"] == 100


@pytest.mark.parametrize(
    ("arguments", "piece"),
    [
        (["step", "5"], {"kind": "step", "displacement_mm": 5.0, "duration_s": 10.0}),
        (["step", "-5"], {"kind": "step", "displacement_mm": -5.0, "duration_s": 10.0}),
        (["hold", "3"], {"kind": "hold", "duration_s": 3.0}),
        (["ramp", "5", "--rate", "1"],
         {"kind": "ramp", "displacement_mm": 5.0, "rate_mm_per_s": 1.0}),
        (["sine", "2", "7", "--cycles", "4"],
         {"kind": "sine", "amplitude_mm": 2.0, "period_s": 7.0, "cycles": 4, "offset_mm": 0.0}),
        (["chirp", "2", "0.1", "1"],
         {"kind": "chirp", "amplitude_mm": 2.0, "start_Hz": 0.1, "end_Hz": 1.0,
          "duration_s": 60.0, "offset_mm": 0.0}),
        (["staircase", "1", "5", "--back"],
         {"kind": "staircase", "step_mm": 1.0, "steps": 5, "dwell_s": 10.0,
          "there_and_back": True}),
        (["random", "4", "6", "--seed", "3"],
         {"kind": "random_levels", "amplitude_mm": 4.0, "levels": 6, "dwell_s": 10.0, "seed": 3,
          "offset_mm": 0.0}),
        (["step", "-25", "--deg"],
         {"kind": "step", "displacement_mm": -4.0, "duration_s": 10.0}),
        (["ramp", "25", "--rate", "12.5", "--deg"],
         {"kind": "ramp", "displacement_mm": 4.0, "rate_mm_per_s": 2.0}),
        (["sine", "12.5", "7", "--offset", "6.25", "--deg"],
         {"kind": "sine", "amplitude_mm": 2.0, "period_s": 7.0, "cycles": 3, "offset_mm": 1.0}),
        (["chirp", "12.5", "0.1", "1", "--offset", "6.25", "--deg"],
         {"kind": "chirp", "amplitude_mm": 2.0, "start_Hz": 0.1, "end_Hz": 1.0,
          "duration_s": 60.0, "offset_mm": 1.0}),
        (["staircase", "6.25", "5", "--deg"],
         {"kind": "staircase", "step_mm": 1.0, "steps": 5, "dwell_s": 10.0,
          "there_and_back": False}),
        (["random", "25", "6", "--deg"],
         {"kind": "random_levels", "amplitude_mm": 4.0, "levels": 6, "dwell_s": 10.0, "seed": 0,
          "offset_mm": 0.0}),
    ],
)  # fmt: skip
def test_each_motion_is_sent_as_its_piece(
    daemon: FakeDaemon, arguments: list[str], piece: dict[str, object]
) -> None:
    assert execute(["move", *arguments]) == 0
    sent = next(r for r in daemon.asked if r["method"] == "move")
    assert sent["params"]["trajectories"] == [piece]
    assert sent["params"]["queue"] is False


def test_a_csv_file_is_followed_from_its_first_time(daemon: FakeDaemon, tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("t_s,displacement_mm\n10,0\n11,2\n13,-1\n")
    assert execute(["move", "follow", str(path), "--no-wait"]) == 0
    piece = daemon.asked[0]["params"]["trajectories"][0]
    assert piece["t_s"] == [0.0, 1.0, 3.0]
    assert piece["displacement_mm"] == [0.0, 2.0, -1.0]


def test_a_csv_file_of_angles_is_followed_as_displacements(
    daemon: FakeDaemon, tmp_path: Path
) -> None:
    path = tmp_path / "angles.csv"
    path.write_text("t_s,angle_deg\n0,0\n1,25\n3,-12.5\n")
    assert execute(["move", "follow", str(path), "--no-wait"]) == 0
    piece = daemon.asked[0]["params"]["trajectories"][0]
    assert piece["displacement_mm"] == [0.0, 4.0, -2.0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,displacement_mm\n0,1\n", "t_s, displacement_mm or angle_deg"),
        ("t_s,angle\n0,1\n", "t_s, displacement_mm or angle_deg"),
        ("t_s,displacement_mm\n0,1\n", "at least 2, each later"),
        ("t_s,displacement_mm\n0,1\n1,nan\n", "line 3: displacement_mm is not a number"),
        ("", "an empty file"),
    ],
)
def test_a_csv_file_that_cannot_be_followed_is_refused_with_the_place(
    capfd: pytest.CaptureFixture[str], daemon: FakeDaemon, tmp_path: Path, text: str, words: str
) -> None:
    path = tmp_path / "points.csv"
    path.write_text(text)
    assert words in failed(capfd, "move", "follow", str(path))


@pytest.mark.parametrize("command", ["move follow", "gap apply --out model.toml"])
def test_a_file_without_an_end_is_refused(
    capfd: pytest.CaptureFixture[str], daemon: FakeDaemon, command: str
) -> None:
    assert "longer than 100 MB" in failed(capfd, *command.split(), "/dev/zero")


def test_a_motion_that_ends_early_fails_with_the_fault(
    capfd: pytest.CaptureFixture[str], daemon: FakeDaemon
) -> None:
    fault = api.Fault(number=6, name="OVER_TEMPERATURE")
    daemon.answers["motion"] = msgspec.structs.replace(
        MOTION, armed=False, done=False, mode="FAULT", fault=fault
    )
    assert "OVER_TEMPERATURE" in failed(capfd, "move", "step", "5")


@pytest.mark.parametrize("ended", [KeyboardInterrupt, OSError(errno.ENOSPC, "no room")])
def test_an_arming_that_is_interrupted_or_cannot_be_told_is_taken_back(
    daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch, ended: BaseException
) -> None:
    arm = Client.arm

    def interrupted(client: Client) -> None:
        arm(client)
        raise ended

    disarm, second = Client.disarm, iter([SystemExit(129)])

    def hung_up(client: Client) -> api.Motion:
        for signal in second:
            raise signal
        return disarm(client)

    monkeypatch.setattr(Client, "arm", interrupted)
    # A terminal that is closed sends two signals, one right after the other.
    monkeypatch.setattr(Client, "disarm", hung_up)
    assert execute(["arm"]) != 0
    assert [request["method"] for request in daemon.asked] == ["arm", "disarm"]


def test_an_arming_that_is_refused_stops_nobody(daemon: FakeDaemon) -> None:
    daemon.answers["arm"] = api.ErrorData(reason=api.Reason.ARMED, cause="the bench is armed")
    assert execute(["arm"]) == 1
    assert [request["method"] for request in daemon.asked] == ["arm"]


@pytest.mark.parametrize(
    ("words", "method"), [("move step 5 --no-wait", "move"), ("heat x 50 --for 5", "heat")]
)
def test_ctrl_c_ends_a_motion_that_is_still_being_sent(
    daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch, words: str, method: str
) -> None:
    send = getattr(Client, method)

    def interrupted(*arguments: object, **how: object) -> None:
        send(*arguments, **how)
        raise KeyboardInterrupt

    monkeypatch.setattr(Client, method, interrupted)
    assert execute(words.split()) == 130
    commanded = [r["method"] for r in daemon.asked if r["method"] != "status"]
    assert commanded == [method, "idle"]


def test_one_spring_is_heated_driven_or_cooled(daemon: FakeDaemon) -> None:
    assert execute(["heat", "y", "50", "--rate", "1", "--for", "5"]) == 0
    assert execute(["current", "x", "2", "--until", "45"]) == 0
    assert execute(["pump", "y", "0.5"]) == 0
    sent = {r["method"]: r["params"] for r in daemon.asked if r["method"] != "motion"}
    assert sent["heat"]["spring"] == "y"
    assert sent["heat"]["temperature_degC"] == 50.0
    assert sent["current"]["pump_y_duty"] == 0.5
    currents = [r["params"] for r in daemon.asked if r["method"] == "current"]
    assert (currents[0]["i_x_A"], currents[0]["stop_above_degC"]) == (2.0, 45.0)


@pytest.mark.parametrize(
    ("goal", "water_degC", "told"),
    [
        ("35F", 25.0, "1.7 °C is out of reach: a spring gets no colder than water and room, 25.0"),
        ("35C", 25.0, ""),
        ("24.5", 25.0, ""),
        ("35F", None, ""),
    ],
)
def test_a_temperature_below_water_and_room_is_told_to_be_out_of_reach(
    goal: str,
    water_degC: float | None,
    told: str,
    capfd: pytest.CaptureFixture[str],
    daemon: FakeDaemon,
) -> None:
    row = Row(t_s=1.0, rtd_inlet_degC=water_degC, rtd_ambient_degC=water_degC)
    daemon.answers["status"] = msgspec.structs.replace(STATUS, sample=row)
    assert execute(["heat", "x", goal]) == 0
    said = capfd.readouterr().err
    assert told in said if told else said == ""


def test_values_of_the_board_are_listed_in_units_as_everywhere(
    capfd: pytest.CaptureFixture[str], daemon: FakeDaemon
) -> None:
    units = {"force_uN_per_count": "uN", "i2t_budget_A2s": "A2s", "stuck_us": "us", "jump_cC": "cC"}
    daemon.answers["params.list"] = api.ParamList(
        params=tuple(
            api.Param(name=name, value=500.0, minimum=0, maximum=1000, unit=unit)
            for name, unit in units.items()
        )
    )
    assert execute(["params", "list"]) == 0
    listed = capfd.readouterr().out
    for words in ("500 µN = 0.5 mN", "500 A² s ", "500 µs = 0.0005 s", "500 cC = 5 °C"):
        assert words in listed


@pytest.mark.parametrize(
    ("typed", "name", "sent"),
    [
        ("3A", "current_limit_mA", 3000.0),
        ("3000", "current_limit_mA", 3000.0),
        ("43.7°C", "cold_cC", 4370.0),
        ("2.5s", "stuck_us", 2_500_000.0),
        ("-5", "encoder_offset_counts", -5.0),
    ],
)
def test_a_value_for_the_board_may_have_a_unit(
    typed: str, name: str, sent: float, daemon: FakeDaemon
) -> None:
    daemon.answers["params.set"] = api.Param(name=name, value=sent, minimum=0, maximum=1)
    assert execute(["params", "set", name, typed]) == 0
    assert daemon.asked[0]["params"] == {"name": name, "value": sent}


def test_the_link_test_fails_when_something_was_lost(
    capfd: pytest.CaptureFixture[str], daemon: FakeDaemon
) -> None:
    counts = msgspec.structs.replace(STATUS.counts, samples=300, missed=2)
    replies = [STATUS, msgspec.structs.replace(STATUS, counts=counts)]
    daemon.answers["status"] = lambda request: replies.pop(0)
    daemon.answers["timing.reset"] = STATUS.timing
    assert execute(["link", "test", "--for", "10ms"]) == 1
    out, line = capfd.readouterr()
    assert "2 lost of 200 samples" in line
    assert re.search(r"200 in \d+\.\d s \(asked for 100 a second\)", out)


def test_faults_are_explained_by_name_by_number_and_as_latched(
    capfd: pytest.CaptureFixture[str], daemon: FakeDaemon
) -> None:
    assert execute(["faults", "explain", "over-temperature"]) == 0
    by_name = capfd.readouterr().out
    assert "remedy:" in by_name
    fault = api.Fault(number=6, name="OVER_TEMPERATURE", channel="SPRING_X", measured=9050)
    daemon.answers["motion"] = msgspec.structs.replace(MOTION, fault=fault)
    assert execute(["faults", "explain"]) == 0
    assert "latched: OVER_TEMPERATURE at SPRING_X: 9050" in capfd.readouterr().out
    assert "smad faults list" in failed(capfd, "faults", "explain", "wibble")
    assert execute(["faults", "list"]) == 0


def test_a_key_pair_is_for_its_owner_only_and_never_overwritten(
    capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "my.key"
    assert execute(["keys", str(path)]) == 0
    assert path.stat().st_mode & 0o077 == 0
    public = path.read_text().split()[1]
    assert public in capfd.readouterr().out
    assert "never overwritten" in failed(capfd, "keys", str(path))


def test_a_full_disk_leaves_no_key_file_without_keys(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full(io.FileIO):
        def write(self, data: object) -> int:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fdopen", Full)
    with pytest.raises(OSError, match="No space"):
        new_key_file(tmp_path / "key")
    assert not list(tmp_path.iterdir())


def test_the_default_configuration_passes_its_own_check(
    capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert execute(["config", "show"]) == 0
    path = tmp_path / "bench.toml"
    path.write_text(capfd.readouterr().out)
    assert execute(["config", "check", str(path)]) == 0
    path.write_text("[link]\nrate_hz = 500\n")
    assert "link.baud = 460800" in failed(capfd, "config", "check", str(path))


def test_options_that_contradict_each_other_are_refused(
    capfd: pytest.CaptureFixture[str],
) -> None:
    assert "--speed needs --sim" in failed(capfd, "start", "--port", "/dev/null", "--speed", "3")
    assert "exclude each other" in failed(capfd, "start", "--sim", "--port", "/dev/null")
    assert "leave --baud out" in failed(capfd, "start", "--sim", "--baud", "115200")
    assert "--port DEVICE" in failed(capfd, "start")
    assert "add --firmware host" in failed(capfd, "sim", "--store", "memory.bin")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ("--fault leek@1", "no fault is named 'leek'"),
        ("--speed 0", "plant.speed_ratio is not allowed"),
        ("--effect no_such", "no_such"),
        ("--transport wire", "transport 'wire' is refused"),
        ("--symlink /no/such/folder/tty", "cannot make the symlink"),
    ],
)
def test_what_a_simulated_bench_cannot_do_is_said_in_one_line(
    options: str, says: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert says in failed(capfd, "sim", "--for", "1", *options.split())


@pytest.mark.parametrize("command", ["sim", "start --sim"])
def test_faults_are_listed_by_whoever_takes_them(
    command: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert execute([*command.split(), "--fault", "list"]) == 0
    assert "sensor_open" in capfd.readouterr().out


def test_progress_is_silent_for_two_seconds_and_then_says_something_now_and_then(
    capfd: pytest.CaptureFixture[str],
) -> None:
    now = 0.0
    line = Progress(lambda: now)
    for tenth in range(150):
        now = tenth / 10
        line.say(f"at {now:g} s")
    line.done()
    told = capfd.readouterr().err.split("\n")
    assert told[0] == "at 2 s"
    assert len(told) == 4


def test_a_plant_that_cannot_be_simulated_is_refused_with_the_reason(
    capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(f'[plant]\nparameter_file = "{tmp_path}/nowhere.toml"\n')
    assert "nowhere.toml" in failed(capfd, "sim", "--config", str(path))
    path.write_text('format = "smad-model-2"\n')
    assert "'smad-model-2'" in failed(capfd, "sim", "--model", str(path))


def test_the_simulated_bench_is_that_of_a_model_file(tmp_path: Path) -> None:
    path = tmp_path / "better.toml"
    save_model(path, variant="printed", overrides={"modulus_austenite": 20e9})
    bench = build(Config(), rate_hz=100, seed=0, model_path=path)
    assert bench.plant.parameters["modulus_austenite"] == 20e9
    assert bench.plant.variant == "printed"


def test_a_law_in_a_model_file_warms_the_simulated_bench_as_its_forcing_warms_the_replay(
    tmp_path: Path,
) -> None:
    path = tmp_path / "better.toml"
    save_model(path, laws=[Law("heat_into_wire", "x", (Term(name="constant", coefficient=1.0),))])
    bench = build(Config(), rate_hz=100, seed=0, model_path=path)
    for _ in range(300):
        bench.step()
    times = np.arange(301) * 0.01
    still = Inputs(times, np.zeros((301, 2)), np.zeros((301, 2)))
    forced = simulate(load_parameters("A"), still, forcing={("heat_into_wire", "x"): np.ones(301)})
    rise = bench.plant.truth.T_K[0] - bench.plant.truth.T_K[1]
    assert rise == pytest.approx(forced["T_x_K"][-1] - forced["T_y_K"][-1], rel=0.02)
    assert rise > 0.3


def test_effects_of_the_command_line_join_those_of_the_model(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    own = {
        "rtd_lag": {"tau_s": 0.3, "y_share": 0.8},
        "driver_gain": {"gain": 0.02, "y_share": 1.0},
    }
    save_model(path, base="A", variant="extended", overrides={}, effects=own, note="")

    def effects(*written: str) -> dict[str, dict[str, float]]:
        bench = build(Config(), rate_hz=100, seed=1, model_path=path, effects=written)
        return {name: dict(values) for name, values in bench.plant.effects.items()}

    slower = effects("rtd_lag:tau_s=0.7")
    assert slower["rtd_lag"] == {"tau_s": 0.7, "y_share": 1.0}
    assert slower["driver_gain"] == own["driver_gain"]
    slack = effects("tendon_slack")
    assert slack["rtd_lag"] == own["rtd_lag"]
    assert all(value != 0.0 for value in slack["tendon_slack"].values())


def test_an_effect_that_is_written_wrongly_is_refused_with_its_reason(
    capfd: pytest.CaptureFixture[str],
) -> None:
    assert "is not in the library" in failed(capfd, "sim", "--effect", "wibble")
    assert "PARAMETER=NUMBER" in failed(capfd, "sim", "--effect", "rtd_lag:tau_s")
    assert "outside 0 to 10 s" in failed(capfd, "sim", "--effect", "rtd_lag:tau_s=99")
    assert "has no parameter" in failed(capfd, "sim", "--effect", "rtd_lag:q=1")


def test_progress_shows_a_long_step_that_was_said_at_the_beginning(
    capfd: pytest.CaptureFixture[str],
) -> None:
    now = 0.0
    line = Progress(lambda: now)
    line.say("admission")
    now = 2.0
    line.say_again()
    assert capfd.readouterr().err == "admission\n"


def test_progress_that_says_nothing_new_is_told_once(capfd: pytest.CaptureFixture[str]) -> None:
    now = 0.0
    line = Progress(lambda: now)
    for tenth in range(300):
        now = tenth / 10
        line.say("measuring")
    line.done()
    assert capfd.readouterr().err == "measuring\n"


def test_help_and_other_commands_work_when_one_cannot_be_imported(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(COMMANDS, "gap", "smad.cli.nowhere:gap")
    assert execute(["--help"]) == 0
    listed = capfd.readouterr().out
    assert "Not available here" in listed
    assert "disarm" in listed
    assert "No module named" in failed(capfd, "gap", "diagnose", "--help")
    assert execute(["config", "show"]) == 0


@pytest.mark.parametrize(
    "words", [("current", "x", "1", "--for", "inf"), ("heat", "x", "45", "--for", "nan")]
)
def test_a_limit_that_is_no_number_is_refused_and_never_means_no_limit(
    capfd: pytest.CaptureFixture[str], daemon: FakeDaemon, words: tuple[str, ...]
) -> None:
    message = failed(capfd, *words)
    assert "is not a finite number" in message
    assert words[-1] in message
    assert daemon.asked == []


def test_negative_numbers_are_numbers_not_options(
    capfd: pytest.CaptureFixture[str], daemon: FakeDaemon
) -> None:
    assert execute(["move", "step", "-1", "--no-wait"]) == 0
    assert daemon.asked[-1]["params"]["trajectories"][0]["displacement_mm"] == -1.0
    assert "-1 A: it has to be at least 0 A" in failed(capfd, "current", "x", "-1")
    daemon.answers["params.set"] = api.Param(name="zero", value=-5, minimum=-9, maximum=9)
    assert execute(["params", "set", "zero", "-5"]) == 0
    assert daemon.asked[-1]["params"]["value"] == -5.0


@pytest.mark.parametrize("seconds", ["nan", "-1", "inf"])
def test_the_link_is_tested_for_a_time_that_makes_sense(
    capfd: pytest.CaptureFixture[str], seconds: str
) -> None:
    assert "--for" in failed(capfd, "link", "test", "--for", seconds)


def test_what_is_generated_of_the_documentation_is_not_stale() -> None:
    from tools.reference import PAGES, refreshed

    for page in PAGES:
        text = page.read_text()
        assert refreshed(text) == text, "run python -m tools.reference"


def test_logs_are_those_of_the_bench_whose_daemon_runs(
    daemon: FakeDaemon,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    elsewhere, here = tmp_path / "elsewhere", tmp_path / "here"
    for folder in (elsewhere, here / "runs"):
        folder.mkdir(parents=True)
        write_small_run(folder / f"{folder.name}.mcap", 20)
    monkeypatch.chdir(here)
    monkeypatch.delenv("SMAD_RUNS", raising=False)
    recorder = msgspec.structs.replace(STATUS.recorder, folder=str(elsewhere))
    daemon.answers["status"] = msgspec.structs.replace(STATUS, recorder=recorder)
    assert execute(["log", "list"]) == 0
    said = capfd.readouterr()
    assert "elsewhere.mcap" in said.out
    assert said.err == f"in {elsewhere}:\n"
    assert execute(["log", "list", "--folder", "runs"]) == 0
    said = capfd.readouterr()
    assert "runs.mcap" in said.out
    assert said.err == ""


def test_without_a_daemon_logs_are_those_of_the_current_folder(
    nobody: None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "runs").mkdir()
    write_small_run(tmp_path / "runs/mine.mcap", 20)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SMAD_RUNS", raising=False)
    assert execute(["log", "list"]) == 0
    assert "mine.mcap" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (("record", "mark", "hi"), "Did you mean 'note'?"),
        (("current", "x", "2", "A"), "write a unit without a space, as in 5A"),
        (("move", "step", "5", "cm"), "write a unit without a space, as in 5cm"),
        (("design", "--wire"), "See smad design --help."),
    ],
)
def test_a_near_miss_is_answered_with_what_was_meant(
    capfd: pytest.CaptureFixture[str], arguments: tuple[str, ...], hint: str
) -> None:
    assert hint in failed(capfd, *arguments)
