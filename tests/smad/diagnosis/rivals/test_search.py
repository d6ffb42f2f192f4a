"""The search: which fits compete."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from smad.diagnosis.rivals import competing
from smad.diagnosis.rivals.competing import CompetingFits
from smad.diagnosis.rivals.fit import Fit
from smad.diagnosis.rivals.parts import EffectPart, Model
from smad.diagnosis.rivals.rival import Question, Rival
from smad.diagnosis.rivals.score import EFFECT, LAW, NOTHING, PARAMETERS
from smad.diagnosis.rivals.search import Search, Step
from smad.diagnosis.spring_pair import SmaPlant


@dataclass(frozen=True)
class Leaving:
    """A rival by the floors that it leaves."""

    floors: float


def leaving(kind: str, floors: float, *, score: float = 0.0, probability: float = 0.0) -> Rival:
    """A rival that leaves these floors of the one channel of one run."""
    return Rival(
        kind=kind,
        name=kind,
        fit=None,
        squares=np.array([[floors**2]]),
        scores=np.array([score]),
        probability=probability,
    )


def floors_left(rival: Rival) -> float:
    return float(np.sqrt(rival.squares.sum()))


def is_quiet(rival: Rival) -> bool:
    return floors_left(rival) <= 1.35


def score_of(rival: Rival) -> float:
    return float(rival.scores.sum())


@dataclass(frozen=True)
class Steady:
    """A question to which a fit by a tempered prior is always likelier."""

    floors: float

    def log_weight(self, rival: Leaving) -> float:
        return float(rival.floors == self.floors)

    def refit_with_tempered_prior(self, *_: object) -> Leaving:
        return Leaving(self.floors)

    def gap(self, rival: Leaving) -> float:
        return rival.floors


@pytest.mark.parametrize(("steady", "taken"), [(9.0, 9.0), (12.0, 12.0), (21.0, 10.0)])
def test_a_fit_is_steadied_only_where_the_part_then_explains_something(
    steady: float, taken: float
) -> None:
    by_name = {"law:input": cast(Any, None)}
    fits = CompetingFits(cast(Any, Steady(steady)), "law", without=15.0, by_name=by_name)
    made = fits._likelier_refit(cast(Any, Leaving(10.0)), "law:input")
    assert cast(Any, made).floors == taken


@pytest.mark.parametrize(
    ("form_shares", "effect", "refuted"),
    [
        (None, 0.6, [True, False]),
        (None, 1.5, [False, False]),
        (np.array([0.9]), 0.6, [True, False]),
    ],
)
def test_a_simulator_that_leaves_more_than_nothing_new_leaves_is_refuted_by_one_that_does_not(
    form_shares: np.ndarray | None, effect: float, refuted: list[bool]
) -> None:
    question = SimpleNamespace(is_quiet=is_quiet, form_shares=form_shares, form_sd=())
    rivals = [
        leaving(NOTHING, 1.5),
        leaving(EFFECT, effect),
    ]
    assert Question.refuted(cast(Any, question), cast(Any, rivals)) == refuted


@pytest.mark.parametrize(
    ("form_shares", "in_one", "quiet"),
    [(0.9, 3.5, True), (0.9, 7.0, False), (None, 3.0, True), (None, 4.5, False)],
)
def test_one_channel_shows_that_something_is_missing_where_floors_hold_an_error_of_form(
    form_shares: float | None, in_one: float, quiet: bool
) -> None:
    """Over all ten channels seven floors in one are 2.3, as the error of form may leave."""
    gaps = np.array([in_one, *[0.5] * 9])
    question = SimpleNamespace(
        gap=lambda _: float(np.sqrt((gaps**2).mean())),
        channel_gaps=lambda _: gaps,
        judged=SimpleNamespace(trials=[None], counts=np.ones((1, 10)), recorded=10),
        form_shares=None if form_shares is None else np.full(10, form_shares),
        good=4,
    )
    assert Question.is_quiet(cast(Any, question), leaving(NOTHING, 0.0)) is quiet


def test_a_part_that_is_nearly_right_is_refuted_only_where_floors_hold_an_error_of_form() -> None:
    residual = [leaving(EFFECT, 1.5), leaving(NOTHING, 0.9)]
    for form_shares, refuted in ((None, False), (np.array([0.9]), True)):
        question = SimpleNamespace(is_quiet=is_quiet, form_shares=form_shares, form_sd=())
        first, _ = Question.refuted(cast(Any, question), cast(Any, residual))
        assert first is refuted


def test_a_simulator_that_a_part_has_entered_is_not_refuted_by_what_its_form_leaves() -> None:
    residual = [leaving(NOTHING, 1.5), leaving(EFFECT, 0.9)]
    question = SimpleNamespace(is_quiet=is_quiet, form_shares=None, form_sd=("of one run",))
    assert Question.refuted(cast(Any, question), cast(Any, residual)) == [False, False]


@pytest.mark.parametrize(
    ("form_sd", "floors", "incomplete"),
    [((), (20.0, 15.0), True), ((), (20.0, 1.2), False), (("of one run",), (20.0, 15.0), False)],
)
def test_a_simulator_with_free_parameters_surely_lacks_something_where_it_leaves_more_than_noise(
    form_sd: tuple[str, ...], floors: tuple[float, float], incomplete: bool
) -> None:
    question = SimpleNamespace(is_quiet=is_quiet, form_sd=form_sd)
    rivals = [
        leaving(NOTHING, floors[0]),
        leaving(PARAMETERS, floors[1]),
        leaving(EFFECT, 0.5),
    ]
    assert Question.incomplete(cast(Any, question), cast(Any, rivals)) is incomplete


@pytest.mark.parametrize(
    ("surely_incomplete", "likeliest_lessens_by", "enters"),
    [(True, 10.0, True), (False, 10.0, False), (True, -1.0, False)],
)
def test_where_several_things_are_missing_one_enters_that_is_likelier_than_none_and_lessens_the_gap(
    surely_incomplete: bool, likeliest_lessens_by: float, enters: bool
) -> None:
    nothing = leaving(NOTHING, 30.0, probability=0.1)
    likeliest = leaving(EFFECT, 30.0 - likeliest_lessens_by, score=7.0, probability=0.4)
    # Better by score, since it shows a quiet channel; all channels together it leaves no less.
    other = leaving(EFFECT, 30.5, score=4.0, probability=0.35)
    search = SimpleNamespace(
        question=SimpleNamespace(gap=floors_left, log_weight=score_of, tied="a day"),
        final=nothing,
        parts=("cooling_front",),
        moved=True,
    )
    entered = Search._choose(
        cast(Any, search), [likeliest, other, nothing], missing=surely_incomplete
    )
    assert entered is (likeliest if enters else None)


@pytest.mark.parametrize(("incomplete", "enters"), [(True, True), (False, False)])
def test_where_nothing_enters_a_simulator_that_surely_lacks_something_is_asked_what_it_lacks(
    incomplete: bool, enters: bool
) -> None:
    effect = leaving(EFFECT, 20.0, score=5.0)
    nothing = leaving(NOTHING, 30.0)

    def ranked(rivals: Sequence[Rival], *, missing: bool = False, by_rows: bool = False) -> Any:
        p = 0.6 if missing else 0.1
        return sorted(
            [replace(effect, probability=p), replace(nothing, probability=1.0 - p)],
            key=lambda rival: -rival.probability,
        )

    search = SimpleNamespace(
        question=SimpleNamespace(
            gap=floors_left,
            log_weight=score_of,
            tied="a day",
            form_sd=(),
            incomplete=lambda rivals: incomplete,
            ranked=ranked,
        ),
        final=nothing,
        parts=(),
        steps=[],
        moved=True,
    )
    search._choose = partial(Search._choose, cast(Any, search))
    _, entered = Search._compare(cast(Any, search), [nothing, effect])
    assert (entered is not None) is enters


def test_with_free_parameters_enters_what_scores_better_though_a_loud_signal_is_worse() -> None:
    nothing = leaving(NOTHING, 47.8, probability=0.01)
    # Both temperatures at a third, a displacement of 137 floors at 147.
    likeliest = leaving(EFFECT, 48.1, score=7.0, probability=0.8)
    search = SimpleNamespace(
        question=SimpleNamespace(gap=floors_left, log_weight=score_of, tied=None),
        final=nothing,
        parts=("unified_kinetics",),
        moved=True,
    )
    entered = Search._choose(cast(Any, search), [likeliest, nothing], missing=True)
    assert entered is likeliest


@pytest.mark.parametrize(("effect_leaves", "enters"), [(8.0, EFFECT), (31.0, LAW)])
def test_an_effect_enters_in_place_of_a_law_only_where_it_may_enter_itself(
    effect_leaves: float, enters: str
) -> None:
    def at_the_rtd(kind: str, floors: float, score: float, probability: float) -> Rival:
        part = SimpleNamespace(places=("rtd",))
        fit = SimpleNamespace(model=SimpleNamespace(parts=(part,)))
        rival = leaving(kind, floors, score=score, probability=probability)
        return replace(rival, fit=cast(Any, fit))

    law = at_the_rtd(LAW, 9.0, 6.0, 0.6)
    # Its score is as good, but a loud signal may be further off than without it.
    effect = at_the_rtd(EFFECT, effect_leaves, 6.5, 0.3)
    nothing = leaving(NOTHING, 30.0, probability=0.1)
    search = SimpleNamespace(
        question=SimpleNamespace(gap=floors_left, log_weight=score_of, tied="a day"),
        final=nothing,
        parts=("cooling_front",),
        moved=True,
    )
    entered = Search._choose(cast(Any, search), [law, effect, nothing], missing=False)
    assert entered is not None
    assert entered.kind == enters


def test_where_parts_are_withdrawn_the_last_table_is_that_of_rivals_beside_no_part() -> None:
    alone, lag = leaving(PARAMETERS, 5.0), leaving(EFFECT, 9.0)
    search = SimpleNamespace(
        question=SimpleNamespace(gap=floors_left, at_floor=lambda rival: False),
        parameters=alone,
        final=lag,
        parts=("rtd_lag", "driver_gain"),
        moved=True,
        steps=[
            Step(rivals=(leaving(NOTHING, 30.0),), entered=alone),
            Step(rivals=(lag, alone), entered=lag),
            Step(rivals=(leaving(NOTHING, 8.0),), entered=leaving(EFFECT, 8.0)),
        ],
        entered_parts=lambda: [(1, lag), (2, lag)],
    )
    Search.compare_with_parameters(cast(Any, search))
    assert search.final is alone
    *_, last = search.steps
    assert len(search.steps) == 2
    assert last.rivals == (lag, alone)
    assert last.entered is None


def test_a_fit_keeps_its_coordinates_where_its_parts_change_places() -> None:
    parts = tuple(
        SimpleNamespace(name=name, size=size) for name, size in (("a", 1), ("b", 2), ("c", 1))
    )
    model = Model(
        plant=cast(Any, SimpleNamespace(parameters=["film", "loss"])),
        start=cast(Any, None),
        parameter_precision=np.eye(2),
        parts=cast(Any, parts),
    )
    x = np.array([0.1, 0.2, 1.0, 2.0, 2.5, 3.0])
    fitted = Fit(
        model=model,
        x=x,
        residual=np.zeros(4),
        slopes=np.outer(x, np.ones(4)),
        linearized_at=-x,
        objective=7.0,
        shift=None,
    )
    moved = fitted.of_parts([1, 2, 0])
    assert [part.name for part in moved.model.parts] == ["b", "c", "a"]
    assert moved.x.tolist() == [0.1, 0.2, 2.0, 2.5, 3.0, 1.0]
    assert (moved.slopes[:, 0] == moved.x).all()
    assert (moved.linearized_at == -moved.x).all()
    assert moved.of_parts([2, 0, 1]).x.tolist() == x.tolist()


def test_an_imitated_effect_begins_halfway_unless_it_was_fitted_beside_other_parts() -> None:
    effects = {e.name: e for e in SmaPlant().effects}
    lag, gain = EffectPart(effects["rtd_lag"]), EffectPart(effects["driver_gain"])
    creep = SimpleNamespace(name="force_creep")
    base = SimpleNamespace(x=np.array([1.0, 4.0]), model=SimpleNamespace(parts=(creep,)))

    def imitated_effects(*parts: Any, x: list[float]) -> Any:
        return SimpleNamespace(
            fit=SimpleNamespace(model=SimpleNamespace(parts=parts), x=np.array(x))
        )

    size = lag.size
    rivals = [
        imitated_effects(creep, lag, x=[3.0, 2.0, *[8.0] * size]),
        imitated_effects(gain, lag, x=[3.0, 2.0, *[1.0] * gain.size, *[8.0] * size]),
        SimpleNamespace(fit=None),
    ]
    ((part, start),) = competing.halfway_starts(cast(Any, rivals), cast(Any, base))
    assert part is lag
    assert start[:2].tolist() == [2.0, 3.0]
    assert start[2:].tolist() == lag.weaker(np.full(size, 8.0), 0.5).tolist()


@pytest.mark.parametrize(("leaves", "begins"), [(900.0, True), (1300.0, False)])
def test_beside_a_cause_an_effect_begins_as_it_was_fitted_without_it_where_it_leaves_less_so(
    leaves: float, begins: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    effects = {e.name: e for e in SmaPlant().effects}
    lag, gain = EffectPart(effects["rtd_lag"]), EffectPart(effects["driver_gain"])

    def fitted(part: EffectPart, parameters: list[float], value: float) -> Rival:
        model = Model(
            plant=cast(Any, SimpleNamespace(parameters=["film", "loss"])),
            start=cast(Any, None),
            parameter_precision=np.eye(2),
            parts=(part,),
        )
        fit = SimpleNamespace(model=model, x=np.array([*parameters, *[value] * part.size]))
        return replace(leaving(EFFECT, 9.0), name=part.name, fit=cast(Any, fit))

    # Beside the lag the parameters have moved to imitate the gain: 4.0 and 5.0.
    entered, other = fitted(lag, [4.0, 5.0], 0.6), fitted(gain, [0.1, 0.2], 0.06)
    assert entered.fit is not None
    base = SimpleNamespace(model=entered.fit.model, x=entered.fit.x)
    rivals = (entered, other, leaving(NOTHING, 30.0))

    def objective_at(_: object, model: Model, x: np.ndarray) -> float:
        return leaves if [part.name for part in model.parts] == [lag.name, gain.name] else 1200.0

    monkeypatch.setattr(competing, "objective_at", objective_at)
    starts = competing.earlier_starts(cast(Any, None), rivals, cast(Any, base))
    begun = [x.tolist() for _, x in starts]
    assert begun == [[0.1, 0.2, *[0.6] * lag.size, *[0.06] * gain.size]] * begins
