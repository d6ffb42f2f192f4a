"""The second engine of the diagnosis on trial: a score table and one rule (decision 0721).

Nothing that ships imports it: it judges development banks beside the rule in force.
"""
