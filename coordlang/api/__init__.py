"""The public functions, one for each command, and the results that they return.

They are imported from `coordlang`.
"""
