# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's evaluation, reproduced: each experiment is a recipe that is run, kept and rendered.

`experiments` holds one file an experiment, `lab` the machinery that runs them and renders their
results, `material` what several experiments share.
"""
