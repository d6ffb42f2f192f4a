"""Both clients, against a stand-in for the daemon."""

import asyncio
import contextlib
import inspect
import os
import pickle
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

import smad
from smad import api
from smad.client import (
    AsyncClient,
    BoardRefused,
    Client,
    NoAnswer,
    NoDaemon,
    NotInControl,
    NotReady,
    Refused,
    Stopped,
)
from smad.client.endpoints import Connection, write_connection
from smad.client.progress import Wait
from smad.control.commands import DriveCurrent, FollowInputs, Hold, Samples, Sine, Step, Tune
from smad.control.pieces import POINTS_A_PIECE, in_pieces
from tests.smad.fakedaemon import MOTION, FakeDaemon, Silent, fake_daemon

INPUTS = FollowInputs(
    t_s=(0.0,), end_s=1.0, i_x_A=(1.0,), i_y_A=(0.0,), pump_x_duty=(0.0,), pump_y_duty=(0.0,)
)


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[FakeDaemon]:
    with fake_daemon(tmp_path) as daemon:
        yield daemon


@pytest.fixture
def client(daemon: FakeDaemon, tmp_path: Path) -> Iterator[Client]:
    with Client(folder=tmp_path, timeout_s=30.0, lease_s=None) as client:
        yield client


def test_the_clients_are_found_at_the_top_of_the_package() -> None:
    assert smad.Client is Client
    assert smad.AsyncClient is AsyncClient


def test_both_clients_have_the_same_methods_with_the_same_parameters_and_words() -> None:
    def methods(cls: type) -> dict[str, tuple[list[str], str | None]]:
        return {
            name: (list(inspect.signature(method).parameters), inspect.getdoc(method))
            for name, method in inspect.getmembers(cls, callable)
            if not name.startswith("_")
        }

    blocking, awaited = methods(Client), methods(AsyncClient)
    assert blocking.keys() == awaited.keys()
    for name, (parameters, words) in blocking.items():
        assert awaited[name] == (parameters, words), name


def test_there_is_a_client_method_for_every_method_of_the_api(
    client: Client, daemon: FakeDaemon
) -> None:
    # Both channels are connected.
    client.motion()
    client.disarm()
    for method in api.METHODS:
        daemon.answers[method.name] = Silent()
    client.timeout_s = 0.0
    calls = (
        client.status,
        client.motion,
        client.config,
        client.reset_timing,
        client.arm,
        client.disarm,
        client.estop,
        client.clear,
        client.params,
        client.save_params,
        client.idle,
        client.start_recording,
        client.release_control,
        lambda: client.move(Step(displacement_mm=1.0, duration_s=1.0)),
        lambda: client.move({"a": Step(displacement_mm=1.0, duration_s=1.0)}),
        lambda: client.heat("x", 50.0),
        lambda: client.current(DriveCurrent(i_x_A=1.0)),
        lambda: client.follow_inputs(INPUTS),
        lambda: client.stage(1.0, 1.0),
        lambda: client.tune(Tune(kp_A_per_mm=1.0)),
        lambda: client.get_param("a"),
        lambda: client.set_param("a", 1.0),
        lambda: client.note("a"),
        lambda: client.take_control("me"),
    )
    for call in calls:
        with pytest.raises(NoAnswer):
            call()
    # These two wait for the disk, however short the client's timeout is: they are answered.
    recorder = api.RecorderStatus(recording=False)
    daemon.answers["record.stop"] = daemon.answers["record.last"] = recorder
    daemon.answers["motion"] = daemon.answers["disarm"] = MOTION
    client.timeout_s = 30.0
    client.stop_recording()
    client.record_last(5.0)
    client.motion()
    # What went over a channel before an answer came over it has arrived.
    client.disarm()
    assert {request["method"] for request in daemon.asked} == {m.name for m in api.METHODS}


def test_a_reply_is_typed(client: Client) -> None:
    assert client.motion() == MOTION


def test_stops_go_over_their_own_channel(client: Client, daemon: FakeDaemon) -> None:
    client.disarm()
    client.estop()
    client.arm()
    assert [request["channel"] for request in daemon.asked] == ["stop", "stop", "command"]


@pytest.mark.parametrize(
    ("reason", "kind"),
    [
        (api.Reason.NOT_IN_CONTROL, NotInControl),
        (api.Reason.NOT_ARMED, NotReady),
        (api.Reason.FAULTED, NotReady),
        (api.Reason.BOARD_REFUSED, BoardRefused),
        (api.Reason.INVALID, Refused),
    ],
)
def test_a_refusal_is_raised_as_its_kind_with_value_limit_and_next_action(
    client: Client, daemon: FakeDaemon, reason: api.Reason, kind: type[Refused]
) -> None:
    daemon.answers["arm"] = api.ErrorData(
        reason=reason, cause="too hot", value=51.0, limit="45 °C", action="wait"
    )
    with pytest.raises(kind, match=r"too hot; got 51\.0; allowed: 45 °C; wait") as refused:
        client.arm()
    assert refused.value.reason is reason
    again = pickle.loads(pickle.dumps(refused.value))
    assert str(again) == str(refused.value)
    assert again.reason is reason


def test_a_late_reply_is_not_taken_for_the_next_one(client: Client, daemon: FakeDaemon) -> None:
    daemon.answers["motion"] = Silent()
    client.timeout_s = 0.05
    with pytest.raises(NoAnswer, match="may have been carried out"):
        client.motion()
    client.timeout_s = 30.0
    late = msgspec.json.encode({"jsonrpc": "2.0", "id": 1, "result": {"toml": "old"}})
    daemon.before_reply = late
    daemon.answers["config"] = api.ConfigText(toml="new")
    assert client.config() == "new"


def test_without_a_daemon_the_error_says_how_to_start_one(tmp_path: Path) -> None:
    with pytest.raises(NoDaemon, match="smad start --sim"):
        Client(folder=tmp_path)


def test_without_a_daemon_the_error_names_the_benches_that_run(tmp_path: Path) -> None:
    here = Connection(
        bench="lab", pid=os.getpid(), version="", command="ipc://x", stop="", telemetry=""
    )
    write_connection(tmp_path / "lab.json", here, 0o077)
    with pytest.raises(NoDaemon, match=r"running: lab; name it \(--bench\)"):
        Client(folder=tmp_path)


def test_the_connection_file_of_a_dead_daemon_counts_as_no_daemon(tmp_path: Path) -> None:
    write_connection(
        tmp_path / "bench.json",
        Connection(
            bench="bench", pid=2**22 + 1, version="", command="ipc://x", stop="", telemetry=""
        ),
        0o077,
    )
    with pytest.raises(NoDaemon):
        Client(folder=tmp_path)


def test_an_unreadable_reply_is_an_error_not_a_crash(client: Client, daemon: FakeDaemon) -> None:
    daemon.answers["motion"] = b"\xff\xff"
    with pytest.raises(Refused, match="same version"):
        client.motion()


def test_waiting_ends_when_the_motion_is_done_and_shows_progress(
    client: Client, daemon: FakeDaemon
) -> None:
    under_way = msgspec.structs.replace(MOTION, done=False, running="displacement")
    left = [under_way, under_way, MOTION]
    daemon.answers["motion"] = lambda request: left.pop(0) if left else MOTION
    seen: list[bool] = []
    assert client.wait_until_done(lambda motion: seen.append(motion.done)) == MOTION
    assert seen == [False, False, True]


def test_waiting_for_what_will_never_come_says_why() -> None:
    wait = Wait(0.0, timeout_s=5.0)
    under_way = msgspec.structs.replace(MOTION, done=False)
    assert not wait.over(under_way, 4.0)
    with pytest.raises(NoAnswer, match="5 s"):
        wait.over(under_way, 6.0)
    fault = api.Fault(number=6, name="OVER_TEMPERATURE")
    stopped = msgspec.structs.replace(MOTION, armed=False, mode="FAULT", fault=fault)
    with pytest.raises(Stopped, match="OVER_TEMPERATURE"):
        wait.over(stopped, 1.0)
    with pytest.raises(Stopped, match="not armed"):
        wait.over(msgspec.structs.replace(MOTION, armed=False, mode="SAFE"), 1.0)


def test_several_trajectories_are_sent_in_order_the_first_replacing_what_runs(
    client: Client, daemon: FakeDaemon
) -> None:
    client.move(
        Step(displacement_mm=1.0, duration_s=1.0),
        Sine(amplitude_mm=1.0, period_s=2.0, cycles=1),
    )
    sent = [request["params"] for request in daemon.asked]
    assert [p["queue"] for p in sent] == [False, True]
    assert [p["trajectories"][0]["kind"] for p in sent] == ["step", "sine"]


def test_long_sample_trajectories_go_out_in_pieces_that_join() -> None:
    count = 3 * POINTS_A_PIECE + 7
    whole = Samples(
        t_s=tuple(0.01 * n for n in range(count)),
        displacement_mm=tuple(0.001 * n for n in range(count)),
    )
    pieces = in_pieces(whole)
    assert all(isinstance(p, Samples) and len(p.t_s) <= POINTS_A_PIECE for p in pieces)
    joined: list[float] = []
    length_s = 0.0
    for piece in pieces:
        assert isinstance(piece, Samples)
        assert piece.t_s[0] == 0.0
        assert len(piece.t_s) >= 2
        assert not joined or joined[-1] == piece.displacement_mm[0]
        joined += piece.displacement_mm[1 if joined else 0 :]
        length_s += piece.t_s[-1]
    assert tuple(joined) == whole.displacement_mm
    assert length_s == pytest.approx(whole.t_s[-1])


def test_telemetry_is_an_iterator_of_typed_samples(client: Client, daemon: FakeDaemon) -> None:
    import threading

    stop = threading.Event()

    def publish() -> None:
        number = 0
        while not stop.wait(0.005):
            number += 1
            sample = api.Telemetry(timestamp=1.0 * number, sequence=number, t_s=0.01 * number)
            daemon.publisher.send_multipart([b"smad", msgspec.json.encode(sample)])

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        stream = client.telemetry()
        first, second = next(stream), next(stream)
    finally:
        stop.set()
        thread.join()
    assert second.sequence == first.sequence + 1


def test_no_telemetry_is_an_error_with_what_to_look_at(client: Client) -> None:
    with pytest.raises(NoAnswer, match="smad status"):
        next(client.telemetry(timeout_s=0.05))


def test_recording_ends_with_the_block_even_when_it_fails(
    client: Client, daemon: FakeDaemon
) -> None:
    daemon.answers["record.start"] = api.RecorderStatus(recording=True, path="a.mcap")
    daemon.answers["record.stop"] = api.RecorderStatus(recording=False, path="a.mcap")

    def experiment() -> None:
        with client.record("a") as status:
            assert status.path == "a.mcap"
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        experiment()
    assert [request["method"] for request in daemon.asked] == ["record.start", "record.stop"]


async def test_control_is_given_back_at_the_end_of_the_block_even_when_it_fails(
    client: Client, daemon: FakeDaemon, tmp_path: Path
) -> None:
    daemon.answers["control.take"] = daemon.answers["control.release"] = api.Control()

    def experiment() -> None:
        with client.in_control("Ada", lease_s=3.0):
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        experiment()
    async with (
        AsyncClient(folder=tmp_path, timeout_s=30.0) as other,
        other.in_control("Bob", lease_s=4.0),
    ):
        pass
    asked = [(request["method"], request.get("params", {})) for request in daemon.asked]
    assert asked == [
        ("control.take", {"name": "Ada", "lease_s": 3.0}),
        ("control.release", {}),
        ("control.take", {"name": "Bob", "lease_s": 4.0}),
        ("control.release", {}),
    ]


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt, SystemExit])
def test_an_armed_block_disarms_whatever_ends_it(
    client: Client, daemon: FakeDaemon, error: type[BaseException]
) -> None:
    def experiment() -> None:
        with client.armed():
            raise error

    with pytest.raises(error):
        experiment()
    with client.armed():
        pass
    asked = [(request["method"], request["channel"]) for request in daemon.asked]
    assert asked == 2 * [("arm", "command"), ("disarm", "stop")]


def test_an_armed_block_disarms_when_the_arming_is_not_answered_but_not_when_it_is_refused(
    client: Client, daemon: FakeDaemon
) -> None:
    daemon.answers["arm"] = api.ErrorData(reason=api.Reason.ARMED, cause="somebody else armed it")
    with pytest.raises(NotReady), client.armed():
        pass
    assert [request["method"] for request in daemon.asked] == ["arm"]
    daemon.answers["arm"] = Silent()
    client.timeout_s = 0.05
    with pytest.raises(NoAnswer), client.armed():
        pass
    client.timeout_s = 30.0
    client.motion()
    assert [request["method"] for request in daemon.asked[1:]] == ["arm", "disarm", "motion"]


async def test_what_a_daemon_that_ended_did_not_get_is_not_carried_out_by_the_next_one(
    tmp_path: Path,
) -> None:
    async with contextlib.AsyncExitStack() as stack:
        with fake_daemon(tmp_path) as before:
            blocking = stack.enter_context(Client(folder=tmp_path, lease_s=None))
            client = await stack.enter_async_context(AsyncClient(folder=tmp_path, lease_s=None))
            blocking.motion()
            await client.motion()
            before.endpoints.connection_file.unlink()
        with pytest.raises(NoAnswer, match="has ended"):
            blocking.arm()
        with pytest.raises(NoAnswer, match="has ended"):
            await client.arm()
        with fake_daemon(tmp_path) as after:
            blocking.motion()
            await client.motion()
            assert {request["method"] for request in after.asked} == {"motion"}


def test_ctrl_c_pressed_twice_disarms_all_the_same(
    client: Client, daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    disarm, presses = client.disarm, iter([KeyboardInterrupt, KeyboardInterrupt])

    def interrupted() -> api.Motion:
        for press in presses:
            raise press
        return disarm()

    monkeypatch.setattr(client, "disarm", interrupted)

    def experiment() -> None:
        with client.armed():
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        experiment()
    assert [request["method"] for request in daemon.asked] == ["arm", "disarm"]


def test_what_ended_an_armed_block_is_not_hidden_by_a_disarm_that_fails(
    client: Client, daemon: FakeDaemon
) -> None:
    daemon.answers["disarm"] = api.ErrorData(reason=api.Reason.NO_REPLY, cause="no answer")

    def experiment() -> None:
        with client.armed():
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        experiment()
    with pytest.raises(BoardRefused), client.armed():
        pass


def test_ctrl_c_at_the_very_end_of_an_armed_block_disarms_all_the_same(
    client: Client, daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    disarm, presses = client.disarm, iter([KeyboardInterrupt])

    def interrupted() -> api.Motion:
        for press in presses:
            raise press
        return disarm()

    monkeypatch.setattr(client, "disarm", interrupted)
    with pytest.raises(KeyboardInterrupt), client.armed():
        pass
    assert [request["method"] for request in daemon.asked] == ["arm", "disarm"]


@pytest.mark.usefixtures("not_ignored")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_ends_the_program_ends_an_armed_block_first(
    client: Client, daemon: FakeDaemon, number: int
) -> None:
    with pytest.raises(SystemExit) as end, client.armed():
        signal.raise_signal(number)
    assert end.value.code == 128 + number
    assert [request["method"] for request in daemon.asked] == ["arm", "disarm"]
    assert signal.getsignal(number) is signal.SIG_DFL


def test_a_signal_that_the_program_ignores_is_left_to_it(client: Client) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with client.armed():
            signal.raise_signal(signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


async def test_an_armed_block_of_the_async_client_disarms_when_it_is_cancelled(
    daemon: FakeDaemon, tmp_path: Path
) -> None:
    async with AsyncClient(folder=tmp_path, timeout_s=30.0, lease_s=None) as client:
        inside = asyncio.Event()

        async def experiment() -> None:
            async with client.armed():
                inside.set()
                await asyncio.Event().wait()

        task = asyncio.create_task(experiment())
        await inside.wait()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert [request["method"] for request in daemon.asked] == ["arm", "disarm"]


def test_after_arming_requests_carry_the_generation_and_in_control_the_lease(
    client: Client, daemon: FakeDaemon
) -> None:
    daemon.answers["arm"] = msgspec.structs.replace(MOTION, generation=7)
    daemon.answers["disarm"] = msgspec.structs.replace(MOTION, generation=8)
    daemon.answers["control.take"] = api.Control(holder="Ada", yours=True, lease="secret")
    daemon.answers["control.release"] = api.Control()
    with client.in_control("Ada"), client.armed():
        client.move(Hold(duration_s=1.0))
        client.motion()
    client.move(Hold(duration_s=1.0))
    told = {
        request["method"]: (request.get("lease"), request.get("generation"))
        for request in daemon.asked[:-1]
    }
    assert told == {
        "control.take": (None, None),
        "arm": ("secret", None),
        "move": ("secret", 7),
        "motion": ("secret", None),
        "disarm": ("secret", None),
        "control.release": ("secret", None),
    }
    assert daemon.asked[-1]["generation"] == 8
    assert "lease" not in daemon.asked[-1]


def test_an_arming_for_a_person_carries_the_generation_that_the_person_knew_of(
    client: Client, daemon: FakeDaemon
) -> None:
    client.as_of(4)
    client.arm()
    client.arm()
    client.as_of(5)
    client.disarm()
    client.arm()
    told = [request.get("generation") for request in daemon.asked if request["method"] == "arm"]
    assert told == [4, 0, 5]


def test_waiting_ends_when_somebody_stopped_the_bench_and_armed_it_again() -> None:
    wait = Wait(0.0, timeout_s=5.0, generation=3)
    same = msgspec.structs.replace(MOTION, armed=True, done=False, generation=3)
    assert not wait.over(same, 1.0)
    with pytest.raises(Stopped, match="armed again since"):
        wait.over(msgspec.structs.replace(same, generation=4, done=True), 1.0)


def test_a_client_hears_that_another_one_replaced_its_motion(
    client: Client, daemon: FakeDaemon
) -> None:
    ours = daemon.answers["move"] = msgspec.structs.replace(MOTION, number=7)
    daemon.answers["motion"] = msgspec.structs.replace(MOTION, number=8)
    assert client.wait_until_done().done, "who has commanded nothing waits for whatever runs"
    client.move(Step(displacement_mm=1.0, duration_s=1.0))
    with pytest.raises(Stopped, match="another client ended or replaced it"):
        client.wait_until_done()
    daemon.answers["motion"] = ours
    assert client.wait_until_done().done


def test_another_axis_may_do_what_somebody_else_commands(
    client: Client, daemon: FakeDaemon
) -> None:
    def bench(first: int, second: int) -> api.Motion:
        numbers = {"a": first, "b": second}
        parts = {n: msgspec.structs.replace(MOTION, number=k) for n, k in numbers.items()}
        return msgspec.structs.replace(MOTION, axes=parts)

    daemon.answers["together"] = msgspec.structs.replace(MOTION, number=1)
    client.move({"a": Step(displacement_mm=1.0, duration_s=1.0)})
    daemon.answers["motion"] = bench(1, 5)
    assert client.wait_until_done().done
    daemon.answers["motion"] = bench(2, 5)
    with pytest.raises(Stopped):
        client.wait_until_done()


async def test_the_async_client_does_the_same(daemon: FakeDaemon, tmp_path: Path) -> None:
    async with AsyncClient(folder=tmp_path, timeout_s=30.0) as client:
        assert await client.motion() == MOTION
        await client.disarm()
        assert daemon.asked[-1]["channel"] == "stop"
        daemon.answers["arm"] = api.ErrorData(reason=api.Reason.NOT_ARMED, cause="no")
        with pytest.raises(NotReady):
            await client.arm()
        daemon.answers["idle"] = Silent()
        client.timeout_s = 0.05
        with pytest.raises(NoAnswer):
            await client.idle()
        client.timeout_s = 30.0
        assert (await client.wait_until_done()).done


def test_a_client_works_after_its_process_was_found_by_the_environment(
    daemon: FakeDaemon, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SMAD_RUNTIME_DIR", os.fspath(tmp_path))
    with Client(timeout_s=30.0) as client:
        assert client.motion() == MOTION


def _leasing(daemon: FakeDaemon, folder: Path) -> Client:
    daemon.answers["control.take"] = api.Control(holder="me", yours=True, lease="secret")
    daemon.answers["control.release"] = api.Control()
    daemon.answers["arm"] = daemon.answers["disarm"] = MOTION
    return Client(folder=folder, timeout_s=30.0, lease_s=0.5)


def test_who_arms_has_a_lease_before_it_arms_and_gives_it_back_once_it_is_disarmed(
    daemon: FakeDaemon, tmp_path: Path
) -> None:
    with _leasing(daemon, tmp_path) as client, client.armed():
        pass
    told = [(r["method"], r.get("lease")) for r in daemon.asked if r["method"] != "motion"]
    assert told == [
        ("control.take", None),
        ("arm", "secret"),
        ("disarm", "secret"),
        ("control.release", "secret"),
    ]
    assert daemon.asked[0]["params"]["lease_s"] == 0.5


def test_a_lease_is_renewed_while_its_program_computes(daemon: FakeDaemon, tmp_path: Path) -> None:
    renewed = threading.Event()

    def motion(request: dict[str, object]) -> api.Motion:
        if request.get("lease") == "secret":
            renewed.set()
        return MOTION

    with _leasing(daemon, tmp_path) as client, client.armed():
        daemon.answers["motion"] = motion
        assert renewed.wait(60.0)


def test_a_lease_lapses_with_the_thread_that_armed(daemon: FakeDaemon, tmp_path: Path) -> None:
    with contextlib.ExitStack() as stack:
        program = threading.Thread(
            target=lambda: stack.enter_context(_leasing(daemon, tmp_path)).arm()
        )
        program.start()
        program.join()
        assert [request["method"] for request in daemon.asked][:2] == ["control.take", "arm"]
        for renewing in threading.enumerate():
            if renewing.name == "smad lease":
                renewing.join(30.0)
                assert not renewing.is_alive()


def _after_control(daemon: FakeDaemon) -> list[str]:
    """Methods of requests, but for renewals; those that still had the lease are marked."""
    return [
        request["method"] + "*" * ("lease" in request)
        for request in daemon.asked
        if request["method"] != "motion"
    ]


def test_a_block_in_control_that_leaves_the_bench_armed_lets_its_lease_lapse(
    daemon: FakeDaemon, tmp_path: Path
) -> None:
    def program(client: Client) -> None:
        with client.in_control("Ada", lease_s=0.5):
            client.arm()
            raise ZeroDivisionError

    with _leasing(daemon, tmp_path) as client:
        with pytest.raises(ZeroDivisionError):
            program(client)
        assert client._renewal._over is None
        client.idle()
    assert _after_control(daemon) == ["control.take", "arm*", "idle"]


@pytest.mark.parametrize("in_control", [True, False])
def test_what_a_program_does_after_a_disarm_without_an_answer_renews_no_lease(
    daemon: FakeDaemon, tmp_path: Path, in_control: bool
) -> None:
    def program(client: Client) -> None:
        control = client.in_control("Ada", lease_s=0.5) if in_control else contextlib.nullcontext()
        with control, client.armed():
            daemon.answers["disarm"] = Silent()
            client.timeout_s = 0.05

    with _leasing(daemon, tmp_path) as client:
        with pytest.raises(NoAnswer):
            program(client)
        assert client._renewal._over is None
        client.timeout_s = 30.0
        client.idle()
    # `armed` asks once more. In control, the block's end forgets the lease; without, the first
    # disarm that is not answered.
    again = "disarm*" if in_control else "disarm"
    assert _after_control(daemon) == ["control.take", "arm*", "disarm*", again, "idle"]


def test_control_is_renewed_again_after_a_disarm_inside_its_block(
    daemon: FakeDaemon, tmp_path: Path
) -> None:
    with _leasing(daemon, tmp_path) as client, client.in_control("Ada", lease_s=0.5):
        client.arm()
        client.disarm()
        renewed = threading.Event()

        def motion(request: dict[str, object]) -> api.Motion:
            if request.get("lease") == "secret":
                renewed.set()
            return MOTION

        daemon.answers["motion"] = motion
        assert renewed.wait(60.0)
    assert _after_control(daemon)[-1] == "control.release*"


def test_an_arming_that_is_refused_gives_the_lease_back(daemon: FakeDaemon, tmp_path: Path) -> None:
    with _leasing(daemon, tmp_path) as client:
        daemon.answers["arm"] = api.ErrorData(reason=api.Reason.BOARD_REFUSED, cause="too warm")
        with pytest.raises(BoardRefused):
            client.arm()
        client.motion()
        assert "lease" not in daemon.asked[-1]


def test_a_program_that_knows_of_no_other_stop_than_its_own_arms_again(
    daemon: FakeDaemon, client: Client
) -> None:
    for at in (3, 5, 7):
        daemon.answers["arm"] = msgspec.structs.replace(MOTION, generation=at - 1)
        daemon.answers["disarm"] = msgspec.structs.replace(MOTION, generation=at)
        client.arm()
        client.disarm()
    told = [request.get("generation") for request in daemon.asked if request["method"] == "arm"]
    # The last disarm but one ended in the fifth, and the arming after it knows of that only.
    assert told == [None, 3, 5]


def test_a_stop_of_somebody_else_beside_our_own_stays_unknown(
    daemon: FakeDaemon, client: Client
) -> None:
    daemon.answers["arm"] = msgspec.structs.replace(MOTION, generation=2)
    daemon.answers["disarm"] = msgspec.structs.replace(MOTION, generation=4)
    client.arm()
    client.disarm()
    client.arm()
    assert daemon.asked[-1]["generation"] == 2
