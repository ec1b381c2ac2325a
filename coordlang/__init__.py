"""Coordination languages.

The fewest words that let robots plan on their own and still act together.
"""
