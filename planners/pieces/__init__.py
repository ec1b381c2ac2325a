# SPDX-License-Identifier: GPL-3.0-or-later
"""Work cut into pieces, done in this process, in processes of its own, or on a Dask cluster."""
