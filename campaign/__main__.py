"""`python -m campaign faults|soak|hostile|fuzz`: see docs/guide/fault-campaign.md."""

from campaign.command import main

if __name__ == "__main__":
    main()
