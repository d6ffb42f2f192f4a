"""The soak: a real daemon under hours of random commands, faster than real time where it can.

`bench` is the simulated bench that waits for it, `draws` the commands, `run` drives both, `found`
holds what came of it, and `report` judges that.
"""
