# SPDX-License-Identifier: GPL-3.0-or-later
"""A language as a person reads it, and a planner.

Its words as short formulas over multi-valued variables.
"""

from coordlang.explanation.cover import Cover, Literal, Term
from coordlang.explanation.variables import Variable
from coordlang.explanation.words import word_formulas

__all__ = ["Cover", "Literal", "Term", "Variable", "word_formulas"]
