"""The experiments of tuning, as plans: small, within the limits, both directions.

Displacement: the pair rests; then for each spring the loop brings it to where it just pulls, and a
few pulses of current on top of a steady one show how fast and how late the displacement follows,
with water on the other spring as in a move; then water alone cools it. Temperature: the same pulses
on one spring.
"""

from smad.config import ControlConfig
from smad.control.commands import (
    DriveCurrent,
    Follow,
    Hold,
    HoldTemperature,
    Idle,
    Ramp,
    Sine,
    Spring,
    Step,
    Tune,
)
from smad.control.plan import Action, Do, Mark, Pause, Plan, UntilDone

SPRINGS: tuple[Spring, Spring] = ("x", "y")
REACH_MM = 1.0
REACH_S = 5.0
START_MM = 1.5
START_RATE_MM_PER_S = 0.5
PULSE_S = 0.4
PULSES = 4
STILL_S = 5.0
COOL_S = 8.0
SHARES = (0.5, 0.75)
"""The two currents, as shares of the limit: a move goes on at about such currents."""
HOTTEST_DEGC = 65.0
"""A spring this hot ends a pulse; no transformation of the shipped plants goes on above it."""
HELD_K = 8.0
TRIAL_PERIOD_S = 7.0
TRIAL_MM = 2.0
TRIAL_CYCLES = 3


def displacement_plan(config: ControlConfig) -> Plan:
    """The experiment on the displacement loop of a bench with this configuration, ~1 minute."""
    actions: list[Action] = [Do(Idle()), Mark("still"), Pause(STILL_S), Mark("moving")]
    for spring, sign in zip(SPRINGS, (1.0, -1.0), strict=True):
        # Time to get there, and a last ramp, so that the spring is just pulling at its end.
        reach_mm, to_mm = sign * REACH_MM, sign * START_MM
        actions += [
            Do(
                Follow(
                    trajectories=(
                        Ramp(displacement_mm=0.0, rate_mm_per_s=2.0 * START_RATE_MM_PER_S),
                        Ramp(displacement_mm=reach_mm, rate_mm_per_s=START_RATE_MM_PER_S),
                        Hold(duration_s=REACH_S),
                        Ramp(displacement_mm=to_mm, rate_mm_per_s=START_RATE_MM_PER_S),
                    )
                )
            ),
            UntilDone(60.0),
            Mark(f"{spring} pulses"),
            *_pulses(spring, config.current_limit_A, water=True),
            Mark(f"{spring} cools"),
            Do(
                DriveCurrent(
                    pump_x_duty=1.0 if spring == "x" else 0.0,
                    pump_y_duty=1.0 if spring == "y" else 0.0,
                    duration_s=COOL_S,
                )
            ),
            UntilDone(COOL_S + 5.0),
            Mark(f"{spring} cooled"),
        ]
    return Plan("tune-displacement", (*actions, Do(Idle())))


def temperature_plan(config: ControlConfig, spring: Spring) -> Plan:
    """The experiment on the temperature loop of one spring."""
    return Plan(
        f"tune-temperature-{spring}",
        (
            Do(Idle()),
            Mark("still"),
            Pause(STILL_S),
            Mark("moving"),
            *_pulses(spring, config.current_limit_A, water=False),
            Mark(f"{spring} cools"),
            Do(Idle()),
        ),
    )


def _pulses(spring: Spring, limit_A: float, *, water: bool) -> list[Action]:
    low_A, high_A = (share * limit_A for share in SHARES)

    def drive(current_A: float) -> Action:
        duty = 1.0 if water else 0.0
        # Longer than the pulse: the next command ends it, and a client that dies does not.
        return Do(
            DriveCurrent(
                i_x_A=current_A if spring == "x" else 0.0,
                i_y_A=current_A if spring == "y" else 0.0,
                pump_x_duty=duty if spring == "y" else 0.0,
                pump_y_duty=duty if spring == "x" else 0.0,
                duration_s=5.0 * PULSE_S,
                stop_spring=spring,
                stop_above_degC=HOTTEST_DEGC,
            )
        )

    actions: list[Action] = [drive(low_A), Pause(PULSE_S)]
    for _ in range(PULSES):
        actions += [drive(high_A), Pause(PULSE_S), drive(low_A), Pause(PULSE_S)]
    return actions


def displacement_trial(name: str, gains: Tune) -> Plan:
    """A sinusoid and steps of ±2 mm, with a hold after each, under these gains."""
    move = (
        Sine(amplitude_mm=TRIAL_MM, period_s=TRIAL_PERIOD_S, cycles=TRIAL_CYCLES),
        Step(displacement_mm=TRIAL_MM, duration_s=8.0),
        Step(displacement_mm=-TRIAL_MM, duration_s=8.0),
    )
    return Plan(
        f"tune-trial-{name}",
        (Do(gains), Mark("trial"), Do(Follow(trajectories=move)), UntilDone(90.0), Mark("end")),
    )


def temperature_trial(name: str, gains: Tune, spring: Spring, from_degC: float) -> Plan:
    """A step of temperature under these gains, and a hold."""
    heat = HoldTemperature(
        spring=spring, temperature_degC=from_degC + HELD_K, duration_s=20.0, use_water=False
    )
    return Plan(
        f"tune-trial-{name}", (Do(gains), Mark("trial"), Do(heat), UntilDone(60.0), Mark("end"))
    )
