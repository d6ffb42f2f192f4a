"""The fault campaign: break the bench in every known way, and judge what came of it.

`catalogue` says what is broken and what must follow, `lockstep` and `process` do it, `oracle`
judges, `report` tells.
"""
