"""Work on all cores: numpy releases the interpreter's lock, and one BLAS thread a worker avoids their fighting."""

import os
from concurrent.futures import ThreadPoolExecutor

WORKERS = max(os.cpu_count() or 1, 1)


def each(work, items):
    """[work(item) for item in items], in order."""
    items = list(items)
    if WORKERS == 1 or len(items) < 2:
        return [work(item) for item in items]
    with ThreadPoolExecutor(WORKERS) as pool:
        return list(pool.map(work, items))
