"""Writes the `.caffemodel`, `.binaryproto` and `.mat` files beside this script.

Caffe's messages are encoded here by hand and read back by OpenCV (before 5), which must compute with
them what NumPy computes; `.mat` files are SciPy's.

    pip install numpy scipy "opencv-python-headless<5"
    python weights.py
"""

import pathlib

import cv2
import numpy as np
import scipy.io
from messages import blob, message, number, text

HERE = pathlib.Path(__file__).parent


PARAMETERS = number(1, 4) + number(5, 2) + number(4, 3)  # num_output, group, kernel_size


def new_form(blobs):
    convolution = text(1, "conv") + text(2, "Convolution") + text(3, "data") + text(4, "conv")
    convolution += b"".join(message(7, it) for it in blobs) + message(106, PARAMETERS)
    rectifier = text(1, "relu") + text(2, "ReLU") + text(3, "conv") + text(4, "conv")
    return text(1, "new") + message(100, convolution) + message(100, rectifier)


def older_form(blobs):
    convolution = text(2, "data") + text(3, "conv") + text(4, "conv") + number(5, 4)
    convolution += b"".join(message(6, it) for it in blobs) + message(10, PARAMETERS)
    rectifier = text(2, "conv") + text(3, "conv") + text(4, "relu") + number(5, 18)
    return text(1, "older") + message(2, convolution) + message(2, rectifier)


PROTOTXT = """
name: "net"
input: "data"
input_dim: 1 input_dim: 2 input_dim: 5 input_dim: 5
layer { name: "conv" type: "Convolution" bottom: "data" top: "conv"
  convolution_param { num_output: 4 group: 2 kernel_size: 3 } }
layer { name: "relu" type: "ReLU" bottom: "conv" top: "conv" }
"""

weights = (np.arange(36, dtype=np.float32).reshape(4, 1, 3, 3) - 17) / 8
bias = np.array([0.5, -1.0, 0.25, 2.0], np.float32)
image = np.sin(np.arange(50, dtype=np.float32)).reshape(1, 2, 5, 5)
expected = np.zeros((1, 4, 3, 3), np.float32)
for out in range(4):
    for y in range(3):
        for x in range(3):
            patch = image[0, out // 2, y : y + 3, x : x + 3]
            expected[0, out, y, x] = max((patch * weights[out, 0]).sum() + bias[out], 0)

for name, network in [
    ("new.caffemodel", new_form([blob(weights), blob(bias, packed=False)])),
    ("older.caffemodel", older_form([blob(weights, legacy=True), blob(bias, legacy=True)])),
]:
    (HERE / name).write_bytes(network)
    net = cv2.dnn.readNetFromCaffe(np.frombuffer(PROTOTXT.encode(), np.uint8), np.frombuffer(network, np.uint8))
    net.setInput(image)
    difference = np.abs(net.forward() - expected).max()
    assert difference < 1e-5, (name, difference)
    print(name, "is read by OpenCV", cv2.__version__, "and gives what NumPy gives")

mean = np.arange(12, dtype=np.float64).reshape(1, 3, 2, 2) * 10.5
(HERE / "mean.binaryproto").write_bytes(blob(mean, legacy=True, double=True))

arrays = {
    "CX": np.arange(6, dtype=np.float32).reshape(2, 3) / 4,
    "lambda": np.array([[0.1], [2.5], [-3.0]]),
    "counts": np.arange(24, dtype=np.uint16).reshape(2, 3, 4),
    "whole": np.arange(512, dtype=np.float64).reshape(2, 256) % 7,
    "signs": np.array([[-1, 1]], np.int8),
}
others = {"cell": np.array(["a", 1.0], object), "info": {"k": 1.0}, "title": "words", "turns": np.array([1 + 2j])}
scipy.io.savemat(HERE / "compressed.mat", arrays | others, do_compression=True)
scipy.io.savemat(HERE / "plain.mat", arrays)
