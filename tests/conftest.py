"""One thread per process in the tests too, as the command line does it."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
