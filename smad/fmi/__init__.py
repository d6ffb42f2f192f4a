"""FMI 2.0, both ways: the plant as a co-simulation unit, and a unit as a plant of the diagnosis.

Start with `export.export_unit` and `plant.FmuPlant`; the extra `fmi` brings what they need.
"""
