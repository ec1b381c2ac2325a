# SPDX-License-Identifier: GPL-3.0-or-later
"""What experiments share: domains, languages, measures, and the values that the paper reports."""
