"""Evidence that the simulator is correct and fast: references, verification, the paper's results, and a benchmark.

It is not installed. Run its parts from the root of the repository, for example `python -m evidence.verification`.
"""

import os

# Numerical libraries read these variables when they are imported. Several processes share the cores, so each one gets
# a single thread.
os.environ.update({f'{library}_NUM_THREADS': '1' for library in ('OMP', 'OPENBLAS', 'MKL', 'NUMBA')})
