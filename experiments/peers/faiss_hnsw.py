"""FAISS's HNSW and ours (USearch's, ranked exactly) at equal recall, on clustered data.

    pip install faiss-cpu numpy
    cargo build --features vpr-bench/approximate --example peer_hnsw
    python experiments/peers/faiss_hnsw.py --ours target/debug/examples/peer_hnsw

Both graphs have the same number of links and the same effort while they are built. For every kind of
codes the smallest effort of a search with recall@10 >= 0.99 is looked for; then both sides answer
the same queries alternately, and the ratio of the medians is printed (ours / FAISS, below 1: ours is
faster). FAISS is `IndexHNSWFlat` (f32, as the issue asks) and `IndexHNSWSQ` (8 bits) with its own
exact refinement; ours holds f32, f16 or int8 and always ranks exactly. `--prepare` builds, which
takes minutes and needs no quiet machine; without it graphs that are there are used.
"""

import argparse
import itertools
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from faiss_flat import Side

K = 10
CODES = ("f32", "f16", "int8")
EFFORTS = (10, 12, 16, 20, 24, 32, 48, 64, 96, 128, 192, 256)
OVERSAMPLE = 2


def clustered(n_rows, dim, places, rng):
    """Unit vectors around places; places lie near a 32-dimensional subspace."""
    rows = places[rng.integers(len(places), size=n_rows)]
    rows = rows + rng.standard_normal(rows.shape, dtype=np.float32) * (0.5 / np.sqrt(dim))
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def write_data(folder, n_rows, n_queries, dim):
    rng = np.random.default_rng(dim)
    basis = rng.standard_normal((32, dim), dtype=np.float32)
    places = rng.standard_normal((n_rows // 100, 32), dtype=np.float32) @ basis
    places += rng.standard_normal(places.shape, dtype=np.float32)
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    files = [folder / f"hnsw-{name}-{n_rows}-{dim}.f32" for name in ("references", "queries")]
    for file, n in zip(files, (n_rows, n_queries)):
        rows = clustered(n, dim, places, rng).astype("<f4")
        if not file.exists() or file.stat().st_size != rows.nbytes:
            rows.tofile(file)
    return [str(file) for file in files]


def faiss_worker(references, queries, dim):
    """The other process: answers the same lines as our example does."""
    import faiss

    references = np.fromfile(references, "<f4").reshape(-1, dim)
    queries = np.fromfile(queries, "<f4").reshape(-1, dim)
    flat = faiss.IndexFlatL2(dim)
    flat.add(references)
    exact = flat.search(queries, K)[1]
    index = None

    def search(batch):
        return index.search(batch, K)[1]

    for line in sys.stdin:
        command, *rest = line.split()
        if command == "build":
            codes, connectivity, expansion, path = rest
            start = time.perf_counter()
            if codes == "f32":
                graph = faiss.IndexHNSWFlat(dim, int(connectivity))
            else:
                graph = faiss.IndexHNSWSQ(dim, faiss.ScalarQuantizer.QT_8bit, int(connectivity))
                graph.train(references)
            graph.hnsw.efConstruction = int(expansion)
            graph.add(references)
            faiss.write_index(graph, path)
            print(time.perf_counter() - start, flush=True)
        elif command == "open":
            graph = index = faiss.read_index(rest[0])
            if isinstance(graph, faiss.IndexHNSWSQ):
                index = faiss.IndexRefine(graph, flat)
                index.k_factor = OVERSAMPLE
            print("opened", flush=True)
        elif command == "recall":
            graph.hnsw.efSearch = int(rest[0])
            found = search(queries)
            shared = sum(len(set(a) & set(b)) for a, b in zip(found, exact))
            print(shared / exact.size, flush=True)
        else:
            batch, threads = map(int, rest)
            faiss.omp_set_num_threads(threads)
            start = time.perf_counter()
            for first in range(0, len(queries), batch):
                search(queries[first:first + batch])
            print((time.perf_counter() - start) * 1e3, flush=True)


def least_effort(side, oversample):
    """The smallest effort that reaches a recall of 0.99, and the recall."""
    for effort in EFFORTS:
        recall = float(side.ask(f"recall {effort} {oversample}"))
        if recall >= 0.99:
            return effort, recall
    return EFFORTS[-1], recall


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ours", default="target/debug/examples/peer_hnsw")
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--queries", type=int, default=1000)
    parser.add_argument("--dim", type=int, default=512)
    parser.add_argument("--connectivity", type=int, default=16)
    parser.add_argument("--expansion", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--codes", nargs="+", default=list(CODES), choices=CODES)
    parser.add_argument("--prepare", action="store_true")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "vpr-peers")
    parser.add_argument("--worker", nargs=3, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.worker:
        return faiss_worker(args.worker[0], args.worker[1], int(args.worker[2]))
    args.folder.mkdir(exist_ok=True)
    files = write_data(args.folder, args.rows, args.queries, args.dim)
    ours = Side([args.ours, *files, str(args.dim)])
    theirs = Side([sys.executable, __file__, "--worker", *files, str(args.dim)])
    kinds = [(theirs, "FAISS", codes) for codes in ("f32", "int8")]
    kinds += [(ours, "ours", codes) for codes in args.codes]
    shape = f"{args.rows}-{args.dim}-{args.connectivity}-{args.expansion}"

    def path(name, codes):
        return args.folder / f"{name}-{codes}-{shape}.hnsw"

    for side, name, codes in kinds:
        if args.prepare or not path(name, codes).exists():
            command = f"build {codes} {args.connectivity} {args.expansion} {path(name, codes)}"
            seconds, cpu = float(0), side.processor()
            seconds = float(side.ask(command))
            cpu = (side.processor() - cpu) / 1e3
            size = path(name, codes).stat().st_size / 1e6
            print(f"{name} {codes}: built in {seconds:.1f} s, {cpu:.1f} s of processor, {size:.0f} MB")
    if args.prepare:
        return
    print(f"{args.rows} x {args.dim}, {args.queries} queries, M = {args.connectivity}, "
          f"efConstruction = {args.expansion}, load {os.getloadavg()[0]:.1f}")
    print("FAISS codes, effort, recall | our codes, effort, recall | threads batch |"
          " ms per query: FAISS ours | ratio")
    for (_, _, theirs_codes), (_, _, codes) in itertools.product(kinds[:2], kinds[2:]):
        theirs.ask(f"open {path('FAISS', theirs_codes)}")
        ours.ask(f"open {path('ours', codes)}")
        their_effort, their_recall = least_effort(theirs, OVERSAMPLE)
        effort, recall = least_effort(ours, OVERSAMPLE)
        for threads, batch in itertools.product((1, 2), (1, 100)):
            times = {"FAISS": [], "ours": []}
            for _ in range(args.rounds):
                for side, name in ((theirs, "FAISS"), (ours, "ours")):
                    times[name].append(float(side.ask(f"time {batch} {threads}")) / args.queries)
                    time.sleep(0.02)
            theirs_ms, ours_ms = (statistics.median(times[name]) for name in ("FAISS", "ours"))
            print(f"{theirs_codes:5} {their_effort:4} {their_recall:.4f} | {codes:5} {effort:4} "
                  f"{recall:.4f} | {threads} {batch:4} | {theirs_ms:.4f} {ours_ms:.4f} | "
                  f"{ours_ms / theirs_ms:.2f}", flush=True)
    ours.close()
    theirs.close()


if __name__ == "__main__":
    sys.exit(main())
