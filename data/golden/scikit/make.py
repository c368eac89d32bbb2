"""Writes estimators of scikit-learn as AP-GeM's checkpoint and Region-VLAD's vocabulary hold them, and their arrays.

    pip install numpy scikit-learn safetensors torch
    python make.py

`ap-gem.pt` and `legacy.pt` have the entries of `Resnet-101-AP-GeM.pt`: weights, settings, and a dictionary of PCAs. The
`vocabulary-*.pkl` have the nesting of `Vocabulary_400_Protocol2.pkl`; `vocabulary-0.pkl` and `ap-gem.pt` name
classes by the modules that scikit-learn had before 0.22, as the official files do.
"""

import pathlib
import pickle
import sys
import types
from collections import OrderedDict

import numpy as np
import torch
from safetensors.numpy import save_file
from sklearn.cluster import KMeans
from sklearn.decomposition import PCA

HERE = pathlib.Path(__file__).parent


def named(module, kind):
    """The class under another module, as pickle writes it."""
    parts = types.ModuleType(module)
    setattr(parts, kind.__name__, kind)
    sys.modules[module] = parts
    kind.__module__ = module


random = np.random.default_rng(20)
pca = PCA(n_components=3).fit(random.normal(size=(40, 5)))
kmeans = KMeans(n_clusters=4, n_init=1, random_state=0).fit(random.normal(size=(60, 6)))
arrays = {
    "mean": pca.mean_,
    "components": pca.components_,
    "explained_variance": pca.explained_variance_,
    "cluster_centers": kmeans.cluster_centers_,
}
save_file({key: np.ascontiguousarray(value, np.float32) for key, value in arrays.items()}, HERE / "arrays.safetensors")

state = OrderedDict({"module.conv1.weight": torch.arange(6.0).reshape(2, 3), "module.adpool.p": torch.tensor([3.0])})
checkpoint = {"iter": 376, "arch": "resnet101_rmac", "state_dict": state, "pca": {"Landmarks_clean": pca}}
vocabulary = {400: {256: {"conv3": kmeans}}}
torch.save(checkpoint, HERE / "legacy.pt", _use_new_zipfile_serialization=False)
for protocol in [2, 4]:
    with open(HERE / f"vocabulary-{protocol}.pkl", "wb") as file:
        pickle.dump(vocabulary, file, protocol)
named("sklearn.decomposition.pca", PCA)
named("sklearn.cluster.k_means_", KMeans)
torch.save(checkpoint, HERE / "ap-gem.pt")
with open(HERE / "vocabulary-0.pkl", "wb") as file:
    pickle.dump(vocabulary, file, 0)
