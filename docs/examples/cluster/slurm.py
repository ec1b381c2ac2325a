# SPDX-License-Identifier: GPL-3.0-or-later
"""A Dask cluster of SLURM jobs: print the script of one job, or start some and wait.

python slurm.py --print
python slurm.py JOBS

One job is four workers with one thread and 4 GB each.  Partition, account and walltime are those
of your machine.
"""

from __future__ import annotations

import signal
import sys

from dask_jobqueue import SLURMCluster


def main() -> None:
    """Make the cluster; its scheduler runs in this process."""
    cluster = SLURMCluster(
        cores=4,
        processes=4,
        memory="16GB",
        walltime="02:00:00",
        queue="normal",
        job_extra_directives=["--job-name=coordlang"],
        job_script_prologue=["export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1"],
    )
    if sys.argv[1:] == ["--print"]:
        print(cluster.job_script())
        cluster.close()
        return
    cluster.scale(jobs=int(sys.argv[1]))
    print(cluster.scheduler_address, flush=True)
    signal.sigwait({signal.SIGINT, signal.SIGTERM})
    cluster.close()


if __name__ == "__main__":
    main()
