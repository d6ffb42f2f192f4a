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
from smad.control.tuning.rules import Gains
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
    trials: tuple[Trial | WarmTrial, Trial | WarmTrial] | None

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


def tune(driver: Driver, config: ControlConfig, spring: Spring | None, *, trial: bool) -> Session:
    """Tune the temperature loop on a `spring`, None: the displacement loop.

    The bench behind `driver` has this configuration. Raises TuningError with the reason when it
    cannot be tuned, and what the driver raises when the bench stops.
    """
    for reading in NEEDED if spring is None else (f"rtd_{spring}_degC",):
        if reading not in driver.parts():
            raise TuningError(
                f"the bench has no reading of {reading}",
                action="connect the sensor; without it nothing can be tuned. Nothing was moved",
            )
    if spring is None:
        run = driver.run(displacement_plan(config))
        tuned = tuned_displacement(run, config)
    else:
        run = driver.run(temperature_plan(config, spring))
        tuned = tuned_temperature(run, config, spring)

    def tried(name: str, gains: Gains) -> Trial | WarmTrial:
        command = tuned.command(gains)
        if spring is None:
            return trial_of(driver.run(displacement_trial(name, command)))
        at_degC = float(run[f"rtd_{spring}_degC"][0])
        return warm_trial_of(driver.run(temperature_trial(name, command, spring, at_degC)), spring)

    both = (tried("before", tuned.before), tried("after", tuned.after)) if trial else None
    return Session(tuned, both)


def tune_bench(
    client: Client, driver: Driver, spring: Spring | None, *, trial: bool, apply: bool
) -> Session:
    """Tune the bench of a client: temperature of a `spring`, None: displacement.

    `driver` arms and disarms it. With `apply` gains that are no worse are put in force. Raises as
    `tune` does.
    """
    session = tune(driver, parse_config(client.config()).control, spring, trial=trial)
    if apply and not session.worse:
        client.tune(session.tuned.command(session.tuned.after))
        if session.tuned.band_mm:
            client.tune(Tune(hold_band_mm=session.tuned.band_mm))
    return session
