# SPDX-License-Identifier: GPL-3.0-or-later
"""The joint model: states, conditions, interference, and the joint actions that robots compose."""
