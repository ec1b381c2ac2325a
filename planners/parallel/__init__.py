# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs done in this process, by worker processes of this machine, or on a Dask cluster."""
