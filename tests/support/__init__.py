# SPDX-License-Identifier: GPL-3.0-or-later
"""What several tests need: shipped worlds, random models, naive twins, commands, pages."""
