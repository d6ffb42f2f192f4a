"""The library of candidate effects: one registry entry each, used by plant, diagnosis and docs.

Every effect can be switched on alone or together; at zero strength the plant is bit-identical.
"""
