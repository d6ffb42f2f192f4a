"""The fault campaign.

`catalogue` says what is broken and what must follow, `lockstep` and `process` do it, `oracle`
judges, `report` prints. `cases` chooses what is tried.
"""
