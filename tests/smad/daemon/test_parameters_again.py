"""Parameters that were not read after a reconnection are read again, and then the bench arms."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign.virtual import Refused
from firmware_protocol import messages as wire
from tests.smad.daemon.tap import nothing
from tests.smad.daemon.test_arming import of, tapped_axes


async def test_a_board_whose_parameters_were_not_read_after_a_reconnection_can_be_armed(
    tmp_path: Path,
) -> None:
    async with tapped_axes(tmp_path) as (rig, taps):
        line, tap = rig.lines["yaw-1"], taps["yaw-1"]
        tap.to_host = of(wire.ParamValue)
        line.pull_the_plug()
        await rig.run_for(0.5)
        line.plug_in()
        await rig.run_for(6.0)
        assert rig.daemon.axes["yaw-1"].connected
        assert "yaw-1: the board's parameters were not read, and will be read again" in rig.said
        with pytest.raises(Refused, match=r"yaw-1: .*parameters are still being read"):
            await rig.ask_still("arm")
        tap.to_host = nothing
        await rig.run_for(3.0)
        assert rig.daemon.axes["yaw-1"].watch.parameters.agree
        assert (await rig.ask("arm"))["armed"]
