"""Run logs: one channel schema, MCAP files that survive a crash, import and export.

`RunWriter` records, `read_run` reads back; everything else turns one file into another.
"""
