"""The live bench for viewers of other programs, by an ordinary client in its own process.

Start reading at `foxglove.py`, the protocol without a socket; `server.py` has the connections and
`source.py` the bench.
"""
