"""Towards the board: the port and its reopening, requests, and what the board says of itself."""
