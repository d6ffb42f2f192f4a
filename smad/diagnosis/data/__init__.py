"""From given runs to admitted ones: checks, rows on one grid, replays, noise floors."""
