"""Daemon and simulated bench as child processes: for the demo, `smad start --sim`, campaigns."""
