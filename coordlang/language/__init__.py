# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidate tasks, words, sentences, and their files."""
