"""Time of DINOv2's ViT at 322 x 322, ours against PyTorch's on the CPU, alternately, two threads each.

The PyTorch side is the official architecture with its fused attention; both sides first run with the
same random weights, and the difference of their tokens is printed. Needs torch and safetensors.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
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
from safetensors.torch import save_file  # noqa: E402
from torch import nn  # noqa: E402
from torch.nn import functional  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
SIZES = {"small": (384, 12, 6), "base": (768, 12, 12), "large": (1024, 24, 16)}
SIDE, PATCH, GRID = 322, 14, 37


class Scale(nn.Module):
    def __init__(self, dim):
        super().__init__()
        self.gamma = nn.Parameter(torch.rand(dim))


class Attention(nn.Module):
    def __init__(self, dim, heads):
        super().__init__()
        self.heads, self.qkv, self.proj = heads, nn.Linear(dim, 3 * dim), nn.Linear(dim, dim)

    def forward(self, x):
        batch, n, dim = x.shape
        q, k, v = self.qkv(x).reshape(batch, n, 3, self.heads, dim // self.heads).permute(2, 0, 3, 1, 4)
        x = functional.scaled_dot_product_attention(q, k, v)
        return self.proj(x.transpose(1, 2).reshape(batch, n, dim))


class Mlp(nn.Module):
    def __init__(self, dim):
        super().__init__()
        self.fc1, self.fc2 = nn.Linear(dim, 4 * dim), nn.Linear(4 * dim, dim)

    def forward(self, x):
        return self.fc2(functional.gelu(self.fc1(x)))


class Block(nn.Module):
    def __init__(self, dim, heads):
        super().__init__()
        self.norm1, self.norm2 = nn.LayerNorm(dim, 1e-6), nn.LayerNorm(dim, 1e-6)
        self.attn, self.mlp = Attention(dim, heads), Mlp(dim)
        self.ls1, self.ls2 = Scale(dim), Scale(dim)

    def forward(self, x):
        x = x + self.ls1.gamma * self.attn(self.norm1(x))
        return x + self.ls2.gamma * self.mlp(self.norm2(x))


class Patches(nn.Module):
    def __init__(self, dim):
        super().__init__()
        self.proj = nn.Conv2d(3, dim, PATCH, PATCH)


class Vit(nn.Module):
    def __init__(self, dim, depth, heads):
        super().__init__()
        self.cls_token = nn.Parameter(torch.randn(1, 1, dim))
        self.pos_embed = nn.Parameter(torch.randn(1, 1 + GRID * GRID, dim))
        self.mask_token = nn.Parameter(torch.zeros(1, dim))
        self.patch_embed = Patches(dim)
        self.blocks = nn.ModuleList(Block(dim, heads) for _ in range(depth))
        self.norm = nn.LayerNorm(dim, 1e-6)

    def positions(self, rows, columns):
        grid = self.pos_embed[:, 1:].reshape(1, GRID, GRID, -1).permute(0, 3, 1, 2)
        scale = ((rows + 0.1) / GRID, (columns + 0.1) / GRID)
        grid = functional.interpolate(grid, scale_factor=scale, mode="bicubic")
        return torch.cat([self.pos_embed[:, :1], grid.flatten(2).transpose(1, 2)], 1)

    def forward(self, images):
        x = self.patch_embed.proj(images)
        rows, columns = x.shape[2:]
        x = torch.cat([self.cls_token.expand(len(x), -1, -1), x.flatten(2).transpose(1, 2)], 1)
        x = x + self.positions(rows, columns)
        for block in self.blocks:
            x = block(x)
        return self.norm(x)[:, 1:]


def build() -> Path:
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    command = ["cargo", "build", "--quiet", "--example", "vit_time"]
    subprocess.run(command, cwd=ROOT, check=True)
    return target / "debug/examples/vit_time"


def ours(program, arguments, threads):
    environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    pipe = subprocess.PIPE
    return subprocess.Popen([program, *arguments], stdin=pipe, stdout=pipe, text=True, env=environment)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", choices=SIZES, default="base")
    parser.add_argument("--batch", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--halves", action="store_true", help="two half-batches on two threads")
    parser.add_argument("--program", type=Path, help="vit_time, if it is built already")
    options = parser.parse_args()
    program = options.program or build()
    torch.manual_seed(0)
    torch.set_num_threads(options.threads)
    network = Vit(*SIZES[options.size]).eval()
    images = torch.rand(options.batch, 3, SIDE, SIDE)
    times = {"torch": [], "ours": []}
    with tempfile.TemporaryDirectory() as folder, torch.inference_mode():
        weights, io = f"{folder}/weights.safetensors", f"{folder}/io.safetensors"
        save_file(network.state_dict(), weights)
        save_file({"input.image": images, "output.patch": network(images).contiguous()}, io)
        mode = ["halves"] if options.halves else ["whole"]
        arguments = [options.size, str(SIDE), str(options.batch), *mode, weights, io]
        process = ours(program, arguments, options.threads)
        for _ in range(options.rounds):
            start = time.perf_counter()
            network(images)
            times["torch"].append((time.perf_counter() - start) * 1e3)
            process.stdin.write("1\n")
            process.stdin.flush()
            times["ours"].append(float(process.stdout.readline()))
        process.stdin.close()
        process.wait()
    medians = {side: statistics.median(values[2:]) for side, values in times.items()}
    minima = {side: min(values[2:]) for side, values in times.items()}
    print(f"torch {torch.__version__}, ViT {options.size}, {SIDE} x {SIDE}, batch {options.batch}, "
          f"{options.threads} threads, {options.rounds} rounds, medians (minima) in ms")
    print(f"torch {medians['torch']:.0f} ({minima['torch']:.0f}), ours {medians['ours']:.0f} "
          f"({minima['ours']:.0f}), ratio {medians['ours'] / medians['torch']:.2f} "
          f"({minima['ours'] / minima['torch']:.2f})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
