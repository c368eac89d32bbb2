"""Writes published_files.csv: what NumPy reads in VPR-Bench's own files. Usage: published_files.py DATA"""
import glob, pickle, sys
import numpy as np

root = sys.argv[1].rstrip("/") + "/"
print("file,n_queries,n_columns,n_listed,sum,encode_s,match_s")
for path in sorted(glob.glob(root + "vpr-bench/**/*.npy", recursive=True)):
    parts = np.load(path, allow_pickle=True, encoding="latin1")
    name = path[len(root):]
    if parts.shape == (6,):
        scores = np.asarray(parts[3], dtype=np.float64)
        retrieved = int(np.sum(parts[1].astype(np.int64)))
        print(f"{name},{scores.shape[0]},{scores.shape[1]},{retrieved},{float(scores.sum())!r},"
              f"{float(parts[4])!r},{float(parts[5])!r}")
    else:
        lists = [list(references) for references in parts[:, 1]]
        print(f"{name},{len(lists)},,{sum(map(len, lists))},{sum(map(sum, lists))},,")
for path in sorted(glob.glob(root + "vpr-bench/**/*.pkl", recursive=True)):
    with open(path, "rb") as file:
        entries = pickle.load(file, encoding="latin1")
    values = [np.atleast_1d(value) for value in entries.values()]
    print(f"{path[len(root):]},{len(entries)},{len(values[0])},,{float(sum(v.sum() for v in values))!r},,")
