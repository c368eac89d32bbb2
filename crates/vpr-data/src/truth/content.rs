//! What a file of truths says, before it is known what about.

/// A query or a reference as a file has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Item {
    /// Its place among the images, from 0; −1 where there is none.
    Index(i64),
    /// The name of its image.
    Name(String),
}

/// The shapes in which truths are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// Whole numbers in rows and columns: lists of equal length, pairs, or a matrix.
    Grid(Grid),
    /// The references of every query, in the order of the queries.
    Lists(Vec<Vec<Item>>),
    /// Queries with references.
    Pairs {
        /// A query may have several rows.
        rows: Vec<(Item, Vec<Item>)>,
        /// Whether every query has exactly one.
        is_complete: bool,
    },
}

/// Whole numbers in rows and columns.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Grid {
    pub(super) n_rows: usize,
    pub(super) n_columns: usize,
    /// Row after row.
    pub(super) values: Vec<i64>,
    /// Whether they are truth values.
    pub(super) is_boolean: bool,
}

impl Grid {
    /// The numbers of one row.
    pub(super) fn row(&self, row: usize) -> &[i64] {
        &self.values[row * self.n_columns..][..self.n_columns]
    }

    /// All rows in order.
    pub(super) fn rows(&self) -> impl Iterator<Item = &[i64]> {
        (0..self.n_rows).map(|row| self.row(row))
    }

    /// Whether all numbers are 0 or 1.
    pub(super) fn is_binary(&self) -> bool {
        self.values.iter().all(|value| matches!(value, 0 | 1))
    }
}

/// What was read of a file, and where in it.
#[derive(Clone, Debug)]
pub(super) struct Said {
    pub(super) content: Content,
    /// The array of an archive, the entry of a dictionary.
    pub(super) array: Option<String>,
    /// The line of every row, in text.
    pub(super) lines: Option<Vec<usize>>,
    /// What a person should know.
    pub(super) notes: Vec<String>,
}

impl Said {
    /// What has no lines and no name.
    pub(super) fn of(content: Content) -> Self {
        Self { content, array: None, lines: None, notes: Vec::new() }
    }

    /// Where a row stands, for messages.
    pub(super) fn place(&self, row: usize) -> String {
        match (&self.lines, &self.array) {
            (Some(lines), _) => format!("line {}", lines.get(row).copied().unwrap_or(row + 1)),
            (None, Some(array)) => format!("array `{array}`, row {row}"),
            (None, None) => format!("row {row}"),
        }
    }

    /// Where all of it stands.
    pub(super) fn whole(&self) -> String {
        self.array.as_ref().map_or("content".to_owned(), |array| format!("array `{array}`"))
    }
}
