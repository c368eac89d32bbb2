//! What can be given as a truth, with an example of each, for `docs/formats.md`.

use crate::exchange::{Entry, Example};

/// The programs that take any of them.
const ALL: &str = "`bench evaluate`, `bench validate`, `sue evaluate`, `sue calibrate`";

/// Every way to say which references are correct.
///
/// The examples are about three queries and four references, of which query 0 has references 0 and
/// 1, query 1 has reference 2, and query 2 has none: it is at a new place.
pub const FORMATS: &[Entry] = &[
    Entry {
        name: "vpr-bench",
        about: "VPR-Bench's `ground_truth_new.npy`: objects, rows of a query and a list of its \
                references; `[-1]` for a new place. `--ground-truth`.",
        example: Example::Python("np.array([[0, [0, 1]], [1, [2]], [2, [-1]]], dtype=object)"),
        taken_by: ALL,
        refused: "A query without a row, or with two; another number of queries than there are.",
    },
    Entry {
        name: "lists",
        about: "A list of references per query: objects or arrays of different lengths, as \
                gsv-cities and OpenVPRLab have them (Nordland, CrossSeason, MSLS, Pittsburgh). `.npy`, \
                `.pkl`. `--ground-truth`.",
        example: Example::Python(
            "np.array([np.array([0, 1]), np.array([2]), np.array([])], dtype=object)",
        ),
        taken_by: ALL,
        refused: "Another number of lists than queries.",
    },
    Entry {
        name: "integers",
        about: "Whole numbers, a row per query, filled up with −1; one column for one reference each, \
                as gsv-cities has them (SPED, ESSEX3IN1). `.npy`. `--ground-truth`.",
        example: Example::Python("np.array([[0, 1], [2, -1], [-1, -1]])"),
        taken_by: ALL,
        refused: "Two columns that could be pairs as well, without `--truth-form`; −1 before a \
                  reference.",
    },
    Entry {
        name: "matrix",
        about: "Truth values or zeros and ones, queries × references or the transpose, told apart by \
                shape. How a square one is read is said; `--truth-rows` decides. `.npy`. \
                `--ground-truth`.",
        example: Example::Python(
            "np.array([[1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 0]], dtype=bool)",
        ),
        taken_by: ALL,
        refused: "Another shape; zeros and ones that could be a list per query as well, without \
                  `--truth-form`.",
    },
    Entry {
        name: "archive",
        about: "An `.npz` of which one array is any of these, such as `GThard` and `GTsoft` of \
                VPR_Tutorial (references × queries), chosen by `--truth-key`. A dictionary of arrays \
                in a pickle likewise. `--ground-truth`.",
        example: Example::Python("np.savez(\"GT.npz\", GThard=hard, GTsoft=soft)"),
        taken_by: ALL,
        refused: "Several arrays that could be the truth, without `--truth-key`.",
    },
    Entry {
        name: "positions",
        about: "An `.npz` with `utmQ` and `utmDb`, n × 2 or n × 3 metres or the transpose: correct \
                within `--positive-dist-threshold`. `--ground-truth`.",
        example: Example::Python("np.savez(\"utm.npz\", utmQ=queries, utmDb=references)"),
        taken_by: ALL,
        refused: "Positions that are not finite.",
    },
    Entry {
        name: "pairs",
        about: "A table with columns `query` and `reference` (`q`, `query_idx`, `ref`, `database`, `db` \
                …), by index or name; several references may stand in one cell. Names may leave out \
                folders and extensions. Queries in no pair are new places, which is said. `.csv`, \
                `.tsv`, `.txt`. `--ground-truth`.",
        example: Example::Text { path: "pairs.csv", text: "query,reference\n0,0\n0,1\n1,2\n" },
        taken_by: ALL,
        refused: "Names that no image has, or several.",
    },
    Entry {
        name: "pairs without titles",
        about: "Two columns, or a query and its references by name. `.txt`, `.csv`. `--ground-truth`.",
        example: Example::Text { path: "pairs.txt", text: "0 0\n0 1\n1 2\n" },
        taken_by: ALL,
        refused: "Lines of several lengths that could be lists as well, without `--truth-form`.",
    },
    Entry {
        name: "a line per query",
        about: "The references of one query on each line; −1 for a new place. `.txt`, `.csv`. \
                `--ground-truth`.",
        example: Example::Text { path: "lists.txt", text: "0 1\n2\n-1\n" },
        taken_by: ALL,
        refused: "Another number of lines than queries.",
    },
    Entry {
        name: "a matrix as text",
        about: "Zeros and ones, queries × references or the transpose, also as `numpy.savetxt` writes \
                them. `.txt`, `.csv`. `--ground-truth`.",
        example: Example::Text { path: "matrix.txt", text: "1 1 0 0\n0 0 1 0\n0 0 0 0\n" },
        taken_by: ALL,
        refused: "As `matrix`.",
    },
    Entry {
        name: "JSON",
        about: "A list per query, rows as in `vpr-bench`, a matrix, or an object of queries with their \
                references. `.json`. `--ground-truth`.",
        example: Example::Text { path: "truth.json", text: "{\"0\": [0, 1], \"1\": [2]}\n" },
        taken_by: ALL,
        refused: "As lists, pairs and matrices.",
    },
    Entry {
        name: "labels",
        about: "Labelled places: a table with a column of names and one of labels (`label`, `class`, \
                `place`, `floor`, `room`, or `--label-column`); a reference is correct if its label is \
                that of the query. One table has both sides by name. `--labels`.",
        example: Example::Text {
            path: "labels.csv",
            text: "name,label\nqueries/0.jpg,hall\nqueries/1.jpg,stairs\nqueries/2.jpg,attic\n\
                   database/0.jpg,hall\ndatabase/1.jpg,hall\ndatabase/2.jpg,stairs\n\
                   database/3.jpg,cellar\n",
        },
        taken_by: ALL,
        refused: "An image without a label or with two; labels of which no two are the same.",
    },
    Entry {
        name: "labels in order",
        about: "A label per line, or a `.npy` of numbers, for each side. `--labels` for the \
                references, `--queries-labels` for the queries.",
        example: Example::Text {
            path: "references.txt",
            text: "label\nhall\nhall\nstairs\ncellar\n",
        },
        taken_by: ALL,
        refused: "Another number of labels than images.",
    },
    Entry {
        name: "folders",
        about: "Labelled places: one folder per place, directly below the folder of each side. \
                `--labels folders`.",
        example: Example::Text { path: "database/hall/0.jpg", text: "an image\n" },
        taken_by: ALL,
        refused: "Images in no folder of a place; one folder that holds all images.",
    },
    Entry {
        name: "same index",
        about: "Two traverses that are aligned frame by frame: correct if the indices differ by at \
                most N. `--same-index N`.",
        example: Example::Python("abs(query - reference) <= 2  # --same-index 2"),
        taken_by: ALL,
        refused: "Nothing.",
    },
];
