"""The simulated bench with the C firmware in place of the Python board.

The firmware runs as a process of its own, in lockstep: the bench sends a time step and what the
pins show, the process runs exactly that long and answers with its outputs and its bytes.
"""
