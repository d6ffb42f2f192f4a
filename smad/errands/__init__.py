"""The process beside the page's server that reads logs and makes plans, a line of JSON at a time.

A room of its own: it knows the experiments, whose pages use the colours and strips of `smad.view`.
"""
