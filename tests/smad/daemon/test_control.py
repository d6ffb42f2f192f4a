"""The control path, in this process, on the bench's own time."""

from pathlib import Path

import msgspec
import pytest

from campaign.virtual import Refused
from firmware_protocol.enums import BoardState, Fault, ResetCause
from firmware_protocol.events import HostState
from sim_device.bench import SimulatedBench
from sim_device.faults import injection
from smad.control.sample import Sample
from smad.control.setpoint import Output
from smad.daemon.link.port import SocketTransport
from smad.runlog.schema import CHANNELS
from tests.firmware_protocol.test_sessions import REPORT
from tests.smad.daemon.rig import rig_in


async def test_every_sample_is_answered_by_one_setpoint(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.run(10)
        before = rig.axis.control.counts.setpoints
        await rig.run(500)
        counts = rig.axis.control.counts
        assert counts.setpoints - before == 500
        assert (counts.skipped, counts.setpoints_dropped) == (0, 0)
        assert rig.axis.session.stats.missed_states == 0


async def test_a_connection_lands_in_monitor_and_reads_the_parameters(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        assert rig.axis.session.state is HostState.MONITOR
        status = await rig.ask("status")
        assert status["board"]["params_agree"] is True
        assert status["motion"]["armed"] is False


async def test_a_step_is_followed_and_recorded_samples_say_so(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        await rig.ask(
            "move", trajectories=[{"kind": "step", "displacement_mm": 5.0, "duration_s": 30.0}]
        )
        await rig.run_for(25.0)
        motion = await rig.ask("motion")
        assert motion["reference_mm"] == pytest.approx(5.0)
        assert motion["displacement_mm"] == pytest.approx(5.0, abs=0.5)
        last = rig.axis.control.last
        assert last is not None
        row = last.row(degrees_per_mm=6.25)
        assert row.displacement_mm == pytest.approx(motion["displacement_mm"], abs=0.1)
        assert {name for name in CHANNELS if getattr(row, name) is None} == {"stage_mm"}
        assert row.pump_starts_x == 0
        assert row.pump_starts_y in (1, 2, 3)
        assert row.angle_deg == pytest.approx(6.25 * (row.displacement_mm or 0.0))


async def test_a_row_has_the_digits_that_the_board_measured(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.run(10)
        last = rig.axis.control.last
        assert last is not None
        last.sample = msgspec.structs.replace(
            last.sample,
            displacement_m=148 * 1e-6,
            force_N=1648 * 1e-3,
            v_V=(814 * 1e-3, 3030 * 1e-3),
            i_meas_A=(2752 * 1e-3, 4004 * 1e-3),
        )
        row = last.row(degrees_per_mm=6.25)
    assert (row.displacement_mm, row.force_N) == (0.148, 1.648)
    assert (row.v_x_V, row.v_y_V) == (0.814, 3.03)
    assert (row.i_meas_x_A, row.i_meas_y_A) == (2.752, 4.004)


async def test_the_newest_of_several_samples_is_acted_on_and_the_others_are_counted(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.run(100)
        before = rig.axis.control.counts.setpoints
        burst = b"".join(rig.bench.step() for _ in range(5))
        rig.axis.control.receive(burst)
        counts = rig.axis.control.counts
        assert counts.skipped == 4
        assert counts.setpoints == before + 1
        assert rig.axis.session.stats.missed_states == 0


async def test_lost_samples_are_counted_from_the_boards_counter(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.run(100)
        for _ in range(3):
            rig.bench.step()
        await rig.run(10)
        assert rig.axis.session.stats.missed_states == 3


async def test_pulling_the_plug_lands_in_monitor_and_never_arms_again(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        assert (await rig.ask("motion"))["armed"]
        rig.pull_the_plug()
        await rig.run(20)
        assert rig.axis.session.state is HostState.DISCONNECTED
        await rig.reopened()
        await rig.run_for(3.0)
        assert rig.axis.session.state in (HostState.MONITOR, HostState.FAULTED)
        assert not (await rig.ask("motion"))["armed"]
        assert rig.bench.board.state not in (BoardState.ARMED, BoardState.HOLD)


async def test_a_fault_from_while_the_port_was_away_is_logged_with_its_values(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        rig.pull_the_plug()
        await rig.run_for(1.0)
        await rig.reopened()
        await rig.run_for(3.0)
        (fault,) = [event.data for event in rig.events if event.kind == "fault"]
        assert fault["name"] == "SETPOINT_LOST"
        assert fault["measured"] > fault["limit"]


async def test_a_fault_is_shown_and_stays_after_the_port_was_reopened(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        for _ in range(2):
            rig.pull_the_plug()
            await rig.run_for(1.0)
            # DTR resets the board, and its memory keeps the fault.
            rig.bench.reboot(ResetCause.PIN)
            await rig.reopened()
            await rig.run_for(3.0)
            status = (await rig.ask("status"))["motion"]
            assert (status["mode"], status["fault"]["name"]) == ("FAULT", "SETPOINT_LOST")
            with pytest.raises(Refused) as refused:
                await rig.ask("arm")
            assert refused.value.reason == "faulted"
        await rig.ask("clear")
        rig.bench.reboot(ResetCause.PIN)
        await rig.run_for(3.0)
        await rig.ask("arm")


async def test_a_dying_control_task_stops_stepping_and_still_disarms(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()

        def explode(sample: object) -> None:
            raise ZeroDivisionError("injected")

        monkeypatch.setattr(rig.axis.control.controller, "step", explode)
        await rig.run(2)
        assert rig.daemon.failure.done()
        name, error = rig.daemon.failure.result()
        assert name == "control"
        assert isinstance(error, ZeroDivisionError)
        text = await rig.run_until(rig.daemon.disarm())
        assert text == "disarmed, the board cools by itself"
        assert rig.bench.board.state in (BoardState.COOL, BoardState.SAFE)


@pytest.mark.parametrize(
    ("part", "broken", "name"),
    [
        ("publisher", "publish", "telemetry"),
        ("recorder", "row", "telemetry"),
        ("notifier", "alive", "telemetry"),
        ("server", "wake", "housekeeping"),
    ],
)
async def test_a_part_that_dies_is_named_and_the_board_is_still_disarmed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str, broken: str, name: str
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()

        def explode(*arguments: object, **options: object) -> None:
            raise RuntimeError("injected")

        monkeypatch.setattr(getattr(rig.daemon, part), broken, explode)
        assert (await rig.run_until(rig.daemon.failure))[0] == name
        text = await rig.run_until(rig.daemon.disarm())
        assert text == "disarmed, the board cools by itself"


async def test_a_coroutine_that_dies_ends_the_daemon_too(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.run(10)

        async def explode() -> None:
            raise RuntimeError("injected")

        rig.daemon.spawn("some task", explode())
        assert (await rig.run_until(rig.daemon.failure))[0] == "some task"


async def test_the_rate_of_the_configuration_is_set_on_the_board(tmp_path: Path) -> None:
    from smad.config import LinkConfig

    link = LinkConfig(rate_hz=500, baud=921_600)
    async with rig_in(tmp_path, SimulatedBench(seed=1, rate_hz=100), link=link) as rig:
        await rig.run(400)
        assert rig.bench.board.rate_hz == 500
        await rig.run(500)
        assert rig.axis.session.stats.missed_states == 0
        assert (await rig.ask("params.get", name="state_rate_hz"))["value"] == 500


async def test_a_board_with_other_messages_is_watched_and_cannot_be_armed(tmp_path: Path) -> None:
    bench = SimulatedBench(seed=1, faults=[injection("schema_newer", 1.0)])
    async with rig_in(tmp_path, bench) as rig:
        await rig.run_for(4.0)
        with pytest.raises(Refused) as refused:
            await rig.ask("arm")
        assert refused.value.reason == "disagreement"
        assert "RINSE" in refused.value.data["value"]
        before = rig.axis.control.counts.samples
        await rig.run(50)
        assert rig.axis.control.counts.samples == before + 50


async def test_a_fault_is_told_with_channel_value_and_limit_and_can_be_cleared(
    tmp_path: Path,
) -> None:
    bench = SimulatedBench(seed=1, faults=[injection("sensor_open", 3.0, lasts=2.0)])
    async with rig_in(tmp_path, bench) as rig:
        await rig.arm()
        await rig.run_for(3.0)
        fault = (await rig.ask("motion"))["fault"]
        assert fault["name"] == "SENSOR_OPEN"
        assert fault["channel"] == "SPRING_X"
        assert fault["measured"] is not None
        with pytest.raises(Refused) as refused:
            await rig.ask("arm")
        assert refused.value.reason == "faulted"
        await rig.run_for(5.0)
        await rig.ask("clear")
        await rig.run(5)
        motion = await rig.ask("motion")
        assert (motion["mode"], motion["fault"], motion["armed"]) == ("SAFE", None, False)


@pytest.mark.parametrize("earlier", [0, 20, 300])
async def test_a_fault_latched_before_the_connection_is_read_and_can_be_cleared(
    tmp_path: Path, earlier: int
) -> None:
    bench = SimulatedBench(seed=1, faults=[injection("sensor_open", 3.0, lasts=1.0)])
    async with rig_in(tmp_path, bench) as rig:
        await rig.arm()
        for _ in range(earlier):
            bench.board.session.reports.add(
                msgspec.structs.replace(REPORT, fault=Fault.SENSOR_OPEN)
            )
        rig.pull_the_plug()
        await rig.run_for(3.0)
        await rig.reopened()
        await rig.run_for(2.0)
        latched = (await rig.ask("motion"))["fault"]
        assert latched is not None
        assert latched["measured"] is not None
        assert latched["name"] == "SETPOINT_LOST"
        await rig.ask("clear")
        await rig.run(5)
        assert (await rig.ask("motion"))["mode"] == "SAFE"


async def test_a_board_that_restarts_while_armed_is_only_watched_afterwards(tmp_path: Path) -> None:
    bench = SimulatedBench(seed=1, faults=[injection("reboot", 4.0)])
    async with rig_in(tmp_path, bench) as rig:
        await rig.arm()
        await rig.ask(
            "move", trajectories=[{"kind": "step", "displacement_mm": 5.0, "duration_s": 60.0}]
        )
        while rig.axis.session.state is HostState.RUNNING:
            await rig.run(1)
        assert (await rig.ask("motion"))["running"] == "idle"
        await rig.run_for(3.0)
        assert rig.axis.session.state is HostState.MONITOR
        last = rig.axis.control.last
        assert last is not None
        assert last.setpoint is not None
        assert last.setpoint.i_mA == (0, 0)
        assert rig.bench.board.state is BoardState.SAFE
        assert "restarted" in rig.said


async def test_stopping_an_unarmed_bench_says_that_nothing_was_armed(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.run_for(1.0)
        assert await rig.run_until(rig.daemon.disarm()) == "nothing was armed"


async def test_passed_over_samples_are_recorded_in_their_order_and_at_their_times(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.run(100)
        burst = b"".join(rig.bench.step() for _ in range(4))
        seen: list[tuple[int, int]] = []
        rig.axis.control.finished.clear()
        rig.axis.control.receive(burst)
        seen = [(item.sample.tick, item.sample.t_us) for item in rig.axis.control.finished]
        first_tick, first_us = seen[0]
        assert seen == [(first_tick + n, first_us + 10_000 * n) for n in range(4)]
        answered = [item.setpoint is not None for item in rig.axis.control.finished]
        assert answered == [False, False, False, True]


async def test_a_reply_that_comes_with_the_sample_that_kills_the_step_is_passed_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()

        controller = rig.axis.control.controller
        whole = controller.step

        def explode(sample: Sample) -> Output:
            # The board, once it has the new value, says so in the bytes of its next sample.
            if rig.bench.board.parameters.get("on_time_limit_s") == 21_000:
                raise ZeroDivisionError("injected")
            return whole(sample)

        monkeypatch.setattr(controller, "step", explode)
        await rig.ask("params.set", name="on_time_limit_s", value=21_000.0)
        assert rig.daemon.failure.done()


async def test_a_restart_of_the_board_is_not_counted_as_missed_samples(tmp_path: Path) -> None:
    # Past the middle of the board's counter: from there a restart looks like a leap ahead.
    bench = SimulatedBench(seed=1)
    bench.board.tick = 40_000
    async with rig_in(tmp_path, bench) as rig:
        await rig.run(200)
        bench.reboot(ResetCause.PIN)
        await rig.run(200)
        assert bench.board.tick < 300
        assert rig.axis.session.stats.missed_states == 0


async def test_a_line_opened_with_another_speed_than_the_boards_is_warned_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for opened, warned in ((115_200, True), (921_600, False)):
        monkeypatch.setattr(SocketTransport, "baud", opened)
        async with rig_in(tmp_path / str(opened)) as rig:
            await rig.run_for(1.0)
            events = (await rig.ask("status"))["events"]
            assert any("set link.baud = 921600" in event["text"] for event in events) == warned
