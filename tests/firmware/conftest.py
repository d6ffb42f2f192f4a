"""Benches around each board; a port of the firmware whose compiler is missing is skipped."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from sim_device.bench import SimulatedBench
from sim_device.firmware.bench import FirmwareBench, firmware_bench
from sim_device.firmware.build import reason_to_skip

PORTS = ("host", "avr")
Make = Callable[..., SimulatedBench]
MakeFirmware = Callable[..., FirmwareBench]

__all__ = ["PORTS", "Make", "MakeFirmware", "needs"]


def needs(port: str) -> None:
    """Skip the test, saying what to install, where the port cannot be built."""
    reason = reason_to_skip(port)
    if reason:
        pytest.skip(reason)


@pytest.fixture(params=PORTS)
def make_firmware(request: pytest.FixtureRequest) -> Iterator[MakeFirmware]:
    """Makes benches around one port after the other; they end with the test."""
    needs(request.param)
    benches: list[FirmwareBench] = []

    def make_bench(**options: Any) -> FirmwareBench:
        benches.append(firmware_bench(request.param, **options))
        return benches[-1]

    yield make_bench
    for bench in benches:
        bench.close()


@pytest.fixture(params=["python", *PORTS])
def make(request: pytest.FixtureRequest) -> Iterator[Make]:
    """Makes benches around one board after the other, the Python one first."""
    if request.param != "python":
        needs(request.param)
    benches: list[SimulatedBench] = []

    def make_bench(**options: Any) -> SimulatedBench:
        python = request.param == "python"
        bench = SimulatedBench(**options) if python else firmware_bench(request.param, **options)
        benches.append(bench)
        return bench

    yield make_bench
    for bench in benches:
        bench.close()
