"""`python -m evaluation make|check|score|…`: see evaluation/README.md."""

import os

# The matrices are small; threads of the algebra library would only fight the worker processes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from evaluation.command import main

if __name__ == "__main__":
    main()
