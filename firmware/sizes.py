"""`python -m firmware.sizes`: what the firmware takes of each chip, and the time of a sample.

Flash is code and constants, RAM what is fixed before the stack. A sample goes from the moment the
loop begins it to its STATE in the serial port's buffer: conversions, supervisor, outputs, frame.
The scene goes through every state, with both springs driven and both pumps on.

On the Mega the emulator counts cycles, interrupts included. On the Cortex-M4 QEMU counts
instructions, at 500 Hz; the milliseconds are two cycles an instruction, which is a guess on the
safe side and no measurement, and the time that the analogue converter takes. Interrupts of encoder
and tachometers are not among them.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from firmware.instructions import RecordedBench, replay
from firmware_protocol import messages as wire
from firmware_protocol.enums import BoardState, Fault
from firmware_protocol.events import Connected, RequestDone, StateReceived
from firmware_protocol.host import HostSession
from sim_device.errors import BenchError
from sim_device.faults import injection
from sim_device.firmware.bench import FirmwareBench, firmware_bench
from sim_device.firmware.build import OUTPUT, PORTS, PROTOCOL, build, missing

MEGA_HZ = 16_000_000
M4_HZ = 84_000_000
M4_RATE_HZ = 500
M4_LIMIT_ms = 1e3 / M4_RATE_HZ
CYCLES_PER_INSTRUCTION = 2
CONVERSIONS_us = 5 * (480 + 12) / 21.0
"""Five of the longest sampling time, at a quarter of the 84 MHz."""
LIMIT_CYCLES = 52_800
"""3.3 ms of the 10 ms at 100 Hz."""
SIZED = {
    "mega": ("avr-size", "smad-mega.elf"),
    "cortex-m": ("arm-none-eabi-size", "smad-nucleo.elf"),
}
SCENE_S = 16.0
ARM_AT_S = 0.6
FAULT_AT_S = 7.0


def sizes(port: str) -> tuple[int, int]:
    """Return flash and RAM of a port in bytes. Raises BuildError."""
    build(port)
    command, name = SIZED[port]
    return _measured(command, OUTPUT / name)


def supervisor_bytes() -> int:
    """Return what the supervisor alone takes of a Cortex-M4's flash."""
    step = PORTS["cortex-m"].steps[0]
    with tempfile.TemporaryDirectory(prefix="smad-size-") as folder:
        made = Path(folder) / "supervisor.o"
        source = PROTOCOL / "smad_supervisor.c"
        subprocess.run([step.compiler, *step.flags, "-c", str(source), "-o", str(made)], check=True)
        return _measured(SIZED["cortex-m"][0], made)[0]


def _measured(command: str, path: Path) -> tuple[int, int]:
    done = subprocess.run([command, str(path)], capture_output=True, text=True, check=True)
    text, data, bss = (int(word) for word in done.stdout.splitlines()[1].split()[:3])
    return text + data, data + bss


class Scene:
    """A host that arms, heats both springs with the pumps on, is silent, disarms, and stops."""

    def __init__(self, bench: FirmwareBench, rate_hz: int = 100) -> None:
        self.bench = bench
        self.rate_hz = rate_hz
        self.host = HostSession(nonce=7)
        self.cycles: dict[BoardState, list[int]] = defaultdict(list)
        self._crc = 0

    def run(self) -> dict[BoardState, list[int]]:
        """Return the cycles of every sample by the state that its STATE told."""
        self.host.connect(0)
        for sample in range(round(SCENE_S * self.rate_hz)):
            self.bench.receive(self.host.data_to_send())
            data = self.bench.step()
            now_us = self.bench.now_us
            for event in [*self.host.receive(data, now_us), *self.host.tick(now_us)]:
                if isinstance(event, Connected):
                    self._crc = event.ident.param_crc
                elif isinstance(event, RequestDone) and isinstance(event.reply, wire.ArmToken):
                    self.host.request(wire.ArmConfirm(0, event.reply.token), now_us)
                elif isinstance(event, StateReceived):
                    self.cycles[event.state.mode].append(self.bench.board.sample_cycles)
                    self._act(sample, event.state, now_us)
        return self.cycles

    def _act(self, sample: int, state: wire.State, now_us: int) -> None:
        at_s = sample / self.rate_hz
        if at_s == ARM_AT_S:
            self.host.request(wire.ArmRequest(0, self._crc), now_us)
        if state.mode in (BoardState.ARMED, BoardState.HOLD) and not 4.0 < at_s < 4.2:
            i_mA = (4000, 3900) if at_s % 0.6 < 0.5 else (1000, 3000)
            self.host.send_setpoint(wire.Setpoint(0, state.t_us, i_mA, (255, 200), 0, 100))
        if at_s == 14.0:
            self.host.send_estop()
        if at_s == 10.0:
            self.host.request(wire.ClearFault(0, Fault.SENSOR_OPEN), now_us)


def cycles() -> dict[BoardState, list[int]]:
    """Return the cycles of every sample of the scene on the emulated Mega, by state."""
    bench = firmware_bench("avr", seed=1, faults=[injection("sensor_open", FAULT_AT_S, lasts=1.0)])
    try:
        return Scene(bench).run()
    finally:
        bench.close()


def instructions() -> tuple[dict[BoardState, list[int]], int]:
    """Return the instructions of every sample of the scene at 500 Hz on a Cortex-M4, by state.

    And the most from one sample to the next, with what the host sent in between.
    """
    fault = injection("sensor_open", FAULT_AT_S, lasts=1.0)
    bench = RecordedBench(build("host"), seed=1, faults=[fault], rate_hz=M4_RATE_HZ)
    try:
        Scene(bench, M4_RATE_HZ).run()
        steps = replay(build("qemu"), bench.board)
    finally:
        bench.close()
    table: dict[BoardState, list[int]] = defaultdict(list)
    longest = period = 0
    for step in steps:
        if step.state is not None:
            table[step.state.mode].append(step.sample)
            longest, period = max(longest, period), 0
        period += step.step
    return table, longest


def m4_ms(count: int) -> float:
    """Return the time that so many instructions may take, with a sample's conversions."""
    return (count * CYCLES_PER_INSTRUCTION / M4_HZ + CONVERSIONS_us * 1e-6) * 1e3


def _show(title: str, table: Mapping[BoardState, Sequence[int]], ms: Callable[[int], float]) -> int:
    print(f"\n{title:<12} {'samples':>7} {'mean':>8} {'most':>8} {'most, ms':>9}")
    for state in sorted(table):
        taken = table[state]
        mean, most = sum(taken) // len(taken), max(taken)
        print(f"{state.name:<12} {len(taken):>7} {mean:>8} {most:>8} {ms(most):>9.2f}")
    return max(max(taken) for taken in table.values())


def _show_sizes() -> None:
    print(f"{'port':<10} {'flash':>8} {'RAM':>7}")
    for port in SIZED:
        if missing(port):
            print(f"{port:<10} not built: {missing(port)}")
            continue
        flash, ram = sizes(port)
        print(f"{port:<10} {flash:>6} B {ram:>5} B")
    if not missing("cortex-m"):
        print(f"supervisor alone on the cortex-m: {supervisor_bytes()} B, of 10000 B")


def main() -> int:
    """Print the tables; exit status 1 if a sample takes too long, 2 if something fails."""
    late = False
    try:
        _show_sizes()
        if missing("avr"):
            print(f"cycles need the emulator: {missing('avr')}")
        else:
            longest = _show("Mega, state", cycles(), lambda count: count / MEGA_HZ * 1e3)
            late = longest > LIMIT_CYCLES
            within = "OVER" if late else "within"
            print(f"longest {longest} cycles, {within} the {LIMIT_CYCLES} of 3.3 ms")
        if missing("qemu"):
            print(f"instructions of the cortex-m need the emulator: {missing('qemu')}")
        else:
            table, period = instructions()
            longest = _show("M4, state", table, m4_ms)
            late = late or m4_ms(period) > M4_LIMIT_ms
            within = "OVER" if m4_ms(period) > M4_LIMIT_ms else "within"
            print(
                f"longest {longest} instructions; with what the host sends {period}, "
                f"{m4_ms(period):.2f} ms, {within} the {M4_LIMIT_ms} ms of {M4_RATE_HZ} Hz"
            )
    except BenchError as error:
        print(f"firmware.sizes: {error}", file=sys.stderr)
        return 2
    return int(late)


if __name__ == "__main__":
    sys.exit(main())
