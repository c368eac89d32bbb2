"""Time of convolutions, ResNet-34 and training steps, ours against PyTorch's, alternately.

Two threads each. Before each round of either side there is a pause, in which the other side's waiting
threads go to sleep (OpenMP's spin for some milliseconds and would take one of two cores from ours);
a round is the median of some calls in a row. PyTorch runs with the malloc settings that keep it from
returning its buffers to the system at each call (`--as-installed`: without them, up to three times slower
on convolutions); ours with the allocator of the programs, and without settings.
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
AS_INSTALLED = "--as-installed"
if AS_INSTALLED not in sys.argv and any(os.environ.get(it) != MALLOC[it] for it in MALLOC):
    os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **MALLOC})

import torch
import torchvision

ROOT = Path(__file__).resolve().parents[2]
LAYERS = [
    (8, 64, 64, 56, 3, 1),
    (8, 3, 64, 224, 7, 2),
    (8, 128, 128, 28, 3, 1),
    (8, 256, 256, 14, 3, 1),
    (8, 512, 512, 7, 3, 1),
    (8, 64, 128, 56, 3, 2),
    (8, 64, 256, 56, 1, 1),
    (1, 64, 64, 56, 3, 1),
    (1, 512, 512, 7, 3, 1),
]
# Seconds before each round of a side, and calls in it.
PAUSE, CALLS = 0.05, 7
# Ours at most this many times PyTorch's.
LIMITS = {"resnet34 1": 1.4, "resnet34 8": 1.4, "train 16": 1.2, "finetune 16": 1.2}


def layer(images, channels, out, side, kernel, stride):
    conv = torch.nn.Conv2d(channels, out, kernel, stride, kernel // 2).eval()
    data = torch.randn(images, channels, side, side)
    return lambda: conv(data)


def resnet34(images):
    network = torchvision.models.resnet34().eval()
    network.avgpool = network.fc = torch.nn.Identity()
    data = torch.randn(images, 3, 224, 224)
    return lambda: network(data)


def training_step(images):
    network = torchvision.models.resnet18(num_classes=10).train()
    adam = torch.optim.Adam(network.parameters(), 1e-3)
    data, classes = torch.randn(images, 3, 96, 96), torch.arange(images) % 10

    def step():
        adam.zero_grad(set_to_none=True)
        torch.nn.functional.cross_entropy(network(data), classes).backward()
        adam.step()

    return step


class Unit(torch.nn.Sequential):
    def __init__(self, channels, out, kernel=3, stride=1):
        conv = torch.nn.Conv2d(channels, out, kernel, stride, kernel // 2, bias=False)
        super().__init__(conv, torch.nn.GroupNorm(out // 8, out))


class Block(torch.nn.Module):
    def __init__(self, width):
        super().__init__()
        self.first, self.second = Unit(width, width), Unit(width, width)

    def forward(self, images):
        inner = torch.nn.functional.relu(self.first(images), inplace=True)
        return torch.nn.functional.relu(images + self.second(inner), inplace=True)


def default_network():
    """The default network: three stages of one residual block, a grid of 3 by 4, a projection."""
    relu = torch.nn.ReLU(inplace=True)
    layers = [torch.nn.InstanceNorm2d(3, eps=1e-4), Unit(3, 32, 7, 4), relu]
    for number, (width, out) in enumerate([(32, 32), (32, 64), (64, 128)]):
        layers += [Unit(width, out, 3, 2 if number else 1), relu, Block(out)]
    layers += [torch.nn.Conv2d(128, 48, 1, bias=False), torch.nn.AdaptiveAvgPool2d((3, 4))]
    return torch.nn.Sequential(*layers, torch.nn.Flatten(), torch.nn.Linear(576, 256))


def finetuning_step(triplets):
    network = default_network().train()
    adam = torch.optim.Adam(network.parameters(), 3e-4)
    data = torch.rand(3 * triplets, 3, 96, 128) * 2 - 1

    def step():
        adam.zero_grad(set_to_none=True)
        rows = torch.nn.functional.normalize(network(data))
        torch.nn.functional.triplet_margin_loss(*rows.chunk(3), margin=0.3).backward()
        adam.step()

    return step


def build() -> Path:
    example = "convolution_time"
    command = ["cargo", "build", "--quiet", "--example", example]
    subprocess.run(command, cwd=ROOT, check=True)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return target / "debug/examples" / example


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--binary", type=Path, help="the built example, if it is not to be built")
    parser.add_argument("--only", help="cases that start with this")
    parser.add_argument(AS_INSTALLED, action="store_true", help="PyTorch without malloc settings")
    args = parser.parse_args()
    torch.set_num_threads(2)
    cases = {"layer " + " ".join(map(str, it)): layer(*it) for it in LAYERS}
    cases |= {"resnet34 1": resnet34(1), "resnet34 8": resnet34(8), "train 16": training_step(16)}
    cases["finetune 16"] = finetuning_step(16)
    cases = {name: it for name, it in cases.items() if name.startswith(args.only or "")}
    settings = {name: value for name, value in os.environ.items() if name not in MALLOC}
    ours = subprocess.Popen(
        [args.binary or build()],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        bufsize=1,
        env={**settings, "RAYON_NUM_THREADS": "2"},
    )
    print(f"PyTorch {torch.__version__}, 2 threads, {args.rounds} rounds, medians (minima) in ms")
    missed = False
    for name, peer in cases.items():
        times = {"peer": [], "ours": []}
        for _ in range(args.rounds + 1):
            time.sleep(PAUSE)
            calls = []
            with torch.inference_mode(not name.startswith(("train", "finetune"))):
                for _ in range(CALLS):
                    start = time.perf_counter_ns()
                    peer()
                    calls.append((time.perf_counter_ns() - start) / 1e6)
            times["peer"].append(statistics.median(calls))
            time.sleep(PAUSE)
            calls = []
            for _ in range(CALLS):
                ours.stdin.write(name + "\n")
                ours.stdin.flush()
                calls.append(int(ours.stdout.readline()) / 1e6)
            times["ours"].append(statistics.median(calls))
        times = {who: it[1:] for who, it in times.items()}
        theirs, mine = (statistics.median(times[who]) for who in ("peer", "ours"))
        print(
            f"{name:28} PyTorch {theirs:.2f} ({min(times['peer']):.2f})  "
            f"ours {mine:.2f} ({min(times['ours']):.2f})  ratio {mine / theirs:.2f}",
            flush=True,
        )
        missed |= mine / theirs > LIMITS.get(name, float("inf"))
    ours.stdin.close()
    ours.wait()
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
