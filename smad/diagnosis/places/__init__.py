"""What the model's outputs show of each candidate law: one response for each term of a place."""
