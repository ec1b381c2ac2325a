# SPDX-License-Identifier: GPL-3.0-or-later
"""The experiments, one file each; `registry` lists them."""
