# SPDX-License-Identifier: GPL-3.0-or-later
"""The machinery of experiments: recipes, runs, results on disk, figures and the page."""
