"""The corpus through every harness, mutations of it, and proof that the harnesses can fail."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from campaign.fuzz import commands, config
from campaign.fuzz.corpus import read_corpus, write_corpus
from campaign.fuzz.limits import kind_of, within_limits
from campaign.fuzz.mutate import mutations
from campaign.fuzz.seeds import SEEDS
from campaign.fuzz.targets import CORPUS, TARGETS, Target
from firmware_protocol.description import ForeignCodec, Reader
from firmware_protocol.framing import FrameDecoder
from firmware_protocol.messages import Description
from firmware_protocol.supervisor import Supervisor
from sim_device.board import Board
from sim_device.plant import parameters
from sim_device.plant.models import save_model
from smad.config import default_toml
from smad.control.sample import sample_of
from smad.daemon.command.rpc import Call, Decoder
from smad.daemon.command.service import Service
from smad.daemon.control import ControlTask
from smad.records import channels
from smad.runlog import scan

MUTATIONS = 100
CORPUS_LIMIT_BYTES = 500_000

every_target = pytest.mark.parametrize("target", TARGETS.values(), ids=list(TARGETS))


@every_target
def test_every_input_of_the_corpus_is_taken_without_a_defect(target: Target) -> None:
    run = within_limits(target.harness(), target.allowed_s)
    for data in target.corpus().values():
        run(data)


@every_target
def test_mutations_of_the_corpus_are_taken_without_a_defect(target: Target) -> None:
    run = within_limits(target.harness(), target.allowed_s)
    for data in mutations(target, list(target.corpus().values()), MUTATIONS, seed=1):
        run(data)


def test_the_same_seed_gives_the_same_mutations() -> None:
    target = TARGETS["config"]
    corpus = list(target.corpus().values())
    once, again, other = (list(mutations(target, corpus, 20, seed)) for seed in (1, 1, 2))
    assert once == again != other


@every_target
def test_the_seeds_are_in_the_corpus_and_small_enough_to_be_mutated(target: Target) -> None:
    kept = target.corpus()
    made = dict(SEEDS[target.name]())
    assert made
    committed = {name for name in kept if name.startswith("seed-")}
    assert {f"seed-{label}" for label in made} == committed, "run python -m campaign.fuzz.seeds"
    assert max(map(len, kept.values())) <= target.longest


def test_every_command_of_the_seeds_is_understood() -> None:
    decoder = Decoder()
    for name, data in TARGETS["commands"].corpus().items():
        if name.startswith("seed-"):
            for line in data[1:].split(b"\n"):
                assert isinstance(decoder.decode(line), Call), (name, line)


def test_the_corpus_stays_small() -> None:
    archives = {path.name: path.stat().st_size for path in CORPUS.iterdir()}
    assert set(archives) == {target.archive.name for target in TARGETS.values()}
    assert sum(archives.values()) < CORPUS_LIMIT_BYTES


def test_an_archive_of_the_same_inputs_has_the_same_bytes(tmp_path: Path) -> None:
    archives = [tmp_path / name for name in ("one.zip", "two.zip")]
    inputs = {"b": b"\1\2", "a": b""}
    write_corpus(archives[0], inputs)
    write_corpus(archives[1], dict(reversed(inputs.items())))
    assert archives[0].read_bytes() == archives[1].read_bytes()
    assert read_corpus(archives[0]) == inputs


def forget_partial_frames(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(FrameDecoder, "_keep", lambda self, chunk: None)


def believe_to_be_armed(patch: pytest.MonkeyPatch) -> None:
    def armed(self: ControlTask, state: Any, t_us: int) -> Any:
        return sample_of(state, t_us, self.scales, armed=True)

    patch.setattr(ControlTask, "_sample", armed)


def trust_any_description(patch: pytest.MonkeyPatch) -> None:
    def trusting(self: Reader, piece: Description) -> tuple[str, ...]:
        assert self._download is not None
        description = self._download.add(piece)
        assert description is not None
        self.codec = ForeignCodec(description, self._own)
        return ()

    patch.setattr(Reader, "add", trusting)


def leak_current(patch: pytest.MonkeyPatch) -> None:
    honest = Board._state
    patch.setattr(
        Board,
        "_state",
        lambda self: msgspec.structs.replace(honest(self), i_applied_mA=(100, 0)),
    )


def let_the_stage_go_anywhere(patch: pytest.MonkeyPatch) -> None:
    honest = Supervisor.setpoint

    def blind(self: Supervisor, *arguments: Any, stage_um: int = 0) -> int:
        return honest(self, *arguments)

    patch.setattr(Supervisor, "setpoint", blind)


def raise_in_a_command(patch: pytest.MonkeyPatch) -> None:
    def broken(self: Service, params: Any, client: bytes) -> Any:
        raise KeyError(params)

    patch.setattr(Service, "params_list", broken)


def let_parse_errors_through(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(scan, "PARSE_ERRORS", ())


def write_another_configuration(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(config, "config_to_toml", lambda config: default_toml())


def check_no_ranges(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(parameters, "_within", lambda *arguments, **names: None)


def forget_the_note(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(
        "campaign.fuzz.models.save_model",
        lambda path, *, note, **names: save_model(path, note="", **names),
    )


def check_no_times(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(channels, "_check_time", lambda *arguments: None)


PLANTED: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "frames": forget_partial_frames,
    "host": believe_to_be_armed,
    "description": trust_any_description,
    "board": leak_current,
    "bench": let_the_stage_go_anywhere,
    "commands": raise_in_a_command,
    "runlog": let_parse_errors_through,
    "config": write_another_configuration,
    "parameters": check_no_ranges,
    "models": forget_the_note,
    "import": check_no_times,
}


@pytest.fixture
def new_daemon() -> Iterator[None]:
    """A daemon made while a defect is planted keeps it, and one made before does not get it."""
    commands.forget()
    yield
    commands.forget()


@every_target
@pytest.mark.usefixtures("new_daemon")
def test_a_planted_defect_is_found_by_the_corpus(
    target: Target, monkeypatch: pytest.MonkeyPatch
) -> None:
    PLANTED[target.name](monkeypatch)
    assert any(defects(target))


def defects(target: Target) -> Iterator[str]:
    run = target.harness()
    for data in target.corpus().values():
        try:
            run(data)
        except Exception as error:
            yield kind_of(error)


def test_an_input_that_takes_too_long_is_a_defect() -> None:
    def slow(data: bytes) -> None:
        sum(range(10_000))

    with pytest.raises(AssertionError, match="allowed"):
        within_limits(slow, allowed_s=0.0)(b"")


def test_an_input_that_takes_too_much_memory_is_a_defect(tmp_path: Path) -> None:
    def greedy(data: bytes) -> None:
        bytearray(b"\1") * (400 << 20)

    with pytest.raises(AssertionError, match="MiB"):
        within_limits(greedy, allowed_s=60.0)(b"")
