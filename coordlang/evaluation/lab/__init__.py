"""Experiments as recipes: run, kept, drawn, told on a page."""
