"""What stands for a model in a fit: its coordinates, what a residual weighs, a correction."""
