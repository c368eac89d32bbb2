"""Time of CoPR's network H, ours against PyTorch's on the CPU, alternately, two threads each.

512 values, seven hidden layers, Adam, mean squared error: a step of training with batches of 32 and of
512, and 13 000 descriptors at once; then, for the map of Office as in the thesis (1 000 images, 13 000
regressed rows), densification and the search of 1 000 queries together. Needs torch.

Our step includes first weights, one validation, one checkpoint and one log line per call, spread over its
steps; PyTorch's is the bare loop over pairs that are in memory.
"""

import argparse
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

MALLOC = {
    "MALLOC_MMAP_THRESHOLD_": "4294967296",
    "MALLOC_TRIM_THRESHOLD_": "17179869184",
    "MALLOC_TOP_PAD_": "67108864",
}
if any(os.environ.get(key) != value for key, value in MALLOC.items()):
    os.environ.update(MALLOC)
    os.execv(sys.executable, [sys.executable, *sys.argv])

import torch  # noqa: E402
from torch import nn  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
DIM, POSE, IMAGES = 512, 7, 1000
# Between the two sides: OpenMP's threads spin for a while after a call and would take a core from ours.
PAUSE = 0.3


def build() -> Path:
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    command = ["cargo", "build", "--quiet", "--example", "regressor_time"]
    subprocess.run(command, cwd=ROOT, check=True)
    return target / "debug/examples/regressor_time"


def network() -> nn.Module:
    width = DIM + POSE
    layers = [layer for _ in range(7) for layer in (nn.Linear(width, width), nn.GELU())]
    return nn.Sequential(*layers, nn.Linear(width, DIM))


def training(batch: int, steps: int) -> float:
    model = network()
    adam = torch.optim.Adam(model.parameters(), lr=5e-4)
    inputs, targets = torch.randn(16660, DIM + POSE) / 16, torch.randn(16660, DIM) / 16
    order = torch.randperm(len(inputs))
    start = time.perf_counter()
    for step in range(steps):
        first = step * batch % (len(inputs) - batch)
        chosen = order[first : first + batch]
        loss = nn.functional.mse_loss(model(inputs[chosen]), targets[chosen]) * 1000
        adam.zero_grad()
        loss.backward()
        adam.step()
    return (time.perf_counter() - start) / steps


def densify(n: int, searched: bool) -> float:
    model, images, queries = network().eval(), torch.randn(IMAGES, DIM), torch.randn(IMAGES, DIM)
    inputs = torch.randn(n, DIM + POSE) / 16
    with torch.inference_mode():
        start = time.perf_counter()
        rows = model(inputs)
        if searched:
            dense = torch.cat([images, rows])
            torch.cdist(queries, dense).argmin(1)
        return time.perf_counter() - start


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--steps", type=int, default=200, help="steps of a training that is timed, half as many with batches of 512")
    parser.add_argument("--program", type=Path, help="regressor_time, if it is built already")
    options = parser.parse_args()
    torch.manual_seed(0)
    torch.set_num_threads(options.threads)
    steps = options.steps
    cases = {
        "training step, batch 32": (f"train 32 {steps}", lambda: training(32, steps)),
        "training step, batch 512": (f"train 512 {steps // 2}", lambda: training(512, steps // 2)),
        "13 000 descriptors": ("densify 13000", lambda: densify(13000, False)),
        "13 000 descriptors and 1 000 queries": ("office 13000", lambda: densify(13000, True)),
    }
    environment = {**os.environ, "RAYON_NUM_THREADS": str(options.threads)}
    pipe = subprocess.PIPE
    program = options.program or build()
    process = subprocess.Popen([program], stdin=pipe, stdout=pipe, text=True, env=environment)
    print(f"torch {torch.__version__}, {options.threads} threads, {options.rounds} rounds; load averages "
          f"{' '.join(f'{it:.1f}' for it in os.getloadavg())}; medians (minima) in ms")
    for name, (line, theirs) in cases.items():
        times = {"torch": [], "ours": []}
        for _ in range(options.rounds):
            time.sleep(PAUSE)
            times["torch"].append(theirs() * 1e3)
            time.sleep(PAUSE)
            process.stdin.write(f"{line}\n")
            process.stdin.flush()
            times["ours"].append(float(process.stdout.readline()) / 1e6)
        medians = {side: statistics.median(values) for side, values in times.items()}
        minima = {side: min(values) for side, values in times.items()}
        print(f"{name}: torch {medians['torch']:.2f} ({minima['torch']:.2f}), ours {medians['ours']:.2f} "
              f"({minima['ours']:.2f}), ratio {medians['ours'] / medians['torch']:.2f} "
              f"({minima['ours'] / minima['torch']:.2f})", flush=True)
    process.stdin.close()
    process.wait()
    print(f"load averages at the end {' '.join(f'{it:.1f}' for it in os.getloadavg())}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
