"""Times CoHOG matching against NumPy's `dot` + `max` at 961 x 961 x 32, alternately in one session.

Usage: python experiments/peers/cohog.py [ROUNDS]
"""

import os
import statistics
import subprocess
import sys
import time

N_REGIONS, DEPTH, N_PAIRS = 961, 32, 40
PUBLISHED_MS = 2.64
OURS = ["cargo", "run", "--quiet", "--example", "cohog_speed"]
NUMPY = [sys.executable, __file__, "numpy"]


def numpy_ms(dtype):
    """Median time of one pair, outputs allocated once as the released code does."""
    import numpy as np

    rng = np.random.default_rng(0)
    query = np.asfortranarray(rng.random((N_REGIONS, DEPTH)), dtype=dtype)
    reference = np.asfortranarray(rng.random((DEPTH, N_REGIONS)), dtype=dtype)
    products = np.zeros((N_REGIONS, N_REGIONS), dtype)
    best = np.zeros(N_REGIONS, dtype)
    times = []
    for _ in range(N_PAIRS):
        start = time.perf_counter()
        np.dot(query, reference, out=products)
        np.max(products, axis=1, out=best)
        best.sum()
        times.append((time.perf_counter() - start) * 1e3)
    return statistics.median(times)


def main(rounds):
    ms = {}
    for _ in range(rounds):
        for line in subprocess.check_output(OURS, text=True).splitlines():
            name, threads, value, _ = line.split()
            ms.setdefault((name, int(threads)), []).append(float(value))
        for threads in (1, 2):
            env = os.environ | {"OPENBLAS_NUM_THREADS": str(threads)}
            for line in subprocess.check_output(NUMPY, env=env, text=True).splitlines():
                name, value = line.split()
                ms.setdefault((name, threads), []).append(float(value))

    ms = {key: statistics.median(values) for key, values in ms.items()}
    work = {"faer-gemm": 2 * 1024**3}
    gflops = {key: work.get(key[0], 2 * N_REGIONS**2 * DEPTH) / ms[key] / 1e6 for key in ms}
    print(f"medians of {rounds} rounds; published: {PUBLISHED_MS} ms per pair")
    for key in sorted(ms, key=lambda key: (key[1], key[0])):
        name, threads = key
        ours = ms["cohog", threads]
        limit = gflops[key] / gflops["faer-gemm", threads]
        line = f"{name:10} {threads} thread(s) {ms[key]:8.3f} ms {gflops[key]:7.1f} GFLOP/s"
        print(f"{line} {limit:5.0%} of faer's GEMM, {ms[key] / ours:6.2f} x our time")
    for threads in (1, 2):
        ratio = PUBLISHED_MS / ms["cohog", threads]
        print(f"published / ours, {threads} thread(s): {ratio:.1f}")


if __name__ == "__main__":
    if sys.argv[1:] == ["numpy"]:
        for dtype in ("float32", "float64"):
            print(f"numpy-{dtype[-2:]} {numpy_ms(dtype)}")
    else:
        main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
