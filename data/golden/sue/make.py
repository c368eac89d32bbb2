"""Golden numbers of chapter 5: SUE by NumPy after the formulas of the released script, and linear
SVMs by scikit-learn. Run in this folder: python make.py (NumPy 2, scikit-learn 1.9)."""

import json
import math

import numpy as np
from sklearn.linear_model import SGDClassifier
from sklearn.preprocessing import MinMaxScaler

rng = np.random.default_rng(7)


def released(distances, positions, slope, clip):
    """The uncertainty of one query: squared distances ascending, positions (k, 2)."""
    weights = np.array([math.e ** (-abs(d) * slope) for d in distances])
    with np.errstate(all="ignore"):
        weights = weights / np.abs(weights).sum()
        if not np.isfinite(weights).all():
            return None
    mean = np.array([np.average(positions[:, axis], weights=weights) for axis in (0, 1)])
    total = 0.0
    for axis in (0, 1):
        for weight, coordinate in zip(weights, positions[:, axis]):
            total += weight * min(clip, coordinate - mean[axis]) ** 2
    return total / 2


def sue_cases():
    cases = []
    for i in range(60):
        k = int(rng.integers(1, 13))
        scale = 10.0 ** rng.uniform(-1, 1.5) if i % 6 == 0 else 10.0 ** rng.uniform(-3, 0)
        distances = np.sort(np.float32(scale * rng.uniform(0.1, 1.0, k)))
        if i % 4 == 0:
            distances[: k // 2 + 1] = distances[0]
            distances = np.sort(distances)
        spread = 10.0 ** rng.uniform(-1, 5)
        positions = np.round(rng.normal(0, spread, (k, 2)), 3)
        if i % 5 == 0:
            positions += [500_000.0, 4_200_000.0]
        if i % 7 == 0:
            positions[:] = positions[0]
        slope = 350.0 if i % 6 == 0 else float(rng.choice([0.5, 10.0, 350.0]))
        squared = [float(d) * float(d) for d in distances]
        cases.append({
            "distances": [float(d) for d in distances],
            "positions": positions.tolist(),
            "lambda": slope,
            "clip": 500.0,
            "expected": released(squared, positions, slope, 500.0),
        })
    return cases


def svm_cases():
    cases = []
    for i, (n, overlap) in enumerate([(200, 0.6), (300, 1.2), (150, 1.0), (400, 2.0)]):
        def draw():
            labels = rng.random(n) < [0.5, 0.7, 0.3, 0.85][i]
            spatial = np.where(labels, 0.0, 3.0) + overlap * rng.normal(size=n)
            inliers = np.where(labels, 60.0, 15.0) + 20 * overlap * rng.normal(size=n)
            return np.round(np.stack([np.exp(spatial), inliers], 1), 3), labels

        (train, train_labels), (test, test_labels) = draw(), draw()
        scaler = MinMaxScaler().fit(train)
        accuracy = {}
        for name, tolerance in (("stopped", 1e-3), ("full", None)):
            values = []
            for seed in range(400 if tolerance else 20):
                model = SGDClassifier(loss="hinge", penalty="l1", max_iter=1000, tol=tolerance, random_state=seed)
                model.fit(scaler.transform(train), train_labels)
                values.append([model.score(scaler.transform(x), y)
                               for x, y in ((train, train_labels), (test, test_labels))])
            accuracy[name] = np.mean(values, 0).tolist()
            print(n, name, np.mean(values, 0), np.std(values, 0))
        cases.append({
            "train": train.tolist(), "train_labels": train_labels.tolist(),
            "test": test.tolist(), "test_labels": test_labels.tolist(), "accuracy": accuracy,
        })
    return cases


def write(name, content):
    with open(name, "w") as file:
        json.dump(content, file, separators=(",", ":"))
        file.write("\n")


if __name__ == "__main__":
    write("sue.json", sue_cases())
    write("svm.json", svm_cases())
