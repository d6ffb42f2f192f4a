"""The door for everything that was recorded elsewhere: readers give columns with units.

`tables.open_table` opens CSV and Parquet, `channels.read_channels` gives the channels of the spring
pair, `importer.import_table` a run log, `points.read_points` a trajectory. What is no reading, or
not in the unit that was declared, is told by `readings.checked`. `smad.diagnosis.data.admission`
makes runs of it all.
"""
