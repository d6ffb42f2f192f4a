"""The bench as it was: effects that even known-good runs ask for.

A model that lacks a law shows the lack in good runs too. What the library can say of it is fitted
to the good runs and stays in the model, fixed; the question is then what has changed on top of it,
and what remains is K_δ. An effect of the baseline may change as well: it stays a candidate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from smad.gap.fit import Start, joint_fits
from smad.gap.judge import judge
from smad.gap.lsq import Fitted, drive, fitting
from smad.gap.plant import Effect
from smad.gap.screen import probe, reprobe, screen
from smad.gap.select import cluster_gain


def learn_baseline(
    fit: Fitted, effects: Sequence[Effect], progress: Callable[[str], None] = lambda text: None
) -> Fitted:
    """The fit of the good runs with the effects that they ask for, all then fixed.

    One at a time, the best first, each judged on good runs left out in turn.
    """
    settings = fit.problem.evidence.settings
    library = sorted(effects, key=lambda e: e.name)
    current = fit
    probes = probe(current, library)
    for _ in range(settings.baseline_effects):
        probes = reprobe(probes, current)
        ranked = screen(probes)
        chosen = [s for s in ranked if s.gain > settings.baseline_gain][: settings.baseline_tried]
        if not chosen:
            break
        values = current.point.effects
        joints = joint_fits(
            current,
            [
                Start((*current.space.effects, s.effect), {**values, s.effect.name: s.start})
                for s in chosen
            ],
            longer=2,
            finish=1,
        )
        before, *after = judge([current, *(j.fit for j in joints.values())], None)
        best, best_gain = None, 0.0
        for joint, judged in zip(joints.values(), after, strict=True):
            gain, se = cluster_gain(current.problem, None, judged.scores() - before.scores())
            if gain > max(best_gain, settings.baseline_gain, se):
                best, best_gain = joint.fit, gain
        if best is None:
            break
        current = best
        progress("baseline: " + ", ".join(e.name for e in current.space.effects))
    return frozen(current)


def frozen(fit: Fitted) -> Fitted:
    """The same fit with its effects fixed instead of free."""
    space = replace(fit.space, effects=(), fixed=fit.point.effects)
    p, A = fit.p[: space.size], fit.A[:, : space.size]
    steps = fitting(fit.problem, space, p, theta_A=A, iterations=0)
    return drive(fit.problem.evidence, [steps])[0]
