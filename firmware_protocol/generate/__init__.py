"""What is made from the tables: the JSON schema, the C codec, golden vectors, document tables.

`python -m firmware_protocol.generate` writes the files; with `--check` it names the stale ones.
"""
