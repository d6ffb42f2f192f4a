"""Is the diagnosis right on data whose effect it was not told? Nothing of this is in the wheel.

`plant` is an independent model of the bench and imports nothing of ours; `bank` makes recorded runs
with it, and `quiz` serves it as a board. `run` asks the product about a bank, `score` compares what
it said with the key, `calibrate` chooses constants from development banks, `programme` designs the
programme of a check-up, and `results` keeps what was measured. Start with `README.md` here.
"""
