"""Coverage-guided fuzzing of everything that reads bytes from outside: `python -m campaign fuzz`.

`targets.py` is the table; each target is a function of bytes that raises only on a real defect.
"""
