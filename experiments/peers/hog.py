"""Time of HOG at 512 x 512, ours against OpenCV's, alternately, one thread each."""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
CONFIGURATIONS = {"released": (16, 8, 16), "thesis": (32, 16, 16)}


def golden_image() -> np.ndarray:
    """The committed image, red first (safetensors: length, JSON header, data)."""
    file = (ROOT / "data/golden/hog_opencv/hog.safetensors").read_bytes()
    length = int.from_bytes(file[:8], "little")
    entry = json.loads(file[8 : 8 + length])["image"]
    start, end = entry["data_offsets"]
    data = file[8 + length + start : 8 + length + end]
    return np.frombuffer(data, np.uint8).reshape(entry["shape"])


def cpu_name() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(it.split(":")[1].strip() for it in lines if it.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def build() -> Path:
    command = ["cargo", "build", "--quiet", "--example", "hog_time"]
    subprocess.run(command, cwd=ROOT, check=True)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return target / "debug/examples/hog_time"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=201)
    rounds = parser.parse_args().rounds
    image = golden_image()
    bgr = np.ascontiguousarray(image[:, :, ::-1])
    cv2.setNumThreads(1)

    with tempfile.NamedTemporaryFile(suffix=".rgb") as file:
        file.write(image.tobytes())
        file.flush()
        ours = subprocess.Popen(
            [build(), file.name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        print(f"OpenCV {cv2.__version__}, {cpu_name()}, {rounds} rounds, medians (minima) in ms")
        slow = False
        for name, (block, stride, cell) in CONFIGURATIONS.items():
            hog = cv2.HOGDescriptor((512, 512), (block,) * 2, (stride,) * 2, (cell,) * 2, 9)
            times = {"OpenCV": [], "ours": []}
            for _ in range(rounds + 5):
                start = time.perf_counter_ns()
                hog.compute(bgr)
                times["OpenCV"].append((time.perf_counter_ns() - start) / 1e6)
                ours.stdin.write(name + "\n")
                ours.stdin.flush()
                times["ours"].append(int(ours.stdout.readline()) / 1e6)
            times = {peer: it[5:] for peer, it in times.items()}
            theirs, mine = (statistics.median(times[peer]) for peer in ("OpenCV", "ours"))
            lows = min(times["OpenCV"]), min(times["ours"])
            print(
                f"{name:9} OpenCV {theirs:.2f} ({lows[0]:.2f})  ours {mine:.2f} ({lows[1]:.2f})  "
                f"ratio {mine / theirs:.2f} ({lows[1] / lows[0]:.2f})"
            )
            slow |= mine / theirs > 0.5
        ours.stdin.close()
        ours.wait()
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
