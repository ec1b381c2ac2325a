# SPDX-License-Identifier: GPL-3.0-or-later
"""The tests: a folder for each package and room, ``support`` for what several of them need."""

import pytest

pytest.register_assert_rewrite("tests.support")
