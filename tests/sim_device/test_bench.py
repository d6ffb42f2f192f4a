"""Board and plant in lockstep: typed and over bytes alike, reproducible, and no nuisance trips."""

import math

import msgspec
import pytest

from firmware_protocol import messages as wire
from firmware_protocol.enums import BoardState, ResetCause
from firmware_protocol.events import HostState
from sim_device.bench import SimulatedBench
from sim_device.errors import RefusedError
from sim_device.faults import injection
from sim_device.plant import load_parameters

from . import harsh
from .loop import Loop, hold


def wave(state: wire.State) -> wire.Setpoint:
    """A setpoint that depends on the reading, so that any difference between two runs grows."""
    phase = state.t_us * 1e-6
    warm = state.rtd_cC[0] - 2700
    x_mA = max(0, round(2000 * math.sin(phase) + state.force_counts % 7 - warm / 10))
    return wire.Setpoint(0, state.t_us, (x_mA, 300), (0, 255 if phase % 2 < 1 else 0), 0, 100)


def run_typed(samples: int, **options: object) -> list[wire.State]:
    bench = SimulatedBench(**options)  # type: ignore[arg-type]
    bench.arm()
    state = bench.step_typed(None)
    states = []
    for _ in range(samples):
        state = bench.step_typed(wave(state))
        states.append(state)
    return states


def test_bytes_and_the_typed_shortcut_give_the_same_states() -> None:
    loop = Loop(SimulatedBench(seed=8))
    loop.armed()
    loop.step(5)
    first = len(loop.states)
    loop.answer = wave
    loop.step(600)

    bench = SimulatedBench(seed=8)
    armed_at = next(n for n, s in enumerate(loop.states) if s.mode is BoardState.ARMED)
    typed: list[wire.State] = []
    for n in range(len(loop.states)):
        if n == armed_at:
            bench.arm()
        answer = wave if n > first else harsh.setpoint
        typed.append(bench.step_typed(answer(typed[-1]) if n >= armed_at else None))
    # A host counts its setpoints from the session's start, the typed shortcut from the arming.
    shift = (loop.states[-1].sp_seq - typed[-1].sp_seq) & 0xFF
    begin = armed_at + 3
    aligned = [
        msgspec.structs.replace(state, sp_seq=(state.sp_seq + shift) & 0xFF)
        for state in typed[begin:]
    ]
    assert aligned == loop.states[begin:]


def test_the_same_seed_gives_the_same_samples_to_the_bit() -> None:
    assert run_typed(300, seed=4) == run_typed(300, seed=4)


def test_another_seed_gives_other_noise() -> None:
    assert run_typed(50, seed=4) != run_typed(50, seed=5)


def test_the_same_seed_gives_the_same_bytes_with_damage_on_the_line() -> None:
    def run() -> tuple[int, list[wire.State]]:
        faults = [injection("flip_bits", 0.5, rate=2e-3), injection("sensor_spikes", 1.0, every=90)]
        loop = Loop(SimulatedBench(seed=6, faults=faults))
        loop.step(400)
        return loop.host.stats.decoder.crc_errors, loop.states

    first, second = run(), run()
    assert first == second
    assert first[0] > 0


def test_the_way_to_a_current_is_physical() -> None:
    bench = SimulatedBench(seed=1)
    state = harsh.run(bench, harsh.plain(4000), 4.3)
    assert 4000 < state.rtd_cC[0] < 5600
    assert state.encoder_counts > 3000
    assert bench.heater_J == pytest.approx(4.3 * 16 * 0.757, rel=0.03)


def test_a_setpoint_that_comes_late_is_applied_from_its_own_time_on() -> None:
    heats = {}
    for at_us in (0, 5000, 9000):
        bench = SimulatedBench(seed=1)
        loop = Loop(bench).armed()
        loop.answer = hold(0)
        loop.step(20)
        before = bench.heater_J
        loop.host.send_setpoint(wire.Setpoint(0, loop.states[-1].t_us, (4000, 0), (0, 0), 0, 100))
        bench.receive(loop.host.data_to_send(), bench.now_us + at_us)
        state = bench.advance()
        assert state is not None
        assert state.sp_age_us == at_us
        heats[at_us] = bench.heater_J - before
    assert heats[5000] == pytest.approx(heats[0] / 2, rel=0.05)
    assert heats[9000] == pytest.approx(heats[0] / 10, rel=0.1)


def test_arming_typed_says_why_not() -> None:
    bench = SimulatedBench(faults=[injection("sensor_open", 0.0, channel=2)])
    with pytest.raises(RefusedError, match="INLET reads 32767"):
        bench.arm()


def test_typed_commands_do_what_the_wire_ones_do() -> None:
    bench = SimulatedBench()
    bench.arm()
    harsh_state = bench.step_typed(None)
    for _ in range(600):
        harsh_state = bench.step_typed(harsh.setpoint(harsh_state, 4000))
    bench.disarm()
    assert bench.step_typed(None).mode is BoardState.COOL
    bench.stop()
    assert bench.step_typed(None).mode is BoardState.ESTOP
    with pytest.raises(RefusedError, match="the board is in ESTOP"):
        bench.arm()


def test_a_stale_typed_setpoint_is_refused() -> None:
    bench = SimulatedBench()
    bench.arm()
    old = bench.step_typed(None)
    for _ in range(6):
        bench.step_typed(None)
    state = bench.step_typed(harsh.setpoint(old, 4000))
    assert state.i_applied_mA == (0, 0)


def test_a_reboot_while_armed_leaves_the_heater_off_and_the_host_in_monitor() -> None:
    loop = Loop(SimulatedBench()).armed()
    loop.answer = hold(4000)
    loop.step(100)
    loop.bench.reboot(ResetCause.PIN)
    before = loop.bench.heater_J
    loop.step(200)
    assert loop.bench.heater_J == before
    assert loop.restarts == 1
    assert loop.host.state is HostState.MONITOR
    assert loop.mode is BoardState.SAFE
    assert loop.host.board is not None
    assert loop.host.board.boot_count == 2


def test_a_board_that_hangs_for_long_is_restarted_by_its_watchdog() -> None:
    bench = SimulatedBench(faults=[injection("hang", 2.0, seconds=1.0)])
    loop = Loop(bench).armed()
    loop.answer = hold(4000)
    loop.until(lambda: bench.now_us >= 2_000_000)
    before = bench.heater_J
    loop.step(300)
    assert bench.heater_J - before < 0.12 * 12.5
    assert loop.host.board is not None
    assert loop.host.board.reset_cause is ResetCause.WATCHDOG
    assert loop.mode is BoardState.SAFE


def test_a_setpoint_that_waited_while_the_loop_hung_is_as_old_as_the_hang() -> None:
    for hang_s, stale in ((0.03, 0), (0.07, 1)):
        bench = SimulatedBench()
        loop = Loop(bench).armed()
        loop.answer = hold(0)
        loop.step(10)
        bench.hang(hang_s)
        before = bench.board.session.stats.stale_setpoints
        loop.step(12)
        assert bench.board.session.stats.stale_setpoints - before == stale


def test_a_clock_that_drifts_shows_against_the_benchs_time() -> None:
    bench = SimulatedBench(faults=[injection("clock_drift", 0.0, ppm=200)])
    bench.arm()
    for _ in range(10_000):
        bench.step_typed(None)
    assert bench.board.now_us - bench.now_us == pytest.approx(bench.now_us * 200e-6, abs=2)


@pytest.mark.parametrize("name", harsh.SCRIPTS)
@pytest.mark.parametrize("bench_name", ["A", "B"])
def test_legitimate_harsh_use_trips_nothing(name: str, bench_name: str) -> None:
    make, seconds = harsh.SCRIPTS[name]
    bench = SimulatedBench(parameters=load_parameters(bench_name), seed=2)
    state = harsh.run(bench, make(), seconds)
    assert state.mode is BoardState.ARMED, bench.board.supervisor.first_fault
    assert state.faults == 0


@pytest.mark.parametrize("name", harsh.WITHOUT_WATER)
def test_bare_wires_in_air_trip_nothing(name: str) -> None:
    make, seconds = harsh.SCRIPTS[name]
    bench = SimulatedBench(cooling="air", seed=2)
    assert harsh.run(bench, make(), seconds).faults == 0, bench.board.supervisor.first_fault


@pytest.mark.parametrize("rate_hz", [250, 500])
@pytest.mark.parametrize("name", ["4 A in drained tubes", "4 A on and off twice a second"])
def test_harsh_use_trips_nothing_at_higher_rates(name: str, rate_hz: int) -> None:
    make, seconds = harsh.SCRIPTS[name]
    bench = SimulatedBench(rate_hz=rate_hz, seed=2)
    assert harsh.run(bench, make(), seconds).faults == 0, bench.board.supervisor.first_fault


@pytest.mark.parametrize("seed", range(3))
def test_benches_drawn_from_the_whole_range_trip_nothing(seed: int) -> None:
    parameters = harsh.drawn_parameters(seed)
    for name in ("4 A in still water", "heat, then flush", "sine 12 mm, 20 s"):
        make, seconds = harsh.SCRIPTS[name]
        bench = SimulatedBench(parameters=parameters, seed=seed)
        state = harsh.run(bench, make(), min(seconds, 60.0))
        assert state.faults == 0, (name, bench.board.supervisor.first_fault)


def test_a_bench_around_set_b_differs_from_it_but_in_what_sets_it_apart() -> None:
    a, b, drawn = load_parameters("A"), load_parameters("B"), harsh.drawn_parameters(harsh.AROUND_B)
    for entry in b.entries:
        if a[entry.name] != b[entry.name]:
            assert drawn[entry.name] == b[entry.name]
    assert drawn["film_scale"] != b["film_scale"]


def test_four_amperes_stay_below_the_boiling_point_of_water() -> None:
    for name in ("4 A in still water", "4 A in drained tubes"):
        make, _ = harsh.SCRIPTS[name]
        bench = SimulatedBench(seed=2)
        harsh.run(bench, make(), 60.0)
        assert bench.plant.truth.T_K[0] < 273.15 + 95.0
