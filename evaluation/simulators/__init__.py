"""Simulators of others: one pendulum as four plants, and the rating against what is then found."""
