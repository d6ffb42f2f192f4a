"""Word of what happens on a bench, to commands of the configuration; and the relay of its supply.

A process of its own: nothing here can hold up the daemon, its loop, or a stop.
"""
