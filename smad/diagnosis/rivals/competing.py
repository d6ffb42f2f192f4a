"""Fits of competing parts beside one simulator: all begin alike, the best are carried on.

Parameters that have moved to imitate an effect hide it from the screening, so fits also start from
effects that were fitted in earlier steps.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from smad.diagnosis.plant import Array
from smad.diagnosis.rivals.convergence import polished
from smad.diagnosis.rivals.evidence import Evidence
from smad.diagnosis.rivals.fit import NAT, Fit, Reference, fit, model_beside, objective_at
from smad.diagnosis.rivals.parts import EffectPart, Part
from smad.diagnosis.rivals.rival import Question, Rival
from smad.diagnosis.rivals.score import EFFECT

POLISHED, WITHIN = 3, 60.0
"""Number of fits that are carried on to convergence, and how far above the best one F may be."""


@dataclass(eq=False)
class CompetingFits:
    """Competing fits of a `kind`: a few rounds for all, the best are carried on to convergence.

    `without` is the gap of the simulator without a new part, `least_objective` the smallest F so
    far; `by_name` has the best fit of each name.
    """

    question: Question
    kind: str
    without: float
    least_objective: float = np.inf
    by_name: dict[str, Fit] = field(default_factory=dict)

    def begin(self, reference: Reference, part: Part, start: Array) -> None:
        """Fit a part beside a reference for a few rounds; keep the better fit of a name."""
        e = self.question.evidence
        self.question.say(f"fitting {part.name}")
        model = model_beside(e, reference, part, start)
        fitted = fit(e, model, start, reference, enough=NAT)
        earlier = self.by_name.get(part.name)
        if fitted and (earlier is None or fitted.objective < earlier.objective):
            self._keep(part.name, fitted)

    def _keep(self, name: str, fitted: Fit) -> None:
        self.by_name[name] = fitted
        self.least_objective = min(self.least_objective, fitted.objective)

    def rivals(self) -> list[Rival]:
        """The fits as rivals, once the best are carried on to convergence."""
        question, near = self.question, []
        for name in sorted(self.by_name, key=lambda n: (self.by_name[n].objective, n))[:POLISHED]:
            if self.by_name[name].objective < self.least_objective + WITHIN:
                near.append(name)
                self._keep(name, polished(question.evidence, self.by_name[name]))
        scored = {n: question.rival(self.kind, n, fitted) for n, fitted in self.by_name.items()}
        # Where good runs tie the parameters, all fits have the tempered prior already.
        for name in near if question.tied is None else ():
            scored[name] = self._likelier_refit(scored[name], name)
        return [r for r in scored.values() if r is not None]

    def _likelier_refit(self, rival: Rival | None, name: str) -> Rival | None:
        """The rival, or its refit with the tempered prior if that is likelier and explains
        something, that is, leaves a smaller gap than the simulator without a part.
        """
        question = self.question
        steady = question.refit_with_tempered_prior(self.kind, name, self.by_name[name])
        if rival is None or steady is None:
            return rival or steady
        likelier = question.log_weight(steady) >= question.log_weight(rival)
        explains = question.gap(steady) < max(self.without, question.gap(rival))
        return steady if likelier and explains else rival


def earlier_starts(
    evidence: Evidence, rivals: Sequence[Rival], base: Reference
) -> Iterator[tuple[Part, Array]]:
    """Effects among the rivals of the last step with the coordinates of their fits there, if F at
    these is lower than at the reference.

    The parameters of the reference may have moved beside a part to imitate a second effect; those
    that were fitted together with that effect have not.
    """
    if not rivals:
        return
    model, p = base.model, base.model.parameters
    present = {part.name for part in model.parts}
    without = objective_at(evidence, model, base.x)
    for rival in rivals:
        if rival.kind != EFFECT or rival.name in present:
            continue
        fitted, part = rival.fitted, rival.parts[-1]
        x = np.r_[fitted.x[:p], base.x[p:], fitted.x[fitted.model.slices[-1]]]
        if objective_at(evidence, model.with_parts([*model.parts, part]), x) < without:
            yield part, x


def halfway_starts(
    imitated_effects: Sequence[Rival], base: Reference
) -> Iterator[tuple[EffectPart, Array]]:
    """Effects that moved parameters imitate, with starts half way between the two explanations.

    Those that were fitted beside other parts than those of `base` are left out.
    """
    k, present = len(base.x), [part.name for part in base.model.parts]
    for rival in imitated_effects:
        if rival.fit is not None:
            *beside, part = rival.fit.model.parts
            if isinstance(part, EffectPart) and [p.name for p in beside] == present:
                x = rival.fit.x
                yield part, np.r_[0.5 * (base.x + x[:k]), part.weaker(x[k:], 0.5)]
