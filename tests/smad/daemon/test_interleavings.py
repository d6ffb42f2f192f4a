"""No interleaving of arming, stopping and what breaks leaves a board armed that was told off."""

from __future__ import annotations

import pytest

from smad.daemon import arming
from tests.smad.daemon.interleavings import Violation, chunks_of, run_chunk

pytestmark = pytest.mark.timeout(1_500)
"""On a busy machine."""

TRIALS = 400
"""`python -m tests.smad.daemon.interleavings` runs 20 000."""
SEED = 53
CHUNKS = list(chunks_of(TRIALS, SEED))


@pytest.mark.parametrize(("seed", "trials", "own"), CHUNKS, ids=[seed for seed, _, _ in CHUNKS])
def test_no_board_is_armed_after_it_was_told_to_be_off(seed: str, trials: int, own: bool) -> None:
    counts = run_chunk(seed, trials, own=own)
    assert counts["trials"] == trials
    for what in ("arm: armed", "arm: stopped", "stop: stopped", "faults", "cables pulled"):
        assert counts[what], f"{what} never came up"


def test_the_oracle_sees_an_arming_that_is_not_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    def only_forget(self: arming.Arming) -> None:
        if self.attempt is not None:
            self.attempt.failed = True
            for name in self.attempt.names:
                self.axes[name].phase = arming.Phase.OFF

    monkeypatch.setattr(arming.Arming, "fail", only_forget)
    with pytest.raises(Violation, match="heats at"):
        run_chunk("a mutant", 300, own=True)
