"""Writes pickles/protocol-N.pkl, one object in every protocol, and arrays.npz. Usage: pickles.py (needs NumPy 2)"""
import pickle
from pathlib import Path

import numpy as np

objects = np.empty((2, 2), dtype=object)
objects[0, 0], objects[0, 1] = 0, [0, 1]
objects[1, 0], objects[1, 1] = 1, [-1]
content = {
    "c": np.arange(6, dtype="<f8").reshape(2, 3),
    "fortran": np.asfortranarray(np.arange(6, dtype="<f4").reshape(2, 3)),
    "big": np.array([1, -2, 3], dtype=">i4"),
    "flags": np.array([True, False]),
    "objects": objects,
    "scalar": np.float64(0.1),
    "count": np.int64(-7),
    "plain": [None, True, False, 1, 70000, -(2**40), 1.5, "é€\n\\", b"\x00\xff\n", (), (1,), (1, 2, 3)],
    "empty": [[], {}, b"", ""],
}
folder = Path(__file__).resolve().parent / "pickles"
folder.mkdir(exist_ok=True)
for protocol in range(6):
    (folder / f"protocol-{protocol}.pkl").write_bytes(pickle.dumps(content, protocol=protocol))
np.savez_compressed(folder.parent / "arrays.npz",
                    descriptors=np.arange(6, dtype=np.float32).reshape(2, 3),
                    frames=np.arange(8, dtype=np.uint8).reshape(2, 2, 2))
