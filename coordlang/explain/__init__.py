"""A language as a person reads it, and a planner: its words as short formulas over multi-valued variables."""

from coordlang.explain.cover import Cover, Literal, Term
from coordlang.explain.variables import Variable
from coordlang.explain.words import word_formulas

__all__ = ["Cover", "Literal", "Term", "Variable", "word_formulas"]
