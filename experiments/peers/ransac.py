"""RANSAC beside OpenCV on the same correspondences: a homography within 5 pixels and a fundamental matrix
within 3, at most 1 000 iterations, on pairs of real images matched by OpenCV's SIFT, one thread each, in one session.

    cargo build --example ransac_time
    python experiments/peers/ransac.py path/to/data target/debug/examples/ransac_time

OpenCV always stops early; both are given confidence 0.999999. Ours is also run to exactly 1 000 iterations, which
OpenCV cannot be told to do: nearest to it is confidence 1 - 1e-15, printed as "long" (1 itself counts as 0.99 there).
Prints medians over rounds of milliseconds per pair, their sums over pairs, and ours ÷ OpenCV.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

PAIRS, ROUNDS, STEP = 12, 5, 5
CONFIDENCE, LONG = 0.999999, 1 - 1e-15


def correspondences(query, reference, sift):
    (points_a, a), (points_b, b) = (
        sift.detectAndCompute(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), None) for path in (query, reference)
    )
    matches = [m for m, n in cv2.BFMatcher().knnMatch(a, b, k=2) if m.distance < 0.6 * n.distance]
    rows = [points_a[m.queryIdx].pt + points_b[m.trainIdx].pt for m in matches]
    return np.array(rows, np.float32).reshape(-1, 4)


def write_pairs(data, folder, pairs, step):
    frames = sorted((Path(data) / "7scenes/redkitchen/seq-01").glob("*.color.jpg"))
    sift = cv2.SIFT_create(nfeatures=5000)
    paths = []
    for pair in range(pairs):
        at = pair * (len(frames) - step) // pairs
        rows = correspondences(frames[at], frames[at + step], sift)
        paths.append(Path(folder) / f"{at:03d}.txt")
        np.savetxt(paths[-1], rows.astype(np.float64), fmt="%.17g")
    return paths


def opencv(rows, kind, confidence):
    a, b = np.ascontiguousarray(rows[:, :2]), np.ascontiguousarray(rows[:, 2:])
    start = time.perf_counter()
    if kind == "homography":
        _, mask = cv2.findHomography(a, b, cv2.RANSAC, 5.0, maxIters=1000, confidence=confidence)
    else:
        _, mask = cv2.findFundamentalMat(a, b, cv2.FM_RANSAC, 3.0, confidence, 1000)
    return 1e3 * (time.perf_counter() - start), 0 if mask is None else int(mask.sum())


def ours(program, paths):
    command = [program, "3", *map(str, paths)]
    environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
    output = subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout
    rows = [line.split("\t") for line in output.splitlines()]
    return {(path, name): (float(ms), int(count)) for path, name, ms, _, count in rows}


def main():
    data, program = sys.argv[1:3]
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        paths = write_pairs(data, folder, PAIRS, STEP)
        points = {path: np.loadtxt(path, np.float32, ndmin=2) for path in paths}
        peers = [(kind, until, value) for kind in ("homography", "fundamental")
                 for until, value in (("early", CONFIDENCE), ("exact", LONG))]
        theirs, own = {}, {}
        for _ in range(ROUNDS):
            for kind, until, confidence in peers:
                for path in paths:
                    runs = [opencv(points[path], kind, confidence) for _ in range(3)]
                    theirs.setdefault((kind, until, path), []).extend(runs)
            for (path, name), run in ours(program, paths).items():
                own.setdefault((*name.split("-"), Path(path)), []).append(run)
        report(paths, peers, points, theirs, own)


def report(paths, peers, points, theirs, own):
    print(f"OpenCV {cv2.__version__}; correspondences:", *(len(points[path]) for path in paths))
    print("                     OpenCV     ours   (ms, sum of pairs' medians)  ours/OpenCV: sum, median, worst")
    for kind, until, _ in peers:
        medians = np.array([[np.median([ms for ms, _ in side[kind, until, path]]) for path in paths]
                            for side in (theirs, own)])
        ratios = medians[1] / medians[0]
        name = kind + (", early" if until == "early" else ", long / exact")
        total = medians.sum(axis=1)
        print(f"{name:27}{total[0]:10.3f} {total[1]:9.3f} {total[1] / total[0]:8.3f} {np.median(ratios):8.3f}"
              f" {ratios.max():8.3f}")
        for side, counts in (("OpenCV", theirs), ("ours", own)):
            print(f"    inliers, {side:6}:", *(counts[kind, until, path][0][1] for path in paths))


if __name__ == "__main__":
    main()
