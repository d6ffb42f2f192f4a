"""The sizes of the diagnosis and the thresholds of its verdicts, read from `settings.toml`."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def shipped() -> dict[str, dict[str, Any]]:
    """Value, group and meaning of every setting, by name, in the order of the file."""
    return tomllib.loads((files("smad.gap") / "settings.toml").read_text(encoding="utf-8"))


_VALUE: dict[str, Any] = {name: entry["value"] for name, entry in shipped().items()}


@dataclass(frozen=True, slots=True)
class Settings:
    """Frozen before a sealed bank is opened; a report carries the values it was made with.

    What each means stands in `settings.toml` and in docs/diagnosis.md.
    """

    period_s: float = _VALUE["period_s"]
    resolution: float = _VALUE["resolution"]
    block_s: float = _VALUE["block_s"]
    cell_dof: float = _VALUE["cell_dof"]
    seed: int = _VALUE["seed"]
    bootstrap: int = _VALUE["bootstrap"]
    starts: int = _VALUE["starts"]
    survivors: int = _VALUE["survivors"]
    max_effects: int = _VALUE["max_effects"]
    day_share: float = _VALUE["day_share"]
    baseline_rounds: int = _VALUE["baseline_rounds"]
    baseline_handful: int = _VALUE["baseline_handful"]
    baseline_gain: float = _VALUE["baseline_gain"]
    asked_gain: float = _VALUE["asked_gain"]
    refit_iterations: int = _VALUE["refit_iterations"]
    fit_iterations: int = _VALUE["fit_iterations"]
    short_iterations: int = _VALUE["short_iterations"]
    longer_fits: int = _VALUE["longer_fits"]
    law_rounds: int = _VALUE["law_rounds"]
    law_rounds_last: int = _VALUE["law_rounds_last"]
    min_duration_s: float = _VALUE["min_duration_s"]
    max_lost_share: float = _VALUE["max_lost_share"]
    max_saturated_share: float = _VALUE["max_saturated_share"]
    constant_quanta: float = _VALUE["constant_quanta"]
    significance: float = _VALUE["significance"]
    gain_standard_errors: float = _VALUE["gain_standard_errors"]
    since_gain: float = _VALUE["since_gain"]
    since_standard_errors: float = _VALUE["since_standard_errors"]
    further_standard_errors: float = _VALUE["further_standard_errors"]
    min_shrink_gain: float = _VALUE["min_shrink_gain"]
    regime_share: float = _VALUE["regime_share"]
    regime_sure: float = _VALUE["regime_sure"]
    clear_standard_errors: float = _VALUE["clear_standard_errors"]
    clear_shrink: float = _VALUE["clear_shrink"]
    clear_excess: float = _VALUE["clear_excess"]
    false_discovery: float = _VALUE["false_discovery"]
    free_standard_errors: float = _VALUE["free_standard_errors"]
    beside_standard_errors: float = _VALUE["beside_standard_errors"]
    imitated_share: float = _VALUE["imitated_share"]
    imitated_gain: float = _VALUE["imitated_gain"]
    vanished_share: float = _VALUE["vanished_share"]
    same_excess: float = _VALUE["same_excess"]
    min_excess: float = _VALUE["min_excess"]
    since_min_excess: float = _VALUE["since_min_excess"]
    unknown_shrink: float = _VALUE["unknown_shrink"]
    unknown_ratio: float = _VALUE["unknown_ratio"]
    since_ratio: float = _VALUE["since_ratio"]
    unknown_left: float = _VALUE["unknown_left"]
    since_clear_shrink: float = _VALUE["since_clear_shrink"]
    since_taken: float = _VALUE["since_taken"]
    since_sure: float = _VALUE["since_sure"]
    blind_excess: float = _VALUE["blind_excess"]
    blind_ratio: float = _VALUE["blind_ratio"]
    structural_excess: float = _VALUE["structural_excess"]
    found_share: float = _VALUE["found_share"]
    since_deficit: float = _VALUE["since_deficit"]
    since_spreads: float = _VALUE["since_spreads"]
    since_run_deficit: float = _VALUE["since_run_deficit"]
    least_visible: float = _VALUE["least_visible"]
    visible_floors: float = _VALUE["visible_floors"]
    rest_margin: float = _VALUE["rest_margin"]
    ambiguous_odds: float = _VALUE["ambiguous_odds"]
    ambiguous_d2: float = _VALUE["ambiguous_d2"]
    form_share: float = _VALUE["form_share"]
    touched_share: float = _VALUE["touched_share"]
    least_regime: float = _VALUE["least_regime"]
    determined_share: float = _VALUE["determined_share"]
    template_share: float = _VALUE["template_share"]
    coarse_share: float = _VALUE["coarse_share"]
    regime_rows: int = _VALUE["regime_rows"]
    least_spread: float = _VALUE["least_spread"]
    disagreeing: float = _VALUE["disagreeing"]
    dominating_share: float = _VALUE["dominating_share"]
    further_share: float = _VALUE["further_share"]
    moving_share: float = _VALUE["moving_share"]
    quiet_right: float = _VALUE["quiet_right"]
    named_right: float = _VALUE["named_right"]
    imitated_right: float = _VALUE["imitated_right"]
    unknown_right: float = _VALUE["unknown_right"]
