"""A tuning session: the experiment and both trials carried out by a driver, as experiments are."""

from dataclasses import dataclass

import msgspec

from smad.client import Client
from smad.config import ControlConfig, parse_config
from smad.control.commands import Spring, Tune
from smad.control.tuning.errors import TuningError
from smad.control.tuning.plans import (
    displacement_plan,
    displacement_trial,
    temperature_plan,
    temperature_trial,
)
from smad.experiments.driver import Driver
from smad.experiments.tuned import (
    Trial,
    Tuned,
    WarmTrial,
    trial_of,
    tuned_displacement,
    tuned_temperature,
    warm_trial_of,
)

NEEDED = ("displacement_mm", "rtd_x_degC", "rtd_y_degC")


@dataclass(frozen=True)
class Session:
    """What a session found, and how the trials with the gains before and after went, if any."""

    tuned: Tuned
    trials: tuple[Trial, Trial] | tuple[WarmTrial, WarmTrial] | None

    @property
    def worse(self) -> str:
        """What the trial has against the new gains; empty when nothing, or without a trial."""
        match self.trials:
            case (Trial(r2=now), Trial(r2=new)) if new < now:
                return f"R² of the sinusoid is {new:.4f} with the new gains, {now:.4f} with yours"
            case (WarmTrial(settling_s=now_s), WarmTrial(settling_s=new_s)) if new_s > now_s:
                return f"within 0.5 K after {new_s:.1f} s, with yours after {now_s:.1f} s"
        return ""

    def record(self) -> dict[str, object]:
        """Return it for JSON, with the section of the configuration."""
        fields: dict[str, object] = msgspec.to_builtins(self)
        return fields | {"toml": self.tuned.toml(), "worse": self.worse}


def tune_displacement(driver: Driver, config: ControlConfig, *, trial: bool = True) -> Session:
    """Tune the displacement loop of the bench behind `driver`, which has this configuration.

    Raises TuningError with the reason when the bench cannot be tuned, and what the driver raises
    when the bench stops.
    """
    _require(driver, *NEEDED)
    run = driver.run(displacement_plan(config))
    tuned = tuned_displacement(run, config)
    if not trial:
        return Session(tuned, None)
    gains = {"before": tuned.before, "after": tuned.after}
    plans = [displacement_trial(name, tuned.command(tried)) for name, tried in gains.items()]
    before, after = map(trial_of, map(driver.run, plans))
    return Session(tuned, (before, after))


def tune_bench(
    client: Client, driver: Driver, spring: Spring | None, *, trial: bool, apply: bool
) -> Session:
    """Tune the bench of a client: temperature of a `spring`, None: displacement.

    `driver` arms and disarms it. With `apply` gains that are no worse are put in force. Raises as
    `tune_displacement` does.
    """
    config = parse_config(client.config()).control
    session = (
        tune_displacement(driver, config, trial=trial)
        if spring is None
        else tune_temperature(driver, config, spring, trial=trial)
    )
    if apply and not session.worse:
        client.tune(session.tuned.command(session.tuned.after))
        if session.tuned.band_mm:
            client.tune(Tune(hold_band_mm=session.tuned.band_mm))
    return session


def _require(driver: Driver, *readings: str) -> None:
    for name in readings:
        if name not in driver.parts():
            raise TuningError(
                f"the bench has no reading of {name}",
                action="connect the sensor; without it nothing can be tuned. Nothing was moved",
            )


def tune_temperature(
    driver: Driver, config: ControlConfig, spring: Spring, *, trial: bool = True
) -> Session:
    """Tune the temperature loop on one spring. Raises as `tune_displacement` does."""
    name = f"rtd_{spring}_degC"
    _require(driver, name)
    run = driver.run(temperature_plan(config, spring))
    tuned = tuned_temperature(run, config, spring)
    if not trial:
        return Session(tuned, None)
    at_degC = float(run[name][0])
    gains = {"before": tuned.before, "after": tuned.after}
    plans = [
        temperature_trial(name, tuned.command(tried), spring, at_degC)
        for name, tried in gains.items()
    ]
    before, after = (warm_trial_of(run, spring) for run in map(driver.run, plans))
    return Session(tuned, (before, after))
