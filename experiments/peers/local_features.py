"""OpenCV and vpr-vision side by side: SIFT, ratio matching, homographies; the same images, two threads, alternately.

    pip install "opencv-python-headless<5" numpy
    cargo build --example local_features_time
    python experiments/peers/local_features.py IMAGE_A IMAGE_B --ours target/debug/examples/local_features_time

The two images should show the same place. For matching, the SIFT descriptors of both images and of their halves,
quarters, … are collected until there are 2 000 of each. Prints medians and minima in milliseconds and the ratio of the
medians, ours / OpenCV.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

# Both sides: big buffers are kept instead of being returned to the system after every call.
MALLOC = {
    "MALLOC_MMAP_THRESHOLD_": "4294967296",
    "MALLOC_TRIM_THRESHOLD_": "17179869184",
    "MALLOC_TOP_PAD_": "67108864",
}
N_ROWS, RATIO, FEATURES, PIXELS, ITERATIONS = 2000, 0.6, 5000, 5.0, 1000
# ours: OpenCV's counterpart
PAIRS = {
    "sift": "sift",
    "sift, not doubled": "sift",
    "sift, 1000 strongest": "sift, 1000 strongest",
    "orb": "orb",
    "match, ratio": "match, ratio",
    "match, mutual": "match, mutual",
    "ransac, 1000": "ransac, 1000",
    "ransac, 0.995": "ransac, 0.995",
}


def rows(path, rng):
    """2 000 descriptors of an image and, until there are enough, of it turned and scaled."""
    import cv2

    image = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
    sift, found = cv2.SIFT_create(), []
    for step in range(40):
        turn = cv2.getRotationMatrix2D((image.shape[1] / 2, image.shape[0] / 2), 9 * step, 1 + 0.1 * (step % 4))
        _, some = sift.detectAndCompute(cv2.warpAffine(image, turn, image.shape[::-1]), None)
        found += [] if some is None else [some]
        if sum(map(len, found)) >= N_ROWS:
            break
    found = np.concatenate(found).astype(np.float32)
    return found[rng.permutation(len(found))[:N_ROWS]]


def opencv(a, b, rows_a, rows_b, repetitions):
    """The other process: prints the same lines as our example does."""
    import cv2

    cv2.setNumThreads(2)
    a, b = (cv2.imread(path, cv2.IMREAD_GRAYSCALE) for path in (a, b))

    def clock(name, run):
        last = run()
        for _ in range(repetitions):
            start = time.perf_counter()
            last = run()
            print(f"{name}\t{(time.perf_counter() - start) * 1e3}")
        return last

    sift, few, orb = cv2.SIFT_create(nfeatures=FEATURES), cv2.SIFT_create(nfeatures=1000), cv2.ORB_create(500)
    points, descriptors = clock("sift", lambda: sift.detectAndCompute(a, None))
    clock("sift, 1000 strongest", lambda: few.detectAndCompute(a, None))
    clock("orb", lambda: orb.detectAndCompute(a, None))
    print(f"# keypoints: {len(points)}")
    rows_a, rows_b = np.load(rows_a), np.load(rows_b)
    matcher, mutual = cv2.BFMatcher(cv2.NORM_L2), cv2.BFMatcher(cv2.NORM_L2, crossCheck=True)
    pairs = clock("match, ratio", lambda: matcher.knnMatch(rows_a, rows_b, k=2))
    clock("match, mutual", lambda: mutual.match(rows_a, rows_b))
    good = sum(m.distance < RATIO * n.distance for m, n in pairs)
    print(f"# {len(rows_a)} x {len(rows_b)} rows: {good} matches")
    other, other_descriptors = sift.detectAndCompute(b, None)
    pairs = matcher.knnMatch(descriptors, other_descriptors, k=2)
    good = [m for m, n in pairs if m.distance < RATIO * n.distance]
    source = np.float32([points[m.queryIdx].pt for m in good])
    target = np.float32([other[m.trainIdx].pt for m in good])

    def ransac(confidence):
        return cv2.findHomography(source, target, cv2.RANSAC, PIXELS, maxIters=ITERATIONS, confidence=confidence)

    _, mask = clock("ransac, 1000", lambda: ransac(1 - 1e-12))
    clock("ransac, 0.995", lambda: ransac(0.995))
    print(f"# {len(good)} matches, {int(mask.sum())} inliers")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("images", nargs=2)
    parser.add_argument("--ours", required=True)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--repetitions", type=int, default=10)
    options = parser.parse_args()
    times, env = {}, os.environ | MALLOC | {"RAYON_NUM_THREADS": "2"}
    with tempfile.TemporaryDirectory() as folder:
        files = [str(Path(folder) / name) for name in ("a.npy", "b.npy")]
        for image, file in zip(options.images, files):
            np.save(file, rows(image, np.random.default_rng(0)))
        arguments = [*options.images, *files, str(options.repetitions)]
        sides = {"ours": [options.ours], "OpenCV": [sys.executable, __file__, "opencv"]}
        for turn in range(options.rounds):
            for side, command in sides.items():
                text = subprocess.check_output(command + arguments, env=env, text=True)
                for line in text.splitlines():
                    if line.startswith("#"):
                        if turn == 0:
                            print(f"{side:6} {line[2:]}")
                        continue
                    name, value = line.split("\t")
                    times.setdefault((side, name), []).append(float(value))
    print(f"{'':22} {'ours':>8} {'(min)':>8} {'OpenCV':>8} {'(min)':>8}   ratio")
    for name, peer in PAIRS.items():
        ours, theirs = times["ours", name], times["OpenCV", peer]
        medians = statistics.median(ours), statistics.median(theirs)
        numbers = f"{medians[0]:8.2f} {min(ours):8.2f} {medians[1]:8.2f} {min(theirs):8.2f}"
        print(f"{name:22} {numbers}   {medians[0] / medians[1]:.2f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["opencv"]:
        opencv(*sys.argv[2:6], int(sys.argv[6]))
    else:
        main()
