"""Every state that arming can reach in small keeps what it promises (`tests.smad.daemon.model`)."""

from __future__ import annotations

import pytest

from smad.daemon import arming
from smad.daemon.arming import Input, Phase
from tests.smad.daemon.model import explore
from tests.smad.daemon.model_steps import NAMES, Violation

pytestmark = pytest.mark.timeout(1_500)
"""On a busy machine."""

POLICIES = {"all": frozenset[str](), "own": frozenset(NAMES)}


@pytest.mark.parametrize("policy", POLICIES)
def test_in_no_state_is_an_axis_armed_that_was_told_to_be_off(
    policy: str, capsys: pytest.CaptureFixture[str]
) -> None:
    explored = explore(POLICIES[policy])
    with capsys.disabled():
        print(f' [fault_holds = "{policy}": {explored.in_words()}]', end="")
    assert explored.states > 300_000, "the model has lost what can happen"


@pytest.mark.parametrize(
    ("phase", "what", "wrong", "told"),
    [
        # The mistakes of earlier versions of the daemon, each as one line of the table.
        (Phase.CONFIRMED, Input.STOP, Phase.OFF, "armed"),
        (Phase.CONFIRMED, Input.LOST, Phase.OFF, "armed"),
        (Phase.ARMED, Input.LOST, Phase.OFF, "armed"),
        (Phase.STOPPING, Input.LOST, Phase.OFF, "armed"),
        (Phase.ARMED, Input.STOP, Phase.OFF, "armed"),
    ],
)
def test_the_model_finds_what_a_wrong_table_leads_to(
    monkeypatch: pytest.MonkeyPatch, phase: Phase, what: Input, wrong: Phase, told: str
) -> None:
    changed = {**arming.TRANSITIONS, phase: {**arming.TRANSITIONS[phase], what: wrong}}
    monkeypatch.setattr(arming, "TRANSITIONS", changed)
    with pytest.raises(Violation, match=told):
        explore(frozenset())


def test_the_model_finds_an_arming_that_is_begun_while_a_stop_is_open(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # What the daemon did: only the axes that were named had to be off.
    def only_those_named(self: arming.Arming, names: tuple[str, ...], generation: int) -> object:
        if self.attempt is not None:
            return arming.WhyNot.BUSY
        return None if self.all_off(names) else arming.WhyNot.OPEN

    monkeypatch.setattr(arming.Arming, "why_not", only_those_named)
    with pytest.raises(Violation, match=r"(?s)a client stops.*a client arms.*is armed"):
        explore(frozenset())


def test_the_model_finds_an_arming_that_is_begun_while_a_reply_is_open(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Every axis is off: the first one is seen to be, is armed again, and then the reply is sent.
    def whatever_is_replied(self: arming.Arming, names: tuple[str, ...], _: int) -> object:
        if self.attempt is not None:
            return arming.WhyNot.BUSY
        return None if self.all_off(self.names) else arming.WhyNot.OPEN

    monkeypatch.setattr(arming.Arming, "why_not", whatever_is_replied)
    with pytest.raises(Violation, match=r"(?s)a client stops.*a client arms.*is armed"):
        explore(frozenset())


def test_the_model_finds_generations_that_begin_anew_with_each_daemon(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("tests.smad.daemon.model_steps.BOOTS_APART", 0)
    with pytest.raises(Violation, match="another daemon"):
        explore(frozenset())
