"""The tension of the tendon: where the springs fill its length, with or without friction.

Deflections grow with the tension, also with the fractions and temperatures that go with it, so
there is one root, held in a bracket. A few steps in which tension and temperatures converge
together come first, and are nearly always enough.
"""

from __future__ import annotations

from sim_device.plant.kernel.compiled import compiled, inlined
from sim_device.plant.kernel.mechanics import friction_at, slack_position, stretch_of_tendon
from sim_device.plant.kernel.model import ANTAGONISTIC, Constants, Effects, Model
from sim_device.plant.kernel.state import Spring, SpringWork, State, Work
from sim_device.plant.kernel.temperatures import (
    ITERATIONS,
    UNBOUNDED,
    copy_tension,
    follow_tension,
    safeguarded_newton_step,
    set_tension,
    solve_spring,
    step_spring,
    trusted_steps,
)

DELTA_TOLERANCE = 1e-10  # m
# Steps in which tension and temperatures converge together. A part that turns beside others takes
# some more to find its branch.
JOINT_STEPS = 4
JOINT_STEPS_ON_BRANCHES = 12


@inlined
def next_tension(
    trusted: bool, F: float, miss: float, last: float, slope: float, low: float, high: float
) -> float:
    """Newton's next tension, safeguarded from when its bracket is closed on; not below 0."""
    step = F - miss / slope
    if low == 0.0 and step <= 0.0:
        return 0.0
    if high == UNBOUNDED:
        return step
    return safeguarded_newton_step(trusted, F, miss, last, slope, low, high)


@inlined
def count_joint_steps(e: Effects) -> int:
    """How many steps of tension and temperatures together are tried first."""
    return JOINT_STEPS_ON_BRANCHES if e.unified > 0.0 else JOINT_STEPS


@inlined
def is_root(F: float, miss: float, low: float, high: float) -> bool:
    """Whether the root is found: within tolerance, in a closed bracket, or slack, at no tension."""
    if abs(miss) <= DELTA_TOLERANCE or high - low <= 1e-13 * (1.0 + low):
        return True
    return miss > 0.0 and F == 0.0


@compiled
def solve_pair(guess: float, state: State, work: Work, model: Model) -> float:
    """The tension at which the pair fills its length: δ_X(F) + δ_Y(F) = 2 δ0.

    No tension at all is the answer when the unloaded springs are already long enough: the tendon is
    slack. Returns the tension, or -1 when it is not found.
    """
    x, y, wx, wy = state.x, state.y, work.x, work.y
    p, e, e_y = model.p, model.x, model.y
    low = 0.0
    high = UNBOUNDED
    last_miss = UNBOUNDED
    trusted = trusted_steps(e)
    F = guess if guess > 0.0 else 0.0
    joint_steps = count_joint_steps(e)
    for n in range(ITERATIONS):
        exact = n >= joint_steps
        set_tension(F, wx, p, e)
        copy_tension(wx, wy)
        if not exact:
            step_spring(x, wx, p, e)
            step_spring(y, wy, p, e_y)
        elif not (solve_spring(x, wx, p, e) and solve_spring(y, wy, p, e_y)):
            return -1.0
        miss = wx.deflection + wy.deflection - 2.0 * p.delta_0
        settled = wx.miss == 0.0 and wy.miss == 0.0
        if settled and is_root(F, miss, low, high):
            return F
        if exact:
            if miss > 0.0:
                high = F
            else:
                low = F
        last = F
        slope = wx.deflection_by_F + wy.deflection_by_F
        F = next_tension(n < trusted, F, miss, last_miss, slope, low, high)
        last_miss = miss
        follow_tension(F - last, wx, e)
        follow_tension(F - last, wy, e)
    return -1.0


@compiled
def solve_tension(
    target: float, guess: float, s: Spring, w: SpringWork, p: Constants, e: Effects
) -> float:
    """The tension at which one spring, with its half of the tendon, has the deflection `target`.

    As `solve_pair`: one root, zero when the spring is slack, -1 when it is not found.
    """
    low = 0.0
    high = UNBOUNDED
    last_miss = UNBOUNDED
    trusted = trusted_steps(e)
    F = guess if guess > 0.0 else 0.0
    gives = e.resists > 0.0 and p.fixture == ANTAGONISTIC
    joint_steps = count_joint_steps(e)
    for n in range(ITERATIONS):
        exact = n >= joint_steps
        set_tension(F, w, p, e)
        if not exact:
            step_spring(s, w, p, e)
        elif not solve_spring(s, w, p, e):
            return -1.0
        reach = w.deflection
        slope = w.deflection_by_F
        if gives:
            stretch, stretch_F = stretch_of_tendon(F, e)
            reach += stretch - stretch_of_tendon(p.F0, e)[0]
            slope += stretch_F
        miss = reach - target
        if w.miss == 0.0 and is_root(F, miss, low, high):
            return F
        if exact:
            if miss > 0.0:
                high = F
            else:
                low = F
        last = F
        F = next_tension(n < trusted, F, miss, last_miss, slope, low, high)
        last_miss = miss
        follow_tension(F - last, w, e)
    return -1.0


@inlined
def drag_on_pair(state: State, work: Work, e: Effects) -> float:
    """Force that resists a motion of the pair, for its speed, N s/m."""
    wet = 0.5 * (state.x.filled + state.y.filled)
    return e.pair_drag * wet + work.between_slope


@compiled
def solve_sliding_pair(
    rub: float, guess: float, state: State, work: Work, model: Model, dt: float
) -> tuple[float, float, float]:
    """The pair with friction `rub` (signed), drag, tube stiffness, forcing, a tendon that gives.

    Unknown is the tension of X; that of Y is less by what resists the motion. Returns
    (tension of X, of Y, displacement), tension -1 when it is not found.
    """
    x, y, wx, wy = state.x, state.y, work.x, work.y
    p, e, e_y = model.p, model.x, model.y
    low = 0.0
    high = UNBOUNDED
    last_miss = UNBOUNDED
    trusted = trusted_steps(e)
    F = guess if guess > 0.0 else 0.0
    before = state.shared.displacement
    drag = drag_on_pair(state, work, e) / dt
    rub += work.between
    mounted = stretch_of_tendon(p.F0, e)[0]
    for n in range(ITERATIONS):
        set_tension(F, wx, p, e)
        solved = solve_spring(x, wx, p, e)
        stretch, stretch_F = stretch_of_tendon(F, e)
        reach = wx.deflection + stretch - mounted
        reach_F = wx.deflection_by_F + stretch_F
        u = p.delta_0 - reach
        other = F - rub - e.pair_stiffness * u - drag * (u - before)
        other_F = 1.0 + (e.pair_stiffness + drag) * reach_F
        if other < 0.0:
            other = 0.0
            other_F = 0.0
        set_tension(other, wy, p, e_y)
        if not (solve_spring(y, wy, p, e_y) and solved):
            return -1.0, 0.0, 0.0
        stretch, stretch_F = stretch_of_tendon(other, e)
        miss = reach + wy.deflection + stretch - mounted - 2.0 * p.delta_0
        slope = reach_F + (wy.deflection_by_F + stretch_F) * other_F
        if abs(miss) <= DELTA_TOLERANCE or high - low <= 1e-13 * (1.0 + low):
            return F, other, u
        if miss > 0.0:
            if F == 0.0:
                return F, other, slack_position(before, wx, wy, p)
            high = F
        else:
            low = F
        F = next_tension(n < trusted, F, miss, last_miss, slope, low, high)
        last_miss = miss
    return -1.0, 0.0, 0.0


@compiled
def solve_resisted_pair(
    guess: float, state: State, work: Work, model: Model, dt: float
) -> tuple[float, float, float]:
    """The pair where something resists its motion: stick if friction can hold it, else slide.

    Friction holds more at rest than while a spring slides, so it slips in jumps. A jump is over
    within the step, unless a drag makes it last: it ends where the friction of fast sliding holds
    the pull. What holds at rest falls with the speed at which the springs would move the pair. So
    slips do not depend on the length of steps.

    Returns (tension of X, of Y, displacement), tension -1 when it is not found.
    """
    x, y, g, p, e = state.x, state.y, state.shared, model.p, model.x
    rub = 0.0
    sliding = friction_at(g.tension, UNBOUNDED, e)
    if sliding > 0.0:
        u = g.displacement
        F_x = solve_tension(p.delta_0 - u, x.tension, x, work.x, p, e)
        F_y = solve_tension(p.delta_0 + u, y.tension, y, work.y, p, model.y)
        if F_x < 0.0 or F_y < 0.0:
            return -1.0, 0.0, 0.0
        pull = F_x - F_y - e.pair_stiffness * u - work.between
        stiffness = 1.0 / (work.x.deflection_by_F + stretch_of_tendon(F_x, e)[1])
        stiffness += 1.0 / (work.y.deflection_by_F + stretch_of_tendon(F_y, e)[1])
        lasts = drag_on_pair(state, work, e) > stiffness * dt
        # With the displacement held the pull changes as fast as the springs would move the pair.
        speed = abs(F_x - x.tension - F_y + y.tension) / (stiffness * dt)
        hold = friction_at(g.tension, 0.0 if lasts else speed, e)
        if abs(pull) <= hold:
            return F_x, F_y, u
        if lasts:
            rub = friction_at(g.tension, g.speed, e)
        else:
            # It broke loose within the step: what the pull has grown since then it keeps. Of
            # several slips in a step the mean is left.
            rub = sliding + min(abs(pull) - hold, 0.5 * (hold - sliding))
        if pull < 0.0:
            rub = -rub
    return solve_sliding_pair(rub, guess, state, work, model, dt)
