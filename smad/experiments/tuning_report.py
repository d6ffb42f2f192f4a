"""A tuning session in words and tables. Pure."""

from collections.abc import Iterator

from smad.experiments.tuned import Trial, WarmTrial
from smad.experiments.tuning import Session
from smad.report.page import Table


def facts(session: Session) -> Iterator[str]:
    """Yield what was identified of the springs and the sensor, a line each."""
    tuned = session.tuned
    unit, milli = ("K", "mK") if tuned.loop == "temperature" else ("mm", "µm")
    for spring, model in tuned.models.items():
        yield (
            f"spring {spring}: {model.gain:.3g} {unit}/s for each ampere at {model.at_A:.2g} A, "
            f"lag {model.lag_s:.2g} s, delay {1e3 * model.delay_s:.0f} ms "
            f"(accounts for {model.fit:.1%})"
        )
        if cooling := tuned.cooling.get(spring):
            yield (
                f"          water cools it from {cooling.from_K:.1f} K above, "
                f"time constant {cooling.time_s:.1f} s"
            )
    noise, band_mm = tuned.noise, tuned.band_mm
    yield (
        f"sensor: noise {1e3 * noise.noise:.2g} {milli} RMS, step {1e3 * noise.count:.2g} {milli}"
        + (f", band of a quiet hold {1e3 * band_mm:.0f} µm" if band_mm else "")
    )


def gains_table(session: Session) -> Table:
    """Return both sets of gains with their margins at full current."""
    tuned = session.tuned
    unit = "K" if tuned.loop == "temperature" else "mm"
    rows = [
        (
            name,
            f"{gains.kp:g}",
            f"{gains.ki:g}",
            f"{margin.gain:.1f} times",
            f"{1e3 * margin.delay_s:.0f} ms",
            f"{margin.phase_deg:.0f}°",
        )
        for name, gains, margin in (
            ("now", tuned.before, tuned.margins_before),
            ("new", tuned.after, tuned.margins_after),
        )
    ]
    header = ("gains", f"kp A/{unit}", f"ki A/({unit} s)", "gain margin", "delay margin", "phase")
    return Table(header, rows)


_STEPS = ("trial of ±2 mm", "R²", "overshoot µm", "hold µm RMS", "ripple mA", "pump starts")
_WARM = ("trial of 8 K", "within 0.5 K s", "overshoot K", "hold mK RMS", "ripple mA")


def trial_table(session: Session) -> Table | None:
    """Return how the trials with both sets of gains went; None without them."""
    if session.trials is None:
        return None
    now, new = session.trials
    rows = [("now", *_trial_cells(now)), ("new", *_trial_cells(new))]
    return Table(_STEPS if isinstance(now, Trial) else _WARM, rows)


def _trial_cells(trial: Trial | WarmTrial) -> tuple[str, ...]:
    if isinstance(trial, Trial):
        return (
            f"{trial.r2:.4f}",
            f"{1e3 * trial.overshoot_mm:.0f}",
            f"{trial.error_rms_um:.1f}",
            f"{trial.ripple_mA:.0f}",
            f"{trial.pump_starts}",
        )
    return (
        f"{trial.settling_s:.1f}",
        f"{trial.overshoot_K:.2f}",
        f"{1e3 * trial.error_rms_K:.0f}",
        f"{trial.ripple_mA:.0f}",
    )
