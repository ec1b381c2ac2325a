# SPDX-License-Identifier: GPL-3.0-or-later
"""Where coordination is required.

Composition walks, first and last differences, miscoordination shown.
"""
