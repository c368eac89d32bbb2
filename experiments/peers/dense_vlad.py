"""Time of DenseVLAD at 640 x 480 (four scales, every second pixel, 128 words), ours against OpenCV and NumPy."""

import argparse
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2  # noqa: E402
import numpy as np  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
BINS, STEP = [4, 6, 8, 10], 2


def gaussian(sigma):
    x = np.arange(-np.ceil(4 * sigma), np.ceil(4 * sigma) + 1)
    kernel = np.exp(-0.5 * (x / sigma) ** 2)
    return (kernel / kernel.sum()).astype(np.float32)


def scale(gray, size):
    kernel = gaussian(size / 6)
    blurred = cv2.sepFilter2D(gray, cv2.CV_32F, kernel, kernel, borderType=cv2.BORDER_REPLICATE)
    dy, dx = np.gradient(blurred)
    length, angle = cv2.cartToPolar(dx, dy)
    angle *= np.float32(8 / (2 * np.pi))
    lower = np.floor(angle).astype(np.int32)
    share = angle - lower
    votes = np.zeros(gray.shape + (8,), np.float32)
    rows, columns = np.indices(gray.shape)
    votes[rows, columns, lower % 8] = (1 - share) * length
    votes[rows, columns, (lower + 1) % 8] = share * length
    triangle = ((size - np.abs(np.arange(-size + 1, size))) / size**2).astype(np.float32)
    maps = np.dstack([
        cv2.sepFilter2D(part, cv2.CV_32F, triangle, triangle, borderType=cv2.BORDER_REPLICATE)
        for part in (votes[:, :, :4], votes[:, :, 4:])
    ])
    x = np.arange(-size + 1, size)
    weights = [size * np.exp(-0.5 * ((x - size * (at - 1.5)) / (size * 1.5)) ** 2).mean() for at in range(4)]
    first = int(1.5 * (max(BINS) - size))
    top = np.arange(first, gray.shape[0] - 3 * size, STEP)
    left = np.arange(first, gray.shape[1] - 3 * size, STEP)
    parts = []
    for by in range(4):
        for bx in range(4):
            part = maps[top[0] + by * size : top[-1] + by * size + 1 : STEP, left[0] + bx * size : left[-1] + bx * size + 1 : STEP]
            parts.append(part.reshape(-1, 8) * np.float32(weights[by] * weights[bx]))
    d = np.concatenate(parts, 1)
    flat = d.sum(1) / (3 * size + 1) ** 2 < 0.005
    d /= np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-30)
    np.minimum(d, 0.2, out=d)
    d = np.sqrt(d / np.maximum(d.sum(1, keepdims=True), 1e-30))
    d[flat] = 0
    return d


def describe(image, words):
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32) / 255
    residuals = np.zeros(words.shape, np.float64)
    half = 0.5 * (words**2).sum(1)
    for size in BINS:
        d = scale(gray, size)
        nearest = (d @ words.T - half).argmax(1)
        order = np.argsort(nearest, kind="stable")
        counts = np.bincount(nearest, minlength=len(words))
        present = np.flatnonzero(counts)
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])[present]
        residuals[present] += np.add.reduceat(d[order], starts, axis=0)
        residuals -= counts[:, None] * words
    norms = np.linalg.norm(residuals, axis=1, keepdims=True)
    residuals /= np.where(norms > 0, norms, 1)
    return residuals.ravel() / np.linalg.norm(residuals)


def build():
    command = ["cargo", "build", "--quiet", "--example", "dense_vlad_time"]
    subprocess.run(command, cwd=ROOT, check=True)
    return Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug/examples/dense_vlad_time"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--ours", type=Path, help="the built example, instead of building it")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    random = np.random.default_rng(3)
    y, x = np.mgrid[0:480, 0:640]
    gray = 120 + 60 * np.sin(x / 15 + y / 29) + 40 * np.cos(y / 7 - x / 33)
    image = np.clip(gray[..., None] + random.normal(0, 12, (480, 640, 3)), 0, 255).astype(np.uint8)
    words = np.sqrt(random.dirichlet(np.full(128, 0.3), 128)).astype(np.float32)
    with tempfile.TemporaryDirectory() as folder:
        pixels, numbers = Path(folder) / "image.rgb", Path(folder) / "words.f32"
        pixels.write_bytes(image.tobytes())
        numbers.write_bytes(words.tobytes())
        ours = subprocess.Popen(
            [args.ours or build(), pixels, numbers], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1,
            env=os.environ | {"RAYON_NUM_THREADS": "1"},
        )
        times = {"ours": [], "OpenCV and NumPy": []}
        for _ in range(args.rounds):
            ours.stdin.write("time\n")
            ours.stdin.flush()
            times["ours"].append(int(ours.stdout.readline()) / 1e6)
            start = time.perf_counter()
            theirs = describe(image, words)
            times["OpenCV and NumPy"].append((time.perf_counter() - start) * 1e3)
        ours.stdin.write("print\n")
        ours.stdin.flush()
        mine = np.array(ours.stdout.readline().split(), np.float64)
    medians = {name: statistics.median(values) for name, values in times.items()}
    for name, values in times.items():
        print(f"{name:<18} median {medians[name]:8.1f} ms, minimum {min(values):8.1f} ms")
    print(f"ratio {medians['ours'] / medians['OpenCV and NumPy']:.2f}; cosine of the descriptors {mine @ theirs:.6f}")


if __name__ == "__main__":
    main()
