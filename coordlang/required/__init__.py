# SPDX-License-Identifier: GPL-3.0-or-later
"""Where coordination is required, and how often robots fail without a word."""
