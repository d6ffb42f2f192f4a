"""The independent plant: two water-cooled SMA springs, wire and water distributed along the tube.

Written from the bench's published facts alone, with its own numerics, hysteresis family and forms.
"""
