"""The recovery bank: the product's own simulator with a known effect, diagnosed by the product.

A method that does not find there what was put in is not tried on an independent plant.
"""
