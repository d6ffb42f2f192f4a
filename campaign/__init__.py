"""Does the daemon keep a bench safe and its record whole? Nothing of this is in the wheel.

`faults` breaks a simulated bench in every known way and judges the outcome, `soak` runs a daemon
for hours of board time, `hostile` attacks it, `fuzz` gives bytes to whatever reads them. `rig` is
the daemon process that they share, `virtual` the daemon on virtual time.
"""
