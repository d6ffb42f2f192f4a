"""Hostile clients: `attacks` on the daemon of `rig`, and what each came to."""
