"""A run log belongs to who began it, and ends with its lease."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign.virtual import Refused
from tests.smad.daemon.rig import rig_in
from tests.smad.daemon.test_axes import silent_for


async def test_the_named_run_log_of_a_program_that_was_killed_ends(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        # As the client library does: the lease comes with the arming, after the recording began.
        await rig.ask("record.start", b"ada", name="first")
        lease = (await rig.ask("control.take", b"ada", name="Ada", lease_s=0.5))["lease"]
        await rig.ask("arm", b"ada", members={"lease": lease})
        with pytest.raises(Refused, match=r"being recorded already, to .*\.mcap; stop it first"):
            await rig.ask("record.start", b"ada", members={"lease": lease}, name="second")
        await silent_for(rig, 0.7)
        assert not (await rig.ask("motion"))["armed"]
        assert "second" in (await rig.ask("record.start", b"bob", name="second"))["path"]


async def test_a_run_log_that_somebody_else_began_outlives_a_lapsed_lease(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        await rig.ask("record.start", b"bob", name="first")
        await rig.ask("control.take", b"ada", name="Ada", lease_s=0.5)
        await silent_for(rig, 0.7)
        with pytest.raises(Refused, match=r"being recorded already, to .*\.mcap; stop it first"):
            await rig.ask("record.start", b"ada", name="second")
