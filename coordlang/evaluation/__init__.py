"""The paper's tables and figures as recipes.

Run, kept as data, drawn, and set beside the paper's own values.
"""
