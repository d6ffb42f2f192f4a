"""The withheld check: a bank of recorded runs in, verdicts out; verdicts and a key in, scores out.

`bank` reads a folder, `running` diagnoses its cases on an executor, `answer` says each diagnosis in
the form of a verdict file, `score` compares that with a key. How a bank was made is unknown here.
"""
