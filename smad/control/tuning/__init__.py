"""A bench tunes itself: a safe experiment as a plan, models from its samples, gains by a rule.

Pure: a plan goes out (`plans`), recorded columns come in (`identify`), gains and margins come out
(`rules`). `smad.experiments.tuned` puts them together.
"""
