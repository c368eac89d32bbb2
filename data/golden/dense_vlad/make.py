"""Writes `io.safetensors`: dense RootSIFT, VLAD, k-means and PCA as NumPy, SciPy and scikit-learn compute them.

    pip install numpy scipy scikit-learn safetensors
    python make.py

Dense SIFT is written from VLFeat's description of `vl_phow` and the fast variant of `vl_dsift`, in
double precision, bin by bin and with `scipy.ndimage`, not after the code that it tests.
"""

import pathlib

import numpy as np
from safetensors.numpy import save_file
from scipy import ndimage
from sklearn.cluster import KMeans
from sklearn.decomposition import PCA

HERE = pathlib.Path(__file__).parent
BINS, STEP, MAGNIFICATION, WINDOW, CONTRAST = [4, 6, 8, 10], 2, 6.0, 1.5, 0.005


def gaussian(image, sigma):
    x = np.arange(-np.ceil(4 * sigma), np.ceil(4 * sigma) + 1)
    kernel = np.exp(-0.5 * (x / sigma) ** 2)
    kernel /= kernel.sum()
    return ndimage.correlate1d(ndimage.correlate1d(image, kernel, 0, mode="nearest"), kernel, 1, mode="nearest")


def scale(image, size):
    blurred = gaussian(image / 255.0, size / MAGNIFICATION)
    dy, dx = np.gradient(blurred)
    angle = np.mod(np.arctan2(dy, dx), 2 * np.pi) * 8 / (2 * np.pi)
    length = np.hypot(dx, dy)
    triangle = (size - np.abs(np.arange(-size + 1, size))) / size**2
    maps = []
    for orientation in range(8):
        off = np.abs((angle - orientation + 4) % 8 - 4)
        votes = length * np.clip(1 - off, 0, None)
        spread = ndimage.correlate1d(votes, triangle, 0, mode="nearest")
        maps.append(ndimage.correlate1d(spread, triangle, 1, mode="nearest"))
    maps = np.stack(maps, -1)
    x = np.arange(-size + 1, size)
    weights = [size * np.exp(-0.5 * ((x - size * (at - 1.5)) / (size * WINDOW)) ** 2).mean() for at in range(4)]
    first = int(np.floor(1.5 * (max(BINS) - size)))
    rows = range(first, image.shape[0] - 3 * size, STEP)
    columns = range(first, image.shape[1] - 3 * size, STEP)
    out = []
    for top in rows:
        for left in columns:
            d = np.zeros((4, 4, 8))
            for by in range(4):
                for bx in range(4):
                    d[by, bx] = weights[by] * weights[bx] * maps[top + by * size, left + bx * size]
            d = d.ravel()
            if d.sum() / (3 * size + 1) ** 2 < CONTRAST:
                out.append(np.zeros(128))
                continue
            d = np.minimum(d / np.linalg.norm(d), 0.2)
            out.append(np.sqrt(d / d.sum()))
    return np.array(out)


random = np.random.default_rng(7)
y, x = np.mgrid[0:46, 0:52]
image = 120 + 60 * np.sin(x / 5.0 + y / 9.0) + 40 * np.cos(y / 3.0 - x / 13.0) + random.normal(0, 9, x.shape)
image[30:, :14] = 90  # without any contrast
image = np.clip(image, 0, 255).astype(np.uint8)
sift = {f"sift.{size}": scale(image.astype(np.float64), size) for size in BINS}

words = random.choice(np.concatenate(list(sift.values())), 6, replace=False)
residuals = np.zeros((6, 128))
for features in sift.values():
    nearest = ((features[:, None] - words[None]) ** 2).sum(-1).argmin(1)
    for feature, word in zip(features, nearest):
        residuals[word] += feature - words[word]
norms = np.linalg.norm(residuals, axis=1, keepdims=True)
residuals = residuals / np.where(norms > 0, norms, 1)
vlad = residuals.ravel() / np.linalg.norm(residuals)

blobs = np.concatenate([random.normal(c, 0.3, (40, 5)) for c in random.uniform(-6, 6, (4, 5))]).astype(np.float32)
centres = KMeans(4, n_init=10, random_state=0).fit(blobs).cluster_centers_

vlads = random.normal(size=(30, 12)) @ random.normal(size=(12, 12))
vlads = (vlads / np.linalg.norm(vlads, axis=1, keepdims=True)).astype(np.float32)
white = PCA(5, whiten=True).fit(vlads.astype(np.float64)).transform(vlads.astype(np.float64))
white /= np.linalg.norm(white, axis=1, keepdims=True)

arrays = {"image": image, "words": words, "vlad": vlad, "blobs": blobs, "centres": centres, "vlads": vlads, "white": white}
arrays |= sift
# Half of the rows of the finer scales: the file stays small.
arrays["sift.4"] = arrays["sift.4"][::4]
arrays["sift.6"] = arrays["sift.6"][::2]
save_file({k: np.ascontiguousarray(v if v.dtype == np.uint8 else v.astype(np.float32)) for k, v in arrays.items()}, HERE / "io.safetensors")
print({k: v.shape for k, v in arrays.items()})
