"""Planning for several robots: PDDL -> joint model -> all optimal plans.

Knows nothing of languages.
"""
