//! From what a file says to lists of references, for these queries and references.

use vpr_core::Result;

use super::{
    Form,
    content::{Content, Item, Said},
    grid,
    names::{Found, NameIndex},
    side::Side,
    task::{Lists, Task, note_unnamed},
};

/// The lists, and what a person should know.
pub(super) fn resolve(task: Task<'_>, mut said: Said) -> Result<(Lists, Vec<String>)> {
    let mut notes = std::mem::take(&mut said.notes);
    if let Content::Lists(rows) = &said.content {
        match task.reading.form {
            Some(Form::Pairs) => said.content = with_first_as_query(rows),
            Some(Form::Matrix) => return Err(task.err(said.whole(), "rows differ in length")),
            None if said.lines.is_some() && begin_with_their_number(rows, task.n_queries()) => {
                let reason = "could be pairs or lists: say which with `--truth-form`";
                return Err(task.err(said.whole(), reason));
            }
            _ => {}
        }
    }
    let lists = match &said.content {
        Content::Grid(grid) => grid::lists(task, &said, grid, &mut notes)?,
        Content::Lists(rows) => {
            task.check_rows(&said, rows.len())?;
            let references = Finder::new(&task.sides.references, "reference");
            let row = |(row, items): (usize, &Vec<Item>)| {
                references.list(items).map_err(|reason| task.err(said.place(row), reason))
            };
            rows.iter().enumerate().map(row).collect::<Result<_>>()?
        }
        Content::Pairs { rows, is_complete } => {
            if *is_complete {
                task.check_rows(&said, rows.len())?;
            }
            let lists = pairs(task, &said, rows, *is_complete)?;
            note_unnamed(task, &lists, &mut notes);
            lists.into_iter().map(|list| list.unwrap_or_else(|| vec![-1])).collect()
        }
    };
    Ok((lists, notes))
}

/// Rows whose first item is the query.
fn with_first_as_query(rows: &[Vec<Item>]) -> Content {
    let pair = |row: &Vec<Item>| {
        let (query, references) = row.split_first()?;
        Some((query.clone(), references.to_vec()))
    };
    Content::Pairs { rows: rows.iter().filter_map(pair).collect(), is_complete: false }
}

/// Whether every row begins with its own number and goes on: a query, or its first reference?
fn begin_with_their_number(rows: &[Vec<Item>], n_queries: usize) -> bool {
    rows.len() == n_queries
        && rows
            .iter()
            .zip(0..)
            .all(|(row, number)| row.len() > 1 && row.first() == Some(&Item::Index(number)))
}

/// The references of queries that have a row.
fn pairs(
    task: Task<'_>,
    said: &Said,
    rows: &[(Item, Vec<Item>)],
    is_complete: bool,
) -> Result<Vec<Option<Vec<i64>>>> {
    let queries = Finder::new(&task.sides.queries, "query");
    let references = Finder::new(&task.sides.references, "reference");
    let mut lists: Vec<Option<Vec<i64>>> = vec![None; task.n_queries()];
    for (row, (query, items)) in rows.iter().enumerate() {
        let err = |reason: String| task.err(said.place(row), reason);
        let query = queries.one(query).map_err(err)?;
        let slot = usize::try_from(query).ok().and_then(|query| lists.get_mut(query));
        let n_queries = task.n_queries();
        let slot = slot.ok_or_else(|| err(format!("query {query}: there are {n_queries}")))?;
        if is_complete && slot.is_some() {
            return Err(err(format!("query {query} has a row already")));
        }
        let list = references.list(items).map_err(err)?;
        let known = slot.get_or_insert_default();
        known.extend(list.into_iter().filter(|&index| is_complete || index != -1));
    }
    for list in lists.iter_mut().flatten().filter(|list| list.is_empty() && !is_complete) {
        list.push(-1);
    }
    Ok(lists)
}

/// Finds the images of one side by index or name.
struct Finder {
    names: Option<NameIndex>,
    what: &'static str,
}

impl Finder {
    fn new(side: &Side, what: &'static str) -> Self {
        Self { names: side.names.as_deref().map(NameIndex::new), what }
    }

    fn one(&self, item: &Item) -> Result<i64, String> {
        let what = self.what;
        let name = match item {
            Item::Index(index) => return Ok(*index),
            Item::Name(name) => name,
        };
        let short = vpr_files::shorten(name);
        let Some(names) = &self.names else {
            return Err(format!("{what} `{short}` is a name, but the images at hand have none"));
        };
        match names.find(name) {
            Found::Whole(index) | Found::End(index) => {
                i64::try_from(index).map_err(|err| err.to_string())
            }
            Found::Several => Err(format!("{what} `{short}`: several images are called so")),
            Found::None => Err(format!("{what} `{short}` is none of the images")),
        }
    }

    fn list(&self, items: &[Item]) -> Result<Vec<i64>, String> {
        items.iter().map(|item| self.one(item)).collect()
    }
}
