"""What a pair of springs of a given geometry can do: stroke, force, period, power.

`cycle.design_cycle` runs the simulated plant to and fro; `smad design` shows what it gives.
"""
