# SPDX-License-Identifier: GPL-3.0-or-later
"""The public functions, one for each command, and the results that they return.

They are imported from `coordlang`.
"""
