"""Constraints -> a partition of states into words."""

from coordlang.vocabulary.greedy import greedy

#: The ways to a partition, by the name that ``--method`` takes.
METHODS = {"greedy": greedy}

__all__ = ["METHODS", "greedy"]
