"""The bench as its own control: equal inputs on two days, subtracted.

A *programme* is a set of open-loop runs, a *baseline* what a good bench made of them, a *check-up*
the verdict over the difference. Nothing here opens a socket.
"""
