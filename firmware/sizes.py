"""`python -m firmware.sizes`: what the firmware takes of each chip, and the Mega's time a sample.

Flash is code and constants, RAM what is fixed before the stack. The cycles are counted by the
emulator from the moment the loop begins a sample to its STATE in the serial port's buffer:
conversions, supervisor, outputs, frame and every interrupt in between. The scene goes through
every state, with both springs driven and both pumps on.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections import defaultdict

from firmware_protocol import messages as wire
from firmware_protocol.enums import BoardState, Fault
from firmware_protocol.events import Connected, RequestDone, StateReceived
from firmware_protocol.host import HostSession
from sim_device.errors import BenchError
from sim_device.faults import injection
from sim_device.firmware.bench import FirmwareBench, firmware_bench
from sim_device.firmware.build import OUTPUT, build, missing

MEGA_HZ = 16_000_000
LIMIT_CYCLES = 52_800
"""3.3 ms of the 10 ms at 100 Hz."""
SIZED = {
    "mega": ("avr-size", "smad-mega.elf"),
    "cortex-m": ("arm-none-eabi-size", "smad-nucleo.elf"),
}
SCENE_SAMPLES = 1600
FAULT_AT_S = 7.0


def sizes(port: str) -> tuple[int, int]:
    """Return flash and RAM of a port in bytes. Raises BuildError."""
    build(port)
    command, name = SIZED[port]
    done = subprocess.run([command, str(OUTPUT / name)], capture_output=True, text=True, check=True)
    text, data, bss = (int(word) for word in done.stdout.splitlines()[1].split()[:3])
    return text + data, data + bss


class Scene:
    """A host that arms, heats both springs with the pumps on, is silent, disarms, and stops."""

    def __init__(self, bench: FirmwareBench) -> None:
        self.bench = bench
        self.host = HostSession(nonce=7)
        self.cycles: dict[BoardState, list[int]] = defaultdict(list)
        self._crc = 0
        self._armed_at: int | None = None
        self._cleared = False

    def run(self) -> dict[BoardState, list[int]]:
        """Return the cycles of every sample by the state that its STATE told."""
        self.host.connect(0)
        for sample in range(SCENE_SAMPLES):
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
        if sample == 60:
            self.host.request(wire.ArmRequest(0, self._crc), now_us)
        if state.mode in (BoardState.ARMED, BoardState.HOLD) and not 400 < sample < 420:
            i_mA = (4000, 3900) if sample % 60 < 50 else (1000, 3000)
            self.host.send_setpoint(wire.Setpoint(0, state.t_us, i_mA, (255, 200), 0, 100))
        if sample == 1400:
            self.host.send_estop()
        if sample == 1000:
            self.host.request(wire.ClearFault(0, Fault.SENSOR_OPEN), now_us)


def cycles() -> dict[BoardState, list[int]]:
    """Return the cycles of every sample of the scene on the emulated Mega, by state."""
    bench = firmware_bench("avr", seed=1, faults=[injection("sensor_open", FAULT_AT_S, lasts=1.0)])
    try:
        return Scene(bench).run()
    finally:
        bench.close()


def main() -> int:
    """Print both tables; exit status 1 if a sample takes too long."""
    print(f"{'port':<10} {'flash':>8} {'RAM':>7}")
    for port in SIZED:
        if missing(port) or shutil.which(SIZED[port][0]) is None:
            print(f"{port:<10} not built: {missing(port)}")
            continue
        try:
            flash, ram = sizes(port)
        except BenchError as error:
            print(f"{port:<10} {error}")
            continue
        print(f"{port:<10} {flash:>6} B {ram:>5} B")
    if missing("avr"):
        print(f"cycles need the emulator: {missing('avr')}")
        return 0
    table = cycles()
    print(f"\n{'Mega, state':<12} {'samples':>7} {'mean':>8} {'most':>8} {'most, ms':>9}")
    for state in sorted(table):
        taken = table[state]
        mean, most = sum(taken) // len(taken), max(taken)
        print(f"{state.name:<12} {len(taken):>7} {mean:>8} {most:>8} {most / MEGA_HZ * 1e3:>9.2f}")
    longest = max(max(taken) for taken in table.values())
    within = "within" if longest <= LIMIT_CYCLES else "OVER"
    print(f"longest {longest} cycles, {within} the {LIMIT_CYCLES} of 3.3 ms")
    return int(longest > LIMIT_CYCLES)


if __name__ == "__main__":
    sys.exit(main())
