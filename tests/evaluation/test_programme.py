"""The design of the check-up's programme: places with free laws, held against each other."""

import numpy as np
import pytest

from evaluation.command import main
from evaluation.errors import WithheldError
from evaluation.programme.segments import candidate
from evaluation.programme.separations import (
    Limits,
    Rivals,
    Safe,
    Separations,
    chosen,
    design,
    merit,
    safe,
    separations,
)
from sim_device.plant.laws import Law, Term
from smad.checkup.programme import shipped
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.spring_pair import SmaPlant

CONSTANT = (Term(name="constant", coefficient=0.0),)


def laid(responses: np.ndarray) -> tuple[Rivals, np.ndarray]:
    """Laws of one term each at places a, b, c, and products of their responses."""
    laws = tuple(Law(name, "both", CONSTANT) for name in "abc")
    runs = (responses[:, :, None].astype(np.float32),)
    found = Responses(laws=laws, scales=dict.fromkeys("abc", 1.0), runs=runs)
    return Rivals.of(found), responses @ responses.T


def share_of(found: Separations, law: str, rival: str) -> float:
    (at,) = [
        n
        for n, (k, i) in enumerate(found.rivals.pairs)
        if found.rivals.names[k] == f"{law} both" and found.rivals.candidates[i].place == rival
    ]
    return float(found.share[at])


def test_a_rival_that_responds_alike_leaves_nothing_and_one_that_is_apart_leaves_all() -> None:
    rivals, gram = laid(np.array([[3.0, 0.0, 0.0], [6.0, 0.0, 0.0], [0.0, 2.0, 0.0]]))
    found = separations(rivals, gram)
    assert share_of(found, "a", "b") == pytest.approx(0.0, abs=1e-4)
    assert share_of(found, "a", "c") == pytest.approx(1.0, abs=1e-4)
    a, b, d2, share = found.worst(1)[0]
    assert {a.split()[0], b.split()[0]} == {"a", "b"}
    assert d2 == pytest.approx(0.0, abs=1e-3)
    assert share == pytest.approx(0.0, abs=1e-3)


def test_what_parameters_imitate_does_not_separate() -> None:
    rivals, _ = laid(np.eye(3))
    loud = 100.0
    rows = np.array([[3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 3.0], [loud, 0.0, 0.0]])
    with_parameter = separations(rivals, rows @ rows.T)
    without = separations(rivals, rows[:3] @ rows[:3].T)
    own = [n for n, (k, _) in enumerate(rivals.pairs) if k == 0]
    assert (with_parameter.log_d2[own] < 0.01).all()
    assert (without.log_d2[own] > 2.0).all()


def test_the_runs_that_part_the_closest_pair_are_chosen() -> None:
    alike = np.array([[3.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    apart = np.array([[3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 2.0]])
    rivals, _ = laid(alike)
    run = shipped().runs[0]
    pool = [Safe(run, r @ r.T) for r in (alike, alike, apart)]
    assert 2 in chosen(pool, rivals, 1)
    assert merit(separations(rivals, pool[2].gram)) > merit(separations(rivals, pool[0].gram))


def test_a_candidate_keeps_to_its_time_and_to_the_limits_at_every_corner() -> None:
    plant = SmaPlant()
    run = candidate("c", 5, 75.0)
    assert run.duration_s == pytest.approx(75.0)
    kept = safe(plant, run, Limits())
    assert kept is not None
    assert safe(plant, run, Limits(temperature_degC=30.0)) is None


@pytest.mark.parametrize("arguments", [["--of", "nowhere"], ["--candidates", "1", "--runs", "2"]])
def test_a_design_that_cannot_be_made_is_reported_in_one_sentence(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["design", *arguments])
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert said.count("\n") == 1


def test_a_design_of_few_candidates_says_what_it_separates() -> None:
    plant = SmaPlant()
    sd = np.full(len(plant.channels), 0.1)
    asked = {"quick": 1, "duration_s": 40.0, "seed": 3}
    programme, whole, part = design(plant, sd, runs=2, candidates=3, **asked)
    assert [r.name for r in programme.runs] == ["run-1", "run-2"]
    assert [r.quick for r in programme.runs] == [True, False]
    assert merit(whole) > merit(part) > 0.0
    with pytest.raises(WithheldError, match="more --candidates"):
        design(plant, sd, runs=2, candidates=1, **asked)
