"""Fits of competing parts beside one simulator: all begin alike, the best are carried on."""

from dataclasses import dataclass, field

import numpy as np

from smad.diagnosis.plant import Array
from smad.diagnosis.rivals.convergence import polished
from smad.diagnosis.rivals.fit import NAT, Fit, Reference, fit, model_beside
from smad.diagnosis.rivals.parts import Part
from smad.diagnosis.rivals.rival import Question, Rival

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
