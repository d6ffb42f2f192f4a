"""Places where a model can be wrong, and responses of its readings to laws there."""
