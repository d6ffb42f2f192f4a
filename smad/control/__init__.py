"""Control of one antagonistic pair: a sample of the board in, a setpoint out.

Pure: no sockets, files, clocks or random state. Time comes from the board, inside the sample.
"""
