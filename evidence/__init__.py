"""What shows that the simulator is right and fast: references, verification, the paper's results, and a benchmark.

Run from the root of the repository, such as `python -m evidence.verification`; not installed.
"""

import os

# One thread each, which numerical libraries read when they are imported: several processes share the cores.
os.environ.update({f'{library}_NUM_THREADS': '1' for library in ('OMP', 'OPENBLAS', 'MKL', 'NUMBA')})
