"""The live bench for viewers of others, by an ordinary client in a process of its own.

Start reading at `foxglove.py`, the protocol without a socket; `server.py` has the connections and
`source.py` the bench.
"""
