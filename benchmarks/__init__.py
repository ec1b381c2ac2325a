# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements, run from a checkout: ``python -m benchmarks.NAME``."""

import sys
from pathlib import Path

# The scripts beside the domains make problems, and import each other by their names.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "domains"))
