"""The main job of the bench, start to finish, on a simulated one: what `make demo` shows.

`job` commands it through a client, `figures` turns the run log into numbers and pictures.
"""
