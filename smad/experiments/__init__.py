"""The paper's experiments and characterisations: what to run, how to analyse it, what to plot.

Each runs in virtual time on the simulated bench and, unchanged, on a running daemon.
"""
