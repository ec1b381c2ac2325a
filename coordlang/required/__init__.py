"""Where coordination is required.

Composition walks, first and last differences, miscoordination shown.
"""
