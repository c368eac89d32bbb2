"""Geometric verification beside OpenCV: SIFT with 5 000 features, ratio 0.6, a homography by 1 000
iterations of RANSAC within 5 pixels, on pairs of real images, one thread each, in one session.

    cargo build --example verify_time
    python experiments/peers/sift_ransac.py path/to/data target/debug/examples/verify_time

Prints milliseconds per pair by stage (both images' features, matching, RANSAC) and ours ÷ OpenCV.
"""

import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np

PAIRS = 8


def pairs(data):
    frames = sorted((Path(data) / "7scenes/redkitchen/seq-01").glob("*.color.jpg"))
    step = len(frames) // PAIRS
    return [(frames[i * step], frames[min(i * step + 5, len(frames) - 1)]) for i in range(PAIRS)]


def opencv(query, reference):
    sift = cv2.SIFT_create(nfeatures=5000)
    images = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in (query, reference)]
    start = time.perf_counter()
    (points_a, a), (points_b, b) = (sift.detectAndCompute(image, None) for image in images)
    detected = time.perf_counter()
    matches = [m for m, n in cv2.BFMatcher().knnMatch(a, b, k=2) if m.distance < 0.6 * n.distance]
    matched = time.perf_counter()
    inliers = 0
    if len(matches) >= 4:
        at = lambda points, index: points[index].pt
        source = np.float32([at(points_a, m.queryIdx) for m in matches])
        target = np.float32([at(points_b, m.trainIdx) for m in matches])
        _, mask = cv2.findHomography(source, target, cv2.RANSAC, 5.0, maxIters=1000)
        inliers = 0 if mask is None else int(mask.sum())
    verified = time.perf_counter()
    stages = (detected - start, matched - detected, verified - matched, verified - start)
    return [1e3 * stage for stage in stages], inliers


def main():
    data, program = sys.argv[1:3]
    cv2.setNumThreads(1)
    chosen = pairs(data)
    opencv(*chosen[0])
    theirs, ours = [], []
    for _ in range(3):
        theirs.append([opencv(*pair) for pair in chosen])
        arguments = [str(path) for pair in chosen for path in pair]
        output = subprocess.run([program, *arguments], env={"RAYON_NUM_THREADS": "1"}, check=True,
                                capture_output=True, text=True).stdout
        rows = [[float(field) for field in line.split()] for line in output.splitlines()]
        ours.append([(row[:4], int(row[4])) for row in rows])
    median = lambda runs: np.median([[times for times, _ in run] for run in runs], axis=(0, 1))
    print("                features  matching   RANSAC    total   (ms per pair, one thread)")
    for name, runs in (("OpenCV " + cv2.__version__, theirs), ("ours", ours)):
        print(f"{name:14}" + "".join(f"{value:10.2f}" for value in median(runs)))
    print(f"{'ours / OpenCV':14}" + "".join(f"{value:10.2f}" for value in median(ours) / median(theirs)))
    print("inliers, OpenCV:", [count for _, count in theirs[0]])
    print("inliers, ours:  ", [count for _, count in ours[0]])


if __name__ == "__main__":
    main()
