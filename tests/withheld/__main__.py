"""`python -m tests.withheld make|score|…`: see docs/withheld.md."""

from tests.withheld.command import main

if __name__ == "__main__":
    main()
