"""The wire between host and board: frames, messages, sessions and the board's supervisor.

Pure: no I/O, no clock, no numpy. Bytes and time come in as arguments; bytes and events go out.
"""
