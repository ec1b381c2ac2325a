# SPDX-License-Identifier: GPL-3.0-or-later
"""The tests: a folder for each package and room, ``support`` for what several of them need."""

import gc
import os
import sys

# As the command line does, before numpy is loaded: threads of BLAS would take turns on the cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
gc.set_threshold(50_000)
if "pytest" in sys.modules:  # workers, which take jobs from here, do not load it
    sys.modules["pytest"].register_assert_rewrite("tests.support")
