"""The paper's tables and figures as recipes: run, kept as data, drawn, and set beside the paper's
own values.
"""
