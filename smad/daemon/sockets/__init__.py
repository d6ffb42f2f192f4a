"""ZeroMQ connections that the daemon holds itself, and how many there may be."""
