//! Rows and columns of numbers: a list per query, pairs, or a matrix of truth values.

use std::collections::{BTreeSet, HashSet};

use vpr_core::Result;

use super::{
    Form, Rows,
    content::{Grid, Said},
    task::{Lists, Task, note_unnamed},
};

/// Keys whose matrices have the references as rows, in the tutorial that they come from.
const TRANSPOSED_KEYS: [&str; 2] = ["GThard", "GTsoft"];

/// The lists of a grid in the form that was asked for, or the only one that it can have.
pub(super) fn lists(
    task: Task<'_>,
    said: &Said,
    grid: &Grid,
    notes: &mut Vec<String>,
) -> Result<Lists> {
    let asked = if grid.is_boolean { Some(Form::Matrix) } else { task.reading.form };
    if let Some(form) = asked {
        return in_form(form, task, said, grid, notes);
    }
    let forms = possible(task, said, grid);
    let mut readings = Vec::new();
    for form in &forms {
        let mut said_here = Vec::new();
        let lists = in_form(*form, task, said, grid, &mut said_here)?;
        readings.push((*form, lists, said_here));
    }
    let alike = readings.windows(2).all(|pair| normal(&pair[0].1) == normal(&pair[1].1));
    let is_text = said.lines.is_some();
    let is_usual = is_text && forms == [Form::Pairs, Form::Lists];
    if !(alike || is_usual) {
        let forms: Vec<_> = forms.iter().map(|form| form.name()).collect();
        let reason = format!("could be {}: say which with `--truth-form`", forms.join(" or "));
        return Err(task.err(said.whole(), reason));
    }
    match readings.into_iter().next() {
        Some((_, lists, said_here)) => {
            notes.extend(said_here);
            if !alike {
                notes.push(
                    "read as pairs of query and reference; `--truth-form lists` if a line has the \
                     references of one query"
                        .to_owned(),
                );
            }
            Ok(lists)
        }
        // As many rows as queries, but not all are lists: which is not, says reading them.
        None if grid.n_rows == task.n_queries() && !grid.is_binary() => {
            in_form(Form::Lists, task, said, grid, notes)
        }
        None => Err(no_form(task, said, grid)),
    }
}

/// The forms that the numbers can have, the likeliest first.
fn possible(task: Task<'_>, said: &Said, grid: &Grid) -> Vec<Form> {
    let (n_queries, is_text) = (task.n_queries(), said.lines.is_some());
    let is_matrix = grid.is_binary() && orientation(task, grid).is_some();
    let is_lists = grid.n_rows == n_queries && grid.rows().all(is_list);
    let is_query = |&query: &i64| usize::try_from(query).is_ok_and(|query| query < n_queries);
    let in_order = || grid.rows().zip(0..).all(|(row, query)| row.first() == Some(&query));
    // Rows that are not as many as queries are pairs only in text, where that is the usual form:
    // an array may be a list per query that lacks its end.
    let is_pairs = grid.n_columns == 2
        && grid.rows().all(|row| row.first().is_some_and(is_query) && row[1] >= -1)
        && (is_text || (grid.n_rows == n_queries && (in_order() || !is_lists)));
    let forms = [(is_matrix, Form::Matrix), (is_pairs, Form::Pairs), (is_lists, Form::Lists)];
    forms.into_iter().filter_map(|(is, form)| is.then_some(form)).collect()
}

/// Whether numbers can be the references of one query: none twice, −1 at the end only.
fn is_list(row: &[i64]) -> bool {
    let references = unpadded(row);
    let mut seen = HashSet::new();
    references.iter().all(|&index| index >= 0 && seen.insert(index))
}

/// A row without the −1 that make it as long as the others.
fn unpadded(row: &[i64]) -> &[i64] {
    let end = row.iter().rposition(|&index| index != -1).map_or(0, |last| last + 1);
    &row[..end]
}

fn in_form(
    form: Form,
    task: Task<'_>,
    said: &Said,
    grid: &Grid,
    notes: &mut Vec<String>,
) -> Result<Lists> {
    match form {
        Form::Lists => {
            task.check_rows(said, grid.n_rows)?;
            grid.rows().enumerate().map(|(row, list)| references(task, said, row, list)).collect()
        }
        Form::Pairs => pairs(task, said, grid, notes),
        Form::Matrix => matrix(task, said, grid, notes),
    }
}

/// The references of one row, `[-1]` if there are none.
fn references(task: Task<'_>, said: &Said, row: usize, list: &[i64]) -> Result<Vec<i64>> {
    let list = unpadded(list);
    if let Some(index) = list.iter().find(|&&index| index < 0) {
        let reason =
            format!("{index} is not a reference; -1 fills up a row at its end, or is a new place");
        return Err(task.err(said.place(row), reason));
    }
    Ok(if list.is_empty() { vec![-1] } else { list.to_vec() })
}

fn pairs(task: Task<'_>, said: &Said, grid: &Grid, notes: &mut Vec<String>) -> Result<Lists> {
    if grid.n_columns < 2 {
        return Err(task.err(said.whole(), "has one column: pairs are a query and a reference"));
    }
    let mut lists: Vec<Option<Vec<i64>>> = vec![None; task.n_queries()];
    for (row, numbers) in grid.rows().enumerate() {
        let slot = usize::try_from(numbers[0]).ok().and_then(|query| lists.get_mut(query));
        let slot = slot.ok_or_else(|| {
            let (query, n) = (numbers[0], task.n_queries());
            task.err(said.place(row), format!("query {query}: there are {n}"))
        })?;
        let more = references(task, said, row, &numbers[1..])?;
        slot.get_or_insert_default().extend(more.into_iter().filter(|&index| index != -1));
    }
    note_unnamed(task, &lists, notes);
    let list = |list: Option<Vec<i64>>| match list {
        Some(list) if !list.is_empty() => list,
        _ => vec![-1],
    };
    Ok(lists.into_iter().map(list).collect())
}

/// Whether the rows are queries, references, or could be either.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Orientation {
    Known(Rows),
    Either,
}

/// What the shape says; `None` if it is that of no matrix.
fn orientation(task: Task<'_>, grid: &Grid) -> Option<Orientation> {
    let shape = (grid.n_rows, grid.n_columns);
    let (n_queries, n_references) = (task.n_queries(), task.n_references());
    match (shape == (n_queries, n_references), shape == (n_references, n_queries)) {
        (true, true) => Some(Orientation::Either),
        (true, false) => Some(Orientation::Known(Rows::Queries)),
        (false, true) => Some(Orientation::Known(Rows::References)),
        (false, false) => None,
    }
}

fn matrix(task: Task<'_>, said: &Said, grid: &Grid, notes: &mut Vec<String>) -> Result<Lists> {
    if let Some(at) = grid.values.iter().position(|value| !matches!(value, 0 | 1)) {
        let (row, value) = (at / grid.n_columns.max(1), grid.values[at]);
        return Err(task.err(said.place(row), format!("{value} is no truth value: 0 or 1")));
    }
    let asked = task.reading.rows;
    let name = said.array.as_deref().unwrap_or_default();
    let rows = match orientation(task, grid) {
        None => return Err(no_form(task, said, grid)),
        Some(Orientation::Known(rows)) => {
            if asked.is_some_and(|asked| asked != rows) {
                let reason = format!("the rows are {}, as the shape says", rows.name());
                return Err(task.err(said.whole(), reason));
            }
            if rows == Rows::References {
                notes.push("the rows of the matrix are references, its columns queries".to_owned());
            }
            rows
        }
        Some(Orientation::Either) => asked.unwrap_or_else(|| {
            let (rows, other) = if TRANSPOSED_KEYS.contains(&name) {
                (Rows::References, Rows::Queries)
            } else {
                (Rows::Queries, Rows::References)
            };
            if !is_symmetric(grid) {
                notes.push(format!(
                    "the matrix is square: its rows are taken for {}; `--truth-rows {}` if they are \
                     not",
                    rows.name(),
                    other.name()
                ));
            }
            rows
        }),
    };
    let is_correct = |query: usize, reference: usize| match rows {
        Rows::Queries => grid.values[query * grid.n_columns + reference] == 1,
        Rows::References => grid.values[reference * grid.n_columns + query] == 1,
    };
    let list = |query: usize| {
        let all = (0..task.n_references()).zip(0_i64..);
        let list: Vec<i64> =
            all.filter(|it| is_correct(query, it.0)).map(|(_, index)| index).collect();
        if list.is_empty() { vec![-1] } else { list }
    };
    Ok((0..task.n_queries()).map(list).collect())
}

fn is_symmetric(grid: &Grid) -> bool {
    let n = grid.n_rows;
    (0..n).all(|row| (0..row).all(|at| grid.row(row)[at] == grid.values[at * n + row]))
}

/// Lists as sets: what they mean, in whatever order and with whatever padding.
fn normal(lists: &Lists) -> Vec<BTreeSet<i64>> {
    let set = |list: &Vec<i64>| list.iter().copied().filter(|&index| index != -1).collect();
    lists.iter().map(set).collect()
}

/// Why numbers of this shape are no truth for these images.
fn no_form(task: Task<'_>, said: &Said, grid: &Grid) -> vpr_core::Error {
    let (n_queries, n_references) = (task.n_queries(), task.n_references());
    let Grid { n_rows, n_columns, .. } = grid;
    let hint = match n_columns {
        2 if !grid.is_boolean => {
            "; if its rows are a query and a reference, say `--truth-form pairs`"
        }
        _ => "",
    };
    let reason = format!(
        "is {n_rows} × {n_columns}, but there are {n_queries} queries and {n_references} \
         references: neither a list per query nor a matrix{hint}"
    );
    task.err(said.whole(), reason)
}
