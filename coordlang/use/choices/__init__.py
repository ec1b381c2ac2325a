# SPDX-License-Identifier: GPL-3.0-or-later
"""What each robot may do under a sentence, whatever the others choose from theirs."""
