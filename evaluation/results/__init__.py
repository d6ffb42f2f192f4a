"""What was measured, as JSON, and `README.md` here, which is made from it.

`keys.sha256` has the hash of each sealed key from before its first verdict, `openings.jsonl` a line
for each use of such a key. Both only grow.
"""
