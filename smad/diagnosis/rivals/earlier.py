"""Starts for fits beside a reference, from effects that were fitted in earlier steps.

Parameters that have moved to imitate an effect hide it from the screening.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from smad.diagnosis.plant import Array
from smad.diagnosis.rivals.evidence import Evidence
from smad.diagnosis.rivals.fit import Reference, objective_at
from smad.diagnosis.rivals.parts import EffectPart, Part
from smad.diagnosis.rivals.rival import Rival
from smad.diagnosis.rivals.score import EFFECT


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
