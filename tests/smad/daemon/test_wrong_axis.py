"""A board that answers for another axis than its own is a lost axis, and a reported fault stops."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from campaign.virtual import Refused
from firmware_protocol import messages as wire
from firmware_protocol.codec import CODEC
from firmware_protocol.framing import DELIMITER, FrameDecoder
from smad.daemon.boardstop import BoardStop
from tests.smad.daemon.axes import NAMES, axes_in, lines
from tests.smad.daemon.tap import TappedLine, tapped
from tests.smad.daemon.test_axes import all_safe, armed, hot


class Renumbered(TappedLine):
    """A line on which the board says that its samples and reports are of axis 3."""

    wrong = False

    def _passed(self, data: bytes, lose: object, *, note: bool = False) -> bytes:
        passed = super()._passed(data, lose, note=note)  # type: ignore[arg-type]
        if not (note and self.wrong):
            return passed
        return b"".join(_renumbered(piece) for piece in passed.split(DELIMITER) if piece)


def _renumbered(piece: bytes) -> bytes:
    frames = FrameDecoder().feed(piece + DELIMITER)
    message = CODEC.unpack(frames[0].type, frames[0].payload) if frames else None
    if not isinstance(message, wire.State | wire.FaultReport):
        return piece + DELIMITER
    return CODEC.frame(replace(message, axis=3), frames[0].seq, frames[0].session)


def renumbered_lines() -> dict[str, TappedLine]:
    boards = {name: tapped(line) for name, line in lines().items()}
    boards["yaw-1"].__class__ = Renumbered
    return boards


async def test_samples_of_another_axis_are_no_sign_of_life(tmp_path: Path) -> None:
    boards = renumbered_lines()
    async with axes_in(tmp_path, boards) as rig:
        await armed(rig)
        boards["yaw-1"].wrong = True  # type: ignore[attr-defined]
        await rig.run_for(0.7)
        assert hot(rig) == []
        assert "samples of another axis than link.axis 0" in rig.said
        with pytest.raises(Refused, match="yaw-1"):
            await rig.ask("arm")
        boards["yaw-1"].wrong = False  # type: ignore[attr-defined]
        await rig.run_for(1.0)
        await rig.run_until(all_safe(rig))
        await rig.run_for(2.0)
        assert (await rig.ask("arm"))["armed"]


async def test_a_fault_that_is_reported_stops_before_any_sample_shows_it(tmp_path: Path) -> None:
    async with axes_in(tmp_path, renumbered_lines()) as rig:
        await armed(rig)
        stop: BoardStop = rig.daemon.axes["yaw-1"].stop
        generation = rig.daemon.stops.generation
        stop.reported()
        assert rig.daemon.stops.generation == generation + 1
        await rig.run(6)
        assert hot(rig) == []
        motion = await rig.ask("motion")
        assert all("yaw-1" in motion["axes"][name]["ended"] for name in NAMES)
