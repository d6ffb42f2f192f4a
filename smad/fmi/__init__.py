"""FMI, both ways: the plant as a co-simulation unit, and a unit as a plant of the diagnosis.

Start with `export.export_unit` (`to_c` makes C of the kernel) and, with the extra `fmi`, with
`asked.diagnose_unit`.
"""
