"""The live page: an ordinary client of the daemon that serves a page to browsers on this machine.

The pure rooms are `feed` (samples to frames), `access` (who may ask), `commands` (what a page may
ask), `forms`, `strips` and `state` (what it shows); `server` and `source` hold the sockets.
"""
