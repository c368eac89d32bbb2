"""FAISS and vpr-core side by side: exact search, the same file, the same threads, alternately.

    pip install faiss-cpu numpy
    cargo build --example peer_search
    python experiments/peers/faiss_flat.py --ours target/debug/examples/peer_search

Prints, for every case, the median and the minimum of both sides in milliseconds, the ratio of the
medians (ours / FAISS in its best configuration), with one thread also the ratio of the medians of
processor time, which a loaded machine changes less, and the share of the memory bandwidth that
ours reached (the time of one plain pass over the references ÷ ours) and how many processors were busy
with other work: far from zero, the line says little. FAISS's best is searched for: its threshold for
BLAS at 20 (with `--every` also as shipped), and, when two
threads are allowed, one and two of them (a single query is often slower with two). The whole takes about ten minutes; `--dims`,
`--threads`, `--batches`, `--metrics` and `--rounds` choose a part of it.
"""

import argparse
import itertools
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

K = 10
WALL, CPU = 0, 1
# Both sides: big buffers are kept instead of being returned to the system after every search.
MALLOC = {
    "MALLOC_MMAP_THRESHOLD_": "4294967296",
    "MALLOC_TRIM_THRESHOLD_": "17179869184",
    "MALLOC_TOP_PAD_": "67108864",
}


def write_rows(path, n_rows, dim, rng, basis):
    """Unit vectors near a 32-dimensional subspace, as descriptors of places are."""
    with open(path, "wb") as file:
        for start in range(0, n_rows, 10_000):
            n = min(10_000, n_rows - start)
            rows = rng.standard_normal((n, len(basis)), dtype=np.float32) @ basis
            rows += 0.3 * rng.standard_normal((n, dim), dtype=np.float32)
            rows /= np.linalg.norm(rows, axis=1, keepdims=True)
            rows.astype("<f4").tofile(file)


def faiss_worker(references, queries, dim):
    """The other process: answers the same lines as our example does."""
    import faiss

    references = np.fromfile(references, "<f4").reshape(-1, dim)
    queries = np.fromfile(queries, "<f4").reshape(-1, dim)
    indexes = {"l2": faiss.IndexFlatL2(dim), "ip": faiss.IndexFlatIP(dim)}
    for index in indexes.values():
        index.add(references)
    shipped = faiss.cvar.distance_compute_blas_threshold
    for line in sys.stdin:
        command, metric, *rest = line.split()
        if command == "save":
            distances, found = indexes[metric].search(queries, K)
            with open(rest[0], "wb") as file:
                found.astype("<u4").tofile(file)
                distances.astype("<f4").tofile(file)
            print("saved", flush=True)
            continue
        batch, threads, blas = int(rest[0]), int(rest[1]), rest[2]
        faiss.omp_set_num_threads(threads)
        faiss.cvar.distance_compute_blas_threshold = 20 if blas == "blas20" else shipped
        start = time.perf_counter()
        indexes[metric].search(queries[:batch], K)
        print((time.perf_counter() - start) * 1e3, flush=True)


class Side:
    def __init__(self, command):
        env = os.environ | MALLOC
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=env)

    def ask(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline().strip()
        if not answer:
            sys.exit(f"the process died at `{line}`")
        return answer

    def time(self, line):
        """Wall and processor milliseconds; the latter say less about threads but stand load."""
        before = self.processor()
        wall = float(self.ask(line))
        # Until the threads sleep: only then the kernel books their time, and OpenMP's spin a while.
        time.sleep(0.02)
        return wall, self.processor() - before

    def processor(self):
        tasks = Path(f"/proc/{self.process.pid}/task").glob("*/schedstat")
        return sum(int(task.read_text().split()[0]) for task in tasks) / 1e6

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def check_equal(ours, theirs, metric, folder, n_queries):
    """Neighbours equal but for exact ties, distances within 1e-4 relative."""
    found = []
    for name, side in (("ours", ours), ("faiss", theirs)):
        path = folder / f"{name}.{metric}"
        side.ask(f"save {metric} {path}")
        raw = np.fromfile(path, "<u4").reshape(2, n_queries, K)
        found.append((raw[0], raw[1].view("<f4").astype(np.float64)))
    (index, distance), (their_index, their_distance) = found
    theirs_in_our_units = np.sqrt(their_distance) if metric == "l2" else -their_distance
    error = np.abs(distance - theirs_in_our_units) / np.abs(theirs_in_our_units)
    swapped = index != their_index
    # A swap is a tie if the distances of both are the same within the rounding of f32 scores.
    ties = error[swapped].max(initial=0) <= 2e-6
    print(f"{metric}: {swapped.sum()} of {swapped.size} ranks hold another reference"
          f"{'' if ties else ' (NOT only ties)'}, largest relative difference of distances {error.max():.1e}")
    return ties and error.max() <= 1e-4


def busy():
    """Processor milliseconds of everything on the machine, since it started."""
    fields = Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]
    user, nice, system, _, _, irq, softirq, *_ = map(int, fields)
    return (user + nice + system + irq + softirq) * 1e3 / os.sysconf("SC_CLK_TCK")


class Others:
    """How many processors were busy with something else than the two sides."""

    def __init__(self, sides):
        self.sides = sides
        self.start = time.perf_counter(), self.spent()

    def spent(self):
        return busy() - sum(side.processor() for side in self.sides)

    def cores(self):
        wall = (time.perf_counter() - self.start[0]) * 1e3
        return max(0, (self.spent() - self.start[1]) / wall)


def compare(ours, theirs, metric, batch, threads, rounds, every):
    # The threshold matters for batches only, and for them 20 was always the better one.
    thresholds = ["shipped", "blas20"] if every else ["shipped" if batch < 20 else "blas20"]
    configurations = list(itertools.product(range(1, threads + 1), thresholds))
    times = {configuration: [] for configuration in configurations}
    mine = []
    for _ in range(rounds):
        for configuration in configurations:
            used, blas = configuration
            times[configuration].append(theirs.time(f"time {metric} {batch} {used} {blas}"))
            mine.append(ours.time(f"time {metric} {batch} {threads}"))
    best = min(times, key=lambda configuration: median(times[configuration], WALL))
    return mine, times[best], best


def median(times, clock):
    return statistics.median(time[clock] for time in times)


def least(times):
    return min(wall for wall, _ in times)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ours", default="target/debug/examples/peer_search")
    parser.add_argument("--dims", type=int, nargs="+", default=[512, 4096])
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--threads", type=int, nargs="+", default=[2, 1], choices=[1, 2])
    parser.add_argument("--batches", type=int, nargs="+", default=[1, 100])
    parser.add_argument("--metrics", nargs="+", default=["l2", "ip"], choices=["l2", "ip"])
    parser.add_argument("--every", action="store_true", help="FAISS's worse configurations as well")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "vpr-peers")
    parser.add_argument("--worker", nargs=3, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.worker:
        return faiss_worker(args.worker[0], args.worker[1], int(args.worker[2]))
    args.folder.mkdir(exist_ok=True)
    equal = True
    for dim in args.dims:
        rng = np.random.default_rng(dim)
        basis = rng.standard_normal((32, dim), dtype=np.float32)
        files = [str(args.folder / f"{name}-{dim}.f32") for name in ("references", "queries")]
        for file, n in zip(files, (args.rows, 100)):
            if not Path(file).exists() or Path(file).stat().st_size != 4 * n * dim:
                write_rows(file, n, dim, rng, basis)
        ours = Side([args.ours, *files, str(dim)])
        theirs = Side([sys.executable, __file__, "--worker", *files, str(dim)])
        print(f"\n{args.rows} x {dim}, k = {K}, load {os.getloadavg()[0]:.1f}")
        equal &= all([check_equal(ours, theirs, metric, args.folder, 100) for metric in args.metrics])
        print("threads batch metric |  ours median   min | FAISS median   min  best as | ratio | by cpu | bandwidth | others")
        for threads, batch, metric in itertools.product(args.threads, args.batches, args.metrics):
            load = Others([ours, theirs])
            mine, others, (used, blas) = compare(
                ours, theirs, metric, batch, threads, args.rounds, args.every)
            load = load.cores()
            read = least([ours.time(f"read {threads}") for _ in range(5)])
            wall, theirs_wall = median(mine, WALL), median(others, WALL)
            by_cpu = f"{median(mine, CPU) / median(others, CPU):6.2f}" if threads == 1 else "     -"
            share = read / least(mine)
            print(f"{threads:7} {batch:5} {metric:>6} | {wall:12.2f} {least(mine):7.2f}"
                  f" | {theirs_wall:12.2f} {least(others):7.2f} {used} {blas:7}"
                  f" | {wall / theirs_wall:5.2f} | {by_cpu} | {share:9.2f} | {load:.2f}", flush=True)
        ours.close()
        theirs.close()
    return 0 if equal else 1


if __name__ == "__main__":
    sys.exit(main())
