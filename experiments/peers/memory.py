"""Largest resident size of a process that runs a network three times, ours beside PyTorch's.

Two threads each, with the malloc settings of `convolution.py`. What importing PyTorch takes alone is
printed too.
"""

import argparse
import os
import resource
import subprocess
import sys
from pathlib import Path

CASES = ["import", "vit base", "resnet34 1", "resnet34 8", "train 16", "finetune 16"]


def peer(case):
    """Runs a case in this process and prints its size in MiB."""
    import torch

    torch.set_num_threads(2)
    name, _, number = case.partition(" ")
    if name == "vit":
        from vit import SIDE, SIZES, Vit

        network, images = Vit(*SIZES[number]).eval(), torch.rand(1, 3, SIDE, SIDE)
        run = lambda: network(images)  # noqa: E731
    elif name == "import":
        import torchvision  # noqa: F401

        run = int
    else:
        from convolution import finetuning_step, resnet34, training_step

        cases = {"resnet34": resnet34, "train": training_step, "finetune": finetuning_step}
        run = cases[name](int(number))
    with torch.inference_mode(name not in ("train", "finetune")):
        for _ in range(3):
            run()
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)


def ours(case, folder, environment):
    name, _, number = case.partition(" ")
    if name == "vit":
        command, lines = [folder / "vit_time", number, "322", "1"], "3\n"
    else:
        command, lines = [folder / "convolution_time"], f"{case}\n" * 3
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, env=environment
    ) as process:
        process.stdin.write(lines)
        process.stdin.close()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{command[0]} ended with {process.returncode}")
    return usage.ru_maxrss // 1024


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    root = Path(__file__).resolve().parents[2]
    target = Path(os.environ.get("CARGO_TARGET_DIR", root / "target"))
    parser.add_argument("--examples", type=Path, default=target / "debug/examples")
    parser.add_argument("--peer", choices=CASES, help="run one of PyTorch's cases, print its size")
    options = parser.parse_args()
    if options.peer:
        peer(options.peer)
        return 0
    settings = {
        "MALLOC_MMAP_THRESHOLD_": "4294967296",
        "MALLOC_TRIM_THRESHOLD_": "17179869184",
        "MALLOC_TOP_PAD_": "67108864",
        "RAYON_NUM_THREADS": "2",
    }
    environment = {**os.environ, **settings}
    larger = False
    for case in CASES:
        command = [sys.executable, __file__, "--peer", case]
        theirs = int(subprocess.run(
            command, env=environment, check=True, capture_output=True, text=True
        ).stdout)
        if case == "import":
            print(f"{case:12} PyTorch {theirs} MiB")
            continue
        mine = ours(case, options.examples, environment)
        print(f"{case:12} PyTorch {theirs} MiB  ours {mine} MiB  ratio {mine / theirs:.2f}", flush=True)
        larger |= mine > theirs
    return 1 if larger else 0


if __name__ == "__main__":
    sys.exit(main())
