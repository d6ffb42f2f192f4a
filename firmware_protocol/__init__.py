"""The wire between host and board: frames, messages, sessions and the board's supervisor.

No I/O, no clock, no numpy: bytes and time come in as arguments; bytes and events go out. One file
is read: the compiled supervisor, where it was built.
"""
