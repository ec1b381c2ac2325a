# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's evaluation: each experiment is a recipe that is run, kept and rendered."""
