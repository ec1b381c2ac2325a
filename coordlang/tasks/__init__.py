# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidate tasks: what a language is to be guaranteed for."""
