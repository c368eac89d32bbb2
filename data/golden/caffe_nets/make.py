"""Writes `io.safetensors`: what OpenCV's reader of Caffe files (before 5) makes of AlexNet, CaffeNet and CALC.

    pip install numpy safetensors "opencv-python-headless<5"
    python make.py

Weights and images are numbers from a formula, so that none have to be kept: number `i` of array `a` is
`(((i + 7919 a) * 2654435761 mod 2^32) >> 8) / 2^24 - 0.5`, times a scale.
"""

import pathlib
import sys

import cv2
import numpy as np
from safetensors.numpy import save_file

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE / "../../../crates/vpr-files/tests/golden"))
from messages import blob, message, number, text  # noqa: E402


def numbers(array, shape, scale):
    index = np.arange(int(np.prod(shape)), dtype=np.uint64) + np.uint64(7919 * array)
    hashed = (index * np.uint64(2654435761)) % np.uint64(2**32) >> np.uint64(8)
    return ((hashed.astype(np.float64) / 2**24 - 0.5) * scale).astype(np.float32).reshape(shape)


def weights(layers):
    out = {}
    for at, (name, shape) in enumerate(layers):
        fan = np.prod(shape[1:])
        out[name] = (numbers(2 * at, shape, (24 / fan) ** 0.5), numbers(2 * at + 1, shape[:1], 0.2))
    return out


def caffemodel(layers):
    out = b""
    for name, (weight, bias) in weights(layers).items():
        layer = text(1, name) + text(2, "Convolution")
        out += message(100, layer + message(7, blob(weight)) + message(7, blob(bias)))
    return out


def convolution(name, bottom, n, kernel, stride=1, pad=0, group=1):
    return f"""
layer {{ name: "{name}" type: "Convolution" bottom: "{bottom}" top: "{name}" convolution_param {{
  num_output: {n} kernel_size: {kernel} stride: {stride} pad: {pad} group: {group} }} }}
layer {{ name: "relu_{name}" type: "ReLU" bottom: "{name}" top: "{name}" }}"""


def pool(name, bottom):
    return f"""
layer {{ name: "{name}" type: "Pooling" bottom: "{bottom}" top: "{name}" pooling_param {{ pool: MAX kernel_size: 3 stride: 2 }} }}"""


def norm(name, bottom):
    return f"""
layer {{ name: "{name}" type: "LRN" bottom: "{bottom}" top: "{name}" lrn_param {{ local_size: 5 alpha: 0.0001 beta: 0.75 }} }}"""


def net(shape):
    n, c, h, w = shape
    return f'name: "net"\ninput: "data"\ninput_dim: {n} input_dim: {c} input_dim: {h} input_dim: {w}'


ALEX = [("conv1", (96, 3, 11, 11)), ("conv2", (256, 48, 5, 5)), ("conv3", (384, 256, 3, 3)),
        ("conv4", (384, 192, 3, 3)), ("conv5", (256, 192, 3, 3))]
CALC = [("conv1", (64, 1, 5, 5)), ("conv2", (128, 64, 4, 4)), ("conv3", (4, 128, 3, 3))]


def alexnet(first, second):
    def reduced(at, bottom):
        a, b = f"a{at}", f"b{at}"
        return first(a, bottom) + second(b, a), b
    one, end = reduced(1, "conv1")
    two, end2 = reduced(2, "conv2")
    return (net((1, 3, 227, 227)) + convolution("conv1", "data", 96, 11, 4) + one
            + convolution("conv2", end, 256, 5, 1, 2, 2) + two + convolution("conv3", end2, 384, 3, 1, 1)
            + convolution("conv4", "conv3", 384, 3, 1, 1, 2) + convolution("conv5", "conv4", 256, 3, 1, 1, 2))


calc = (net((1, 1, 120, 160)) + convolution("conv1", "data", 64, 5, 2, 4) + pool("pool1", "conv1") + norm("norm1", "pool1")
        + convolution("conv2", "norm1", 128, 4, 1, 2) + pool("pool2", "conv2") + norm("norm2", "pool2")
        + convolution("conv3", "norm2", 4, 3))


def run(prototxt, layers, image, end):
    read = cv2.dnn.readNetFromCaffe(np.frombuffer(prototxt.encode(), np.uint8), np.frombuffer(caffemodel(layers), np.uint8))
    read.setPreferableBackend(cv2.dnn.DNN_BACKEND_OPENCV)
    read.enableWinograd(False)
    read.setInput(image)
    return read.forward(end)


image = numbers(100, (1, 3, 227, 227), 255)
before, after = alexnet(norm, pool), alexnet(pool, norm)
gray = numbers(101, (1, 1, 120, 160), 1) + np.float32(0.5)
out = {
    "alexnet.conv3": run(before, ALEX, image, "relu_conv3").ravel()[::97],
    "alexnet.conv5": run(before, ALEX, image, "relu_conv5").ravel()[::61],
    "caffenet.conv5": run(after, ALEX, image, "relu_conv5").ravel()[::61],
    "calc": run(calc, CALC, gray, "relu_conv3").ravel(),
}
for name, values in out.items():
    print(name, values.shape, "mean", values.mean(), "max", values.max())
save_file({name: np.ascontiguousarray(values) for name, values in out.items()}, HERE / "io.safetensors")
