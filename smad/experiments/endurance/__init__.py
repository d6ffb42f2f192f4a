"""Endurance: the same cycle many times, statistics of each, check-ups between, limits that end it.

`run` goes through blocks; `profile` is the cycle, `statistics` what each came to, `limits` when to
end, `room` what it takes on the disk.
"""
