"""The paired residual: equal inputs on two days, repeat floor, white rows."""
