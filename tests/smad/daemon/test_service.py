"""What each command does, and how a refusal reads."""

import asyncio
import random
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from campaign.virtual import Refused, result_of
from firmware_protocol.enums import BoardState, Fault
from firmware_protocol.events import HostState
from firmware_protocol.messages import ParamSet
from firmware_protocol.parameters import BY_NAME
from firmware_protocol.supervisor.faults import FAULT_TEXTS
from sim_device.bench import SimulatedBench
from sim_device.faults import injection
from smad.api import METHODS
from smad.config import DaemonConfig, LimitsConfig, RecorderConfig
from smad.daemon.command.dispatcher import MOST_WAITING_EACH
from smad.daemon.command.service import Service
from smad.daemon.errors import Refusal
from smad.runlog.reader import read_run
from tests.smad.daemon.rig import Rig, rig_in

STEP = {"kind": "step", "displacement_mm": 5.0, "duration_s": 10.0}


async def test_moving_before_arming_is_refused_with_the_next_action(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.run_for(1.0)
        with pytest.raises(Refused, match="arm it first") as refused:
            await rig.ask("move", trajectories=[STEP])
        assert refused.value.reason == "not_armed"


async def test_a_value_out_of_range_names_field_value_and_limit(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        with pytest.raises(Refused) as refused:
            await rig.ask("current", i_x_A=40.0)
        assert refused.value.code == -32602
        assert "i_x_A" in refused.value.data["cause"]
        assert "at most 4" in refused.value.data["cause"]
        assert refused.value.data["value"] == 40.0


async def test_the_configured_limit_refuses_what_the_wire_would_carry(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        with pytest.raises(Refused) as refused:
            await rig.ask("heat", spring="x", temperature_degC=95.0)
        assert refused.value.data["value"] == "95 °C"
        assert "80" in refused.value.data["limit"]


async def test_an_unknown_field_and_an_unknown_method_are_refused(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.run(10)
        with pytest.raises(Refused, match="speed"):
            await rig.ask("status", speed=3)
        with pytest.raises(Refused) as refused:
            await rig.ask("explode")
        assert refused.value.code == -32601


async def test_disarming_cools_and_ends_the_motion(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        await rig.ask("move", trajectories=[STEP])
        await rig.run_for(2.0)
        motion = await rig.ask("disarm")
        assert not motion["armed"]
        await rig.run(5)
        assert rig.bench.board.state in (BoardState.COOL, BoardState.SAFE)
        assert (await rig.ask("motion"))["running"] == "idle"


async def test_a_motion_has_another_number_once_it_was_replaced_or_ended(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        first = await rig.ask("move", trajectories=[STEP])
        queued = await rig.ask("move", trajectories=[STEP], queue=True)
        await rig.ask("tune", kp_A_per_mm=2.0)
        assert queued["number"] == first["number"] == (await rig.ask("motion"))["number"]
        second = await rig.ask("heat", spring="x", temperature_degC=40.0)
        ended = await rig.ask("idle")
        stopped = await rig.ask("disarm")
        numbers = [motion["number"] for motion in (first, second, ended, stopped)]
        assert len(set(numbers)) == 4


async def test_the_age_of_the_last_sample_grows_once_the_link_is_lost(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.run_for(1.0)
        assert (await rig.ask("motion"))["sample_age_s"] < 0.05
        rig.pull_the_plug()
        await rig.run_for(6.0)
        assert (await rig.ask("motion"))["sample_age_s"] == pytest.approx(6.0, abs=0.1)
        assert (await rig.ask("status"))["motion"]["sample_age_s"] > 5.9


async def test_estop_stays_until_the_power_is_cycled(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        await rig.ask("estop")
        await rig.run(5)
        assert rig.bench.board.state is BoardState.ESTOP
        with pytest.raises(Refused) as refused:
            await rig.ask("arm")
        assert "power-cycle" in refused.value.data["action"]
        assert refused.value.data["value"] == "ESTOP_PRESSED at BOARD"
        with pytest.raises(Refused) as refused:
            await rig.ask("clear")
        assert refused.value.data["value"] == "ESTOP"
        assert "power-cycle" in refused.value.data["action"]


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        (("sensor_offset", {"value": 30.0}), "(SPRING_X); got 5"),
        (("sensor_invalid", {"channel": 2.0}), "a sensor does not read (INLET); look"),
        (("encoder_lost", {}), "a sensor does not read (ENCODER); look"),
        (("supply_sag", {"volts": 7.0}), "too low; got 7 V; allowed: 7.5 V"),
    ],
)
async def test_the_status_says_before_arming_what_the_board_then_refuses_it_for(
    tmp_path: Path, fault: tuple[str, dict[str, float]], told: str
) -> None:
    kind, parameters = fault
    bench = SimulatedBench(seed=1, faults=[injection(kind, 0.6, **parameters)])
    async with rig_in(tmp_path, bench) as rig:
        assert "not connected" in (await rig.ask("status"))["obstacle"]
        await rig.connected()
        assert (await rig.ask("status"))["obstacle"] == ""
        await rig.run_for(1.0)
        expected = (await rig.ask("status"))["obstacle"]
        assert told in expected
        with pytest.raises(Refused) as refused:
            await rig.ask("arm")
        assert refused.value.reason == "board_refused"
        assert refused.value.data["cause"] in expected


@pytest.mark.parametrize(
    ("folder", "free", "told"),
    [("", 0, "No space left on device"), ("file/runs", 1, "Not a directory")],
)
async def test_the_status_says_before_arming_that_no_run_log_could_begin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, free: int, told: str
) -> None:
    (tmp_path / "file").touch()
    disk = SimpleNamespace(f_blocks=1, f_bfree=free, f_bavail=free)
    monkeypatch.setattr("smad.runlog.writer.os.statvfs", lambda place: disk)
    config = RecorderConfig(folder=str(tmp_path / folder))
    async with rig_in(tmp_path, recorder=config) as rig:
        await rig.connected()
        obstacle = ""
        for _ in range(60):
            if told not in obstacle:
                # A thread looks once a second, and takes wall time.
                await rig.run_for(1.0)
                obstacle = (await rig.ask("status"))["obstacle"]
        assert told in obstacle


async def test_a_board_of_another_version_that_was_plugged_in_is_not_waited_for(
    tmp_path: Path,
) -> None:
    async with rig_in(
        tmp_path, SimulatedBench(seed=1, faults=[injection("major_other", 0.6)])
    ) as rig:
        await rig.run_for(2.0)
        with pytest.raises(Refused, match=r"cannot be used; got .* board has 99\.") as refused:
            await rig.ask("arm")
        assert refused.value.reason == "disagreement"
        assert refused.value.data["cause"] in (await rig.ask("status"))["obstacle"]


async def test_arming_twice_is_refused(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        with pytest.raises(Refused) as refused:
            await rig.ask("arm")
        assert refused.value.reason == "armed"


async def test_parameters_are_listed_changed_and_saved_only_while_not_armed(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        names = {param["name"] for param in (await rig.ask("params.list"))["params"]}
        assert "current_limit_mA" in names
        changed = await rig.ask("params.set", name="current_limit_mA", value=3000)
        assert changed["value"] == 3000
        assert rig.bench.board.parameters.get("current_limit_mA") == 3000
        await rig.ask("params.save")
        with pytest.raises(Refused) as refused:
            await rig.ask("params.set", name="current_limit_mA", value=99_000)
        assert "0 … 4000 mA" in refused.value.data["limit"]
        with pytest.raises(Refused, match="no parameter"):
            await rig.ask("params.get", name="wibble")
        await rig.ask("params.set", name="current_limit_mA", value=4000)
        await rig.ask("arm")
        with pytest.raises(Refused) as refused:
            await rig.ask("params.set", name="current_limit_mA", value=2000)
        assert refused.value.reason == "armed"


async def test_arming_is_refused_while_a_limit_of_the_host_is_looser_than_the_boards(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path, limits=LimitsConfig(on_time_max_s=1000.0)) as rig:
        await rig.connected()
        await rig.ask("params.set", name="on_time_limit_s", value=1000)
        with pytest.raises(Refused, match="looser than the board's on_time_limit_s") as refused:
            await rig.ask("arm")
        data = refused.value.data
        assert (data["value"], data["limit"]) == (1000.0, "at most 950")
        assert "params set on_time_limit_s" in data["action"]
        await rig.ask("params.set", name="on_time_limit_s", value=1100)
        assert (await rig.ask("arm"))["armed"]


async def test_a_scale_of_zero_is_refused_by_host_and_board_and_never_armed_with(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        number = BY_NAME["encoder_nm_per_count"].number
        with pytest.raises(Refused, match="out of range") as refused:
            await rig.ask("params.set", name="encoder_nm_per_count", value=0)
        assert refused.value.data["limit"].endswith("not 0 nm")
        with pytest.raises(Refusal, match="out of range"):
            await rig.run_until(rig.axis.requests.ask(ParamSet(0, number, 0)))
        assert rig.bench.board.parameters.get("encoder_nm_per_count") == 1000
        rig.axis.watch.parameters.values[0, number] = 0
        rig.axis.watch.parameters.board_crc = rig.axis.watch.parameters.crc
        with pytest.raises(Refused, match="encoder_nm_per_count is zero"):
            await rig.ask("arm")


@pytest.mark.parametrize("value", [-1e12, 1e12, 3000.5])
async def test_a_parameter_that_no_board_could_hold_is_refused_as_such(
    tmp_path: Path, value: float
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        with pytest.raises(Refused) as refused:
            await rig.ask("params.set", name="current_limit_mA", value=value)
        assert refused.value.reason == "invalid"
        assert refused.value.data["value"] == value


async def test_a_run_is_recorded_with_its_samples_commands_and_header(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        path = Path((await rig.ask("record.start", name="my run"))["path"])
        await rig.ask("move", trajectories=[STEP])
        await rig.run_for(2.0)
        await rig.ask("record.note", text="bubbles in the tube")
        status = await rig.ask("record.stop")
        assert (status["dropped"], status["error"]) == (0, "")
        run = read_run(path)
        assert not run.cut_short
        assert len(run.columns["t_s"]) == status["rows"] >= 200
        assert "[control]" in run.header.configuration
        assert run.header.board["firmware"] == "smad-sim 1.0"
        texts = [event.text for event in run.events]
        assert "move" in texts
        assert "bubbles in the tube" in texts


async def test_arming_records_by_itself_and_the_log_ends_after_cooling(tmp_path: Path) -> None:
    recorder = RecorderConfig(folder=str(tmp_path / "runs"), automatic=True)
    async with rig_in(tmp_path, recorder=recorder) as rig:
        await rig.arm()
        assert rig.daemon.recorder.recording
        await rig.run_for(1.0)
        await rig.ask("disarm")

        async def ended() -> None:
            while rig.daemon.recorder.recording:
                await asyncio.sleep(0)

        await rig.run_until(ended())
        assert len(list((tmp_path / "runs").glob("*.mcap"))) == 1


async def test_a_log_asked_for_by_name_takes_over_from_that_of_arming_without_a_gap(
    tmp_path: Path,
) -> None:
    recorder = RecorderConfig(folder=str(tmp_path / "runs"), automatic=True)
    async with rig_in(tmp_path, recorder=recorder) as rig:
        await rig.arm()
        first = Path((await rig.ask("status"))["recorder"]["path"])
        await rig.run_for(0.5)
        assert Path((await rig.ask("record.start"))["path"]) == first
        await rig.ask("record.stop")
        await rig.ask("disarm")
    async with rig_in(tmp_path, recorder=recorder) as rig:
        await rig.arm()
        first = Path((await rig.ask("status"))["recorder"]["path"])
        await rig.run_for(0.5)
        named = Path((await rig.ask("record.start", name="my run"))["path"])
        assert named.stem.endswith("my-run")
        await rig.run_for(0.5)
        await rig.ask("record.stop")
        ticks = [read_run(path).columns["tick"] for path in (first, named)]
        assert ticks[1][0] == ticks[0][-1] + 1
        with pytest.raises(Refused, match="nothing is being recorded"):
            await rig.ask("record.stop")


async def test_a_log_that_failed_is_told_and_the_next_arming_begins_another(tmp_path: Path) -> None:
    recorder = RecorderConfig(folder=str(tmp_path / "runs"), automatic=True)
    async with rig_in(tmp_path, recorder=recorder) as rig:
        await rig.arm()
        first = rig.daemon.recorder._writer
        assert first is not None
        first.error = "the disk is full"
        told = (await rig.ask("status"))["recorder"]
        assert (told["recording"], told["error"]) == (False, "the disk is full")
        await rig.ask("disarm")
        await rig.arm()
        told = (await rig.ask("status"))["recorder"]
        assert (told["recording"], told["error"]) == (True, "")
        assert Path(told["path"]) != first.paths[0]
        second = rig.daemon.recorder._writer
        assert second is not None
        second.error = "the disk is full again"
        assert (await rig.ask("record.stop"))["error"] == "the disk is full again"
        with pytest.raises(Refused, match="nothing is being recorded"):
            await rig.ask("record.stop")


async def test_a_folder_that_cannot_be_written_refuses_arming_and_names_it(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    recorder = RecorderConfig(folder=str(blocked / "runs"), automatic=True)
    async with rig_in(tmp_path, recorder=recorder) as rig:
        await rig.connected()
        with pytest.raises(Refused) as refused:
            await rig.ask("arm")
        assert refused.value.reason == "recorder"
        assert str(blocked) in refused.value.data["cause"]
        await rig.run(10)
        assert rig.bench.board.state is BoardState.SAFE


async def test_only_the_holder_commands_while_anyone_may_watch_and_stop(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        held = await rig.ask("control.take", name="Ada", lease_s=10.0)
        ada = {"lease": held["lease"]}
        with pytest.raises(Refused, match="Ada has exclusive control") as refused:
            await rig.ask("idle", client=b"bob")
        assert refused.value.reason == "not_in_control"
        control = (await rig.ask("status", client=b"bob"))["control"]
        assert (control["holder"], control["yours"], control["lease"]) == ("Ada", False, "")
        assert (await rig.ask("status", members=ada))["control"]["yours"]
        await rig.ask("idle", members=ada)
        await rig.ask("disarm", client=b"bob")


async def test_a_lease_ends_by_itself(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.ask("control.take", client=b"ada", name="Ada", lease_s=2.0)
        await rig.run_for(2.5)
        await rig.ask("idle", client=b"bob")


async def test_who_has_control_and_vanishes_leaves_a_disarmed_bench(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        ada = {"lease": (await rig.ask("control.take", name="Ada", lease_s=2.0))["lease"]}
        await rig.ask("move", members=ada, trajectories=[STEP])
        for _ in range(3):
            await rig.run_for(1.5)
            # Looking is enough to be heard.
            assert (await rig.ask("motion", members=ada))["armed"]
        assert (await rig.ask("status", client=b"bob"))["control"]["holder"] == "Ada"
        await rig.run_for(2.2)
        await rig.run_until(not_armed(rig))
        motion = await rig.ask("motion", client=b"bob")
        assert (motion["armed"], motion["running"]) == (False, "idle")
        assert rig.bench.board.state in (BoardState.COOL, BoardState.SAFE)
        assert "Ada had exclusive control and sent nothing for 2 s; disarming" in rig.said
        await rig.run_for(5.0)
        assert rig.said.count("sent nothing") == 1


async def test_gains_that_a_vanished_holder_has_tuned_are_those_from_before(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        await rig.ask("tune", kp_A_per_mm=0.7)
        before = rig.axis.controller.gains
        ada = {"lease": (await rig.ask("control.take", name="Ada", lease_s=2.0))["lease"]}
        await rig.ask("tune", members=ada, kp_A_per_mm=3.0, cooling="off")
        assert rig.axis.controller.gains != before
        await rig.ask("control.take", members=ada, name="Ada", lease_s=2.0)
        await rig.run_for(2.5)
        await rig.ask("status", client=b"bob")
        assert rig.axis.controller.gains == before
        assert "gains are those from before Ada took control" in rig.said


async def test_gains_of_who_gives_control_back_stay(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        ada = {"lease": (await rig.ask("control.take", name="Ada", lease_s=2.0))["lease"]}
        await rig.ask("tune", members=ada, kp_A_per_mm=3.0)
        await rig.ask("control.release", members=ada)
        await rig.run_for(3.0)
        await rig.ask("status", client=b"bob")
        assert rig.axis.controller.gains.kp_A_per_mm == 3.0


async def not_armed(rig: Rig) -> None:
    """Housekeeping, which looks at leases, is paced by the wall clock."""
    while HostState.RUNNING is rig.axis.session.state or rig.bench.board.state is BoardState.ARMED:
        await asyncio.sleep(0.001)


async def test_giving_control_back_leaves_the_bench_as_it_is(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        ada = {"lease": (await rig.ask("control.take", name="Ada", lease_s=1.0))["lease"]}
        await rig.ask("control.release", members=ada)
        await rig.run_for(3.0)
        assert (await rig.ask("motion"))["armed"]


async def test_the_dead_man_option_disarms_when_the_arming_client_is_silent(
    tmp_path: Path,
) -> None:
    daemon = DaemonConfig(ipc_dir=str(tmp_path), dead_man_lease_s=3.0)
    async with rig_in(tmp_path, SimulatedBench(seed=1), daemon=daemon) as rig:
        await rig.arm()
        for _ in range(4):
            await rig.run_for(2.0)
            assert (await rig.ask("motion"))["armed"]
        await rig.run_for(1.0)

        await rig.run_until(not_armed(rig))
        assert "stopped sending" in rig.said


async def test_a_mistake_in_one_command_is_told_and_the_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()

        def explode(client: bytes) -> Any:
            raise KeyError("injected")

        monkeypatch.setattr(rig.daemon.status, "full", explode)
        with pytest.raises(Refused) as refused:
            await rig.ask("status")
        assert refused.value.reason == "internal"
        assert not rig.daemon.failure.done()
        assert (await rig.ask("motion"))["armed"]


async def test_repeated_inputs_that_the_bench_departs_from_end_and_the_log_says_why(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        path = Path((await rig.ask("record.start", name="again", repeats="a.mcap"))["path"])
        row = {"i_x_A": [0.5], "i_y_A": [0.0], "pump_x_duty": [0.0], "pump_y_duty": [0.0]}
        await rig.ask("inputs", t_s=[0.0], end_s=9.0, displacement_mm=[20.0], **row)
        await rig.run_for(1.0)
        motion = await rig.ask("motion")
        assert (motion["running"], motion["armed"], motion["fault"]) == ("idle", True, None)
        assert "instead of 20" in motion["ended"]
        await rig.ask("record.stop")
        run = read_run(path)
        assert run.header.repeats == "a.mcap"
        assert any("repeated inputs were ended" in event.text for event in run.events)
        assert {"rows": 1, "begin_s": 0.0, "end_s": 9.0} in [event.data for event in run.events]


async def test_every_method_of_the_api_is_carried_out_by_the_service(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        service: Service = rig.daemon.service
        assert set(service.methods) == {method.params for method in METHODS}


def _messages() -> list[bytes]:
    rng = random.Random(3)
    pieces = [b'{"jsonrpc":"2.0"', b',"id":', b"1", b',"method":"', b"status", b"arm", b'"', b"}"]
    pieces += [
        b',"params":{',
        b'"trajectories":',
        b"[[[",
        b"null",
        b"\xff",
        b"\0",
        b"1e999",
        b"NaN",
    ]
    return [b"".join(rng.choices(pieces, k=rng.randrange(12))) for _ in range(2000)]


async def test_thousands_of_mangled_messages_are_answered_and_cost_no_sample(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        replies: list[bytes] = []
        for message in _messages():
            rig.daemon.dispatcher.command(b"mangler", message, replies.append)
            await rig.run(1)
        counts = rig.axis.control.counts
        assert counts.skipped == 0
        assert rig.axis.session.stats.missed_states == 0
        assert not rig.daemon.failure.done()
        assert (await rig.ask("motion"))["armed"]
        assert len(replies) > 1900


async def test_sensors_that_swap_in_a_run_end_the_motion_and_the_user_is_told(
    tmp_path: Path,
) -> None:
    bench = SimulatedBench(seed=1, faults=[injection("sensors_swapped", 8.0, lasts=5.0)])
    recorder = RecorderConfig(folder=str(tmp_path / "runs"))
    async with rig_in(tmp_path, bench, recorder=recorder) as rig:
        await rig.arm()
        await rig.ask("current", i_x_A=4.0)
        while not rig.axis.control.controller.trip:
            await rig.run(1)
        # From the very sample on, before the board is disarmed.
        motion = await rig.ask("motion")
        assert motion["running"] == "idle"
        assert not motion["done"]
        fault = motion["fault"]
        assert (fault["name"], fault["by"]) == ("SENSOR_IMPLAUSIBLE", "host")
        assert fault["channel"] in ("SPRING_X", "SPRING_Y")
        assert abs(fault["measured"]) > abs(fault["limit"]) >= 50.0
        await rig.run_for(1.0)
        assert rig.bench.board.state in (BoardState.COOL, BoardState.SAFE)
        assert FAULT_TEXTS[Fault.SENSOR_IMPLAUSIBLE].remedy in rig.said
        for ask in (rig.ask("arm"), rig.ask("current", i_x_A=1.0)):
            with pytest.raises(Refused, match="a limit of the host stopped the bench") as refused:
                await ask
            assert refused.value.reason == "faulted"
            assert "SENSOR_IMPLAUSIBLE" in refused.value.data["value"]
        await rig.run_for(60.0)
        await rig.ask("clear")
        assert (await rig.ask("motion"))["fault"] is None
        await rig.ask("arm")
        await rig.ask("current", i_x_A=2.0)
        await rig.run_for(1.0)
        assert rig.bench.board.outputs.applied_mA[0] == 2000
        path = Path((await rig.ask("status"))["recorder"]["path"])
        await rig.run_until(rig.daemon.recorder.stop())
    stops = [e for p in path.parent.glob("*.mcap") for e in read_run(p).events if e.kind == "fault"]
    assert [event.data["by"] for event in stops] == ["host"]
    assert stops[0].text.startswith("the host stopped: SENSOR_IMPLAUSIBLE at SPRING_")


async def test_the_longest_time_armed_ends_the_motion_under_the_name_of_the_boards_fault(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path, limits=LimitsConfig(on_time_max_s=2.0)) as rig:
        await rig.arm()
        await rig.ask("heat", spring="x", temperature_degC=40.0)
        await rig.run_for(3.0)
        motion = await rig.ask("motion")
        assert not motion["armed"]
        assert motion["fault"]["name"] == "ARMED_TOO_LONG"
        assert motion["fault"]["limit"] == 2.0
        assert "Disarm, look at the bench, arm again." in rig.said


async def test_a_stage_is_moved_only_by_a_board_that_has_one(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        with pytest.raises(Refused, match="moves no stretching stage") as refused:
            await rig.ask("stage", stage_mm=5.0, rate_mm_per_s=5.0)
        assert refused.value.reason == "invalid"
    bench = SimulatedBench(seed=1, fixture="stretch")
    async with rig_in(tmp_path / "stretch", bench) as rig:
        await rig.arm()
        await rig.ask("stage", stage_mm=5.0, rate_mm_per_s=5.0)
        await rig.run_for(2.0)
        assert rig.bench.board.stage_m == pytest.approx(0.005)


async def test_one_client_that_floods_is_told_so_and_another_finds_room(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        waiting = [rig.begin("record.start", b"flood", name="r") for _ in range(MOST_WAITING_EACH)]
        too_many = rig.begin("record.start", b"flood", name="r")
        other = rig.begin("params.get", b"other", name="state_rate_hz")
        with pytest.raises(Refused, match="too many commands wait") as refused:
            result_of(await rig.run_until(too_many))
        assert refused.value.reason == "busy"
        assert refused.value.data["limit"] == MOST_WAITING_EACH
        result_of(await rig.run_until(other))
        result_of(await rig.run_until(waiting[0]))


async def test_a_daemon_closes_when_a_task_has_ended_and_nobody_was_told_yet(
    tmp_path: Path,
) -> None:
    async def nothing() -> None:
        return

    async with rig_in(tmp_path) as rig:
        rig.daemon.spawn("nothing", nothing())
        await asyncio.sleep(0)
        (task,) = rig.daemon._tasks
        assert task.done()
        await rig.daemon.close()
        assert not rig.daemon._tasks
