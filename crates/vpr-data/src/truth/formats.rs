//! What can be given as a truth, with an example of each.

/// A way to say which references are correct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TruthFormat {
    /// What it is.
    pub name: &'static str,
    /// The flag that takes it, and kinds of files.
    pub given: &'static str,
    /// A file for three queries and four references, where it is text; else how it is made. Query 0
    /// has references 0 and 1, query 1 has reference 2, query 2 is at a new place.
    pub example: &'static str,
    /// The programs that take it.
    pub takers: &'static [&'static str],
}

const ALL: &[&str] = &["bench evaluate", "bench validate", "sue evaluate", "sue calibrate"];

/// All of them.
pub const FORMATS: &[TruthFormat] = &[
    TruthFormat {
        name: "VPR-Bench: rows of a query and its references",
        given: "--ground-truth ground_truth_new.npy",
        example: "np.array([[0, [0, 1]], [1, [2]], [2, [-1]]], dtype=object)",
        takers: ALL,
    },
    TruthFormat {
        name: "a list of references per query",
        given: "--ground-truth FILE.npy, .pkl (gsv-cities, OpenVPRLab)",
        example: "np.array([np.array([0, 1]), np.array([2]), np.array([])], dtype=object)",
        takers: ALL,
    },
    TruthFormat {
        name: "whole numbers, a row per query, filled up with -1",
        given: "--ground-truth FILE.npy (SPED, ESSEX3IN1 of gsv-cities)",
        example: "np.array([[0, 1], [2, -1], [-1, -1]])",
        takers: ALL,
    },
    TruthFormat {
        name: "a matrix of truth values, queries × references or the transpose",
        given: "--ground-truth FILE.npy; --truth-rows if it is square",
        example: "np.array([[1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 0]], dtype=bool)",
        takers: ALL,
    },
    TruthFormat {
        name: "an archive of several matrices (VPR_Tutorial)",
        given: "--ground-truth FILE.npz --truth-key GTsoft",
        example: "np.savez('GT.npz', GThard=hard, GTsoft=soft)",
        takers: ALL,
    },
    TruthFormat {
        name: "an archive of positions, correct within a radius",
        given: "--ground-truth FILE.npz --positive-dist-threshold 25",
        example: "np.savez('utm.npz', utmQ=queries, utmDb=references)",
        takers: ALL,
    },
    TruthFormat {
        name: "pairs under titles, by index or name",
        given: "--ground-truth FILE.csv",
        example: "query,reference\n0,0\n0,1\n1,2\n",
        takers: ALL,
    },
    TruthFormat {
        name: "pairs without titles",
        given: "--ground-truth FILE.txt",
        example: "0 0\n0 1\n1 2\n",
        takers: ALL,
    },
    TruthFormat {
        name: "a line per query",
        given: "--ground-truth FILE.txt",
        example: "0 1\n2\n-1\n",
        takers: ALL,
    },
    TruthFormat {
        name: "a matrix of zeros and ones as text",
        given: "--ground-truth FILE.txt",
        example: "1 1 0 0\n0 0 1 0\n0 0 0 0\n",
        takers: ALL,
    },
    TruthFormat {
        name: "lists or pairs as JSON",
        given: "--ground-truth FILE.json",
        example: "{\"0\": [0, 1], \"1\": [2]}\n",
        takers: ALL,
    },
    TruthFormat {
        name: "labelled places: one table for both sides, by name",
        given: "--labels FILE.csv; --label-column floor",
        example: "name,label\nqueries/0.jpg,hall\ndatabase/0.jpg,hall\n",
        takers: ALL,
    },
    TruthFormat {
        name: "labelled places: a file for each side, in order",
        given: "--labels REFERENCES.txt --queries-labels QUERIES.txt",
        example: "label\nhall\nhall\nstairs\n",
        takers: ALL,
    },
    TruthFormat {
        name: "labelled places: a folder per place",
        given: "--labels folders",
        example: "database/hall/0.jpg, queries/hall/7.jpg",
        takers: ALL,
    },
    TruthFormat {
        name: "the same index on both sides, give or take N",
        given: "--same-index 2",
        example: "--same-index 2",
        takers: ALL,
    },
];
