"""The sizes of the diagnosis and the thresholds of its verdicts.

What else weighs in a verdict stands at the top of its module: the least spread of good runs
(`deficit`), what makes a template of the background worth having and how many rows tell of a regime
(`discrepancy`), and which regimes are left out in turn (`judge`).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Settings:
    """Frozen before a sealed bank is opened; a report carries the values it was made with.

    Sizes: `period_s` of the analysis grid (samples are averaged over it), `block_s` of the cells in
    which the scale of the discrepancy is unknown, `bootstrap` resamples, `starts` of a joint fit,
    at most `law_starts` of the fit of the laws beside the first, `law_rounds` of slopes in each of
    them and `law_rounds_last` in the last one, `survivors` of the screening,
    `max_effects` of the selection, `seed`.

    `resolution` is the share of a channel's excursion below which no simulator is trusted: it is
    part of the floor.

    `day_share` is how far a parameter may have moved since the known-good runs, in its prior's
    standard deviations, without that counting as a change.

    Since known-good runs, an effect enters if its held-out gain exceeds `since_gain` nats for each
    cell judged and `since_standard_errors`, a further one `further_standard_errors`, beside causes
    whose laws are doubted (`form_share`). Where a bench's laws have another form than the model's,
    some effect gains 0.1 to 0.8 nats a cell though none is there, and up to 0.95 where parameters
    have changed
    (development bank). An effect that takes `clear_shrink` of a gap of at least `clear_excess`
    floors on its outputs enters with `clear_standard_errors` instead: it may show in few cells.
    Fitted without each regime in turn, it must gain on those left out `regime_share` of what it
    gains on runs left out, or anything at all if that is more than `regime_sure` nats a cell. A
    free refit replaces the answer if it is better by `free_standard_errors`, unless the cause gains
    `beside_standard_errors` beside what is free, or `imitated_share` of what the free refit gains;
    and a cause that does not help beside it, where that is no worse, must gain `imitated_gain` nats
    a cell to be named at all.

    Beside tied parameters a cause is unknown if the best of the library takes less than
    `since_ratio` of what a flexible correction takes, or leaves more than `unknown_left` floors and
    takes less than `since_clear_shrink`; unless it makes good `since_taken` of what the runs score
    worse than good ones, or gains more than `since_sure` nats a cell. Since known-good runs it is,
    too, if none enters and the refit leaves more than `blind_excess` floors and `blind_ratio` times
    what is significant (with a flexible correction that finds `found_share` of it,
    `structural_excess` times), where the runs score worse than good ones, each predicted by the
    others, by `since_deficit` nats a cell; or if they do on one output, by `since_spreads` times
    what good runs differ in it, or on one output of one run, by `since_run_deficit` nats a cell.

    Without a cause the answer is that there was not enough excitation if less than `least_visible`
    of the effects would show by more than `visible_floors` at their typical strength. Since
    known-good runs parameters have changed if the refit leaves less than `vanished_share` of the
    gap; a tied answer without a cause stands beside the free refit if it leaves at most
    `same_excess` times as much. Below `min_excess` floors (`since_min_excess` beside tied
    parameters) a cause is judged by what its scores gain, since the gap has no shrink to speak of.

    `quiet_right`, `named_right` and `unknown_right` are the shares of the answers of each kind that
    were exactly right where the evidence left no doubt, on the development bank (one case in five
    without an effect, one in six with several): probabilities are scaled by them. Where other
    values of the parameters predict as well as the cause, it is `imitated_right`: even odds.

    `form_share` widens the interval of an effect's strength, in quadrature: a bench follows a law
    of another form than the library's (a gain that depends on the current), whose number differs
    from one working point to the next. On the development bank the values of rightly named effects
    were off by such shares, many times what the data alone leave open. As large a share of what a
    cause changes is uncertain where a further one is judged beside it (`doubt`).

    `cell_dof` is the prior weight, in samples, of a cell's scale being the floor's: small values
    let a cell with an unexplained misfit speak softly.
    """

    period_s: float = 0.1
    resolution: float = 1e-3
    block_s: float = 5.0
    cell_dof: float = 10.0
    seed: int = 0
    bootstrap: int = 400
    starts: int = 2
    survivors: int = 7
    max_effects: int = 3
    day_share: float = 0.01
    baseline_rounds: int = 2
    baseline_handful: int = 3
    baseline_gain: float = 100.0
    asked_gain: float = 25.0
    refit_iterations: int = 8
    fit_iterations: int = 6
    short_iterations: int = 1
    longer_fits: int = 4
    law_starts: int = 2
    law_rounds: int = 4
    law_rounds_last: int = 8

    min_duration_s: float = 8.0
    max_lost_share: float = 0.2
    max_saturated_share: float = 0.2
    constant_quanta: float = 1.5

    significance: float = 0.01
    min_excess: float = 0.35
    since_min_excess: float = 1.5
    least_visible: float = 0.2
    visible_floors: float = 4.0
    vanished_share: float = 0.55
    same_excess: float = 1.1
    gain_standard_errors: float = 1.0
    since_gain: float = 1.0
    since_standard_errors: float = 2.0
    further_standard_errors: float = 2.5
    regime_share: float = 0.1
    regime_sure: float = 2.0
    clear_standard_errors: float = 3.0
    clear_shrink: float = 0.5
    clear_excess: float = 1.0
    free_standard_errors: float = 2.0
    beside_standard_errors: float = 4.0
    imitated_share: float = 0.9
    imitated_gain: float = 1.5
    min_shrink_gain: float = 0.1
    blind_excess: float = 1.0
    blind_ratio: float = 2.0
    structural_excess: float = 1.2
    found_share: float = 0.3
    since_deficit: float = 4.5
    since_spreads: float = 8.0
    since_run_deficit: float = 70.0
    unknown_shrink: float = 0.2
    unknown_ratio: float = 0.5
    unknown_left: float = 1.75
    since_clear_shrink: float = 0.75
    since_ratio: float = 0.5
    since_taken: float = 0.33
    since_sure: float = 3.1
    rest_margin: float = 0.15
    ambiguous_d2: float = 16.0
    ambiguous_odds: float = 10.0
    false_discovery: float = 0.1

    quiet_right: float = 0.4
    named_right: float = 0.75
    imitated_right: float = 0.5
    unknown_right: float = 0.5
    form_share: float = 0.35
