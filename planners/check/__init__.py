# SPDX-License-Identifier: GPL-3.0-or-later
"""The independent twin of grounding and composition: rules of joint steps, and a plan checker."""
