# SPDX-License-Identifier: GPL-3.0-or-later
"""A language as a page that one looks at: self-contained HTML that opens offline."""
