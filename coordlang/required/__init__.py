"""Where coordination is required: composition walks, first and last differences, miscoordination
shown.
"""
