//! From decoded Python objects to what they say.

use vpr_files::pickle::{Elements, Value};

use super::content::{Content, Grid, Item};

/// What an object says; or why it says nothing about references.
pub(super) fn content_of(value: Value) -> Result<Content, String> {
    match value {
        Value::Array { shape, elements } => of_array(&shape, elements),
        Value::List(values) | Value::Tuple(values) => of_list(values),
        Value::Dict(entries) => {
            let row = |(query, references): (Value, Value)| {
                let query = scalar(&query).ok_or_else(|| format!("a key is {}", query.kind()))?;
                Ok((query, items(&references)?))
            };
            let rows = entries.into_iter().map(row).collect::<Result<_, String>>()?;
            Ok(Content::Pairs { rows, is_complete: false })
        }
        other => Err(format!("holds {}, neither lists nor a matrix", other.kind())),
    }
}

fn of_array(shape: &[usize], elements: Elements) -> Result<Content, String> {
    let (n_rows, n_columns) = match *shape {
        [] => match elements {
            Elements::Object(values) if values.len() == 1 => {
                return content_of(values.into_iter().next().unwrap_or(Value::None));
            }
            _ => return Err("holds a single value".to_owned()),
        },
        [n] => (n, 1),
        [n, columns] => (n, columns),
        _ => return Err(format!("has shape {shape:?}: a truth has one or two axes")),
    };
    let grid = |values: Vec<i64>, is_boolean| {
        Ok(Content::Grid(Grid { n_rows, n_columns, values, is_boolean }))
    };
    match elements {
        Elements::Bool(values) => grid(values.into_iter().map(i64::from).collect(), true),
        Elements::Object(values) => of_objects(n_rows, n_columns, values),
        Elements::Text(texts) => {
            let cells = texts.into_iter().map(Item::Name).collect();
            Ok(of_cells(n_rows, n_columns, cells))
        }
        Elements::Int(values) => grid(values, false),
        numbers => match numbers.to_i64s() {
            Some(values) => grid(values, false),
            None => Err("holds values that are no whole numbers".to_owned()),
        },
    }
}

fn of_objects(n_rows: usize, n_columns: usize, values: Vec<Value>) -> Result<Content, String> {
    if n_columns == 1 {
        let lists = values
            .iter()
            .enumerate()
            .map(|(row, value)| items(value).map_err(|reason| format!("row {row}: {reason}")));
        // A list of `[query, references]`, each an object of its own.
        if let Some(pairs) = vpr_bench(values.iter()) {
            return pairs;
        }
        return Ok(Content::Lists(lists.collect::<Result<_, _>>()?));
    }
    if n_columns == 2 && values.iter().skip(1).step_by(2).any(is_list) {
        let rows = values.chunks_exact(2).enumerate().map(|(row, pair)| {
            let err = |reason| format!("row {row}: {reason}");
            let (query, references) = row_of_vpr_bench(pair).map_err(err)?;
            Ok((Item::Index(i64::try_from(query).unwrap_or(i64::MAX)), references))
        });
        let rows = rows.collect::<Result<_, String>>()?;
        return Ok(Content::Pairs { rows, is_complete: true });
    }
    let cell = |(index, value): (usize, &Value)| {
        let row = index.checked_div(n_columns).unwrap_or_default();
        scalar(value).ok_or_else(|| format!("row {row}: holds {}, not an index", value.kind()))
    };
    let cells = values.iter().enumerate().map(cell).collect::<Result<Vec<_>, _>>()?;
    Ok(of_cells(n_rows, n_columns, cells))
}

/// Rows and columns of single items: numbers, or names of a query and its references.
fn of_cells(n_rows: usize, n_columns: usize, cells: Vec<Item>) -> Content {
    let index = |item: &Item| match item {
        Item::Index(index) => Some(*index),
        Item::Name(_) => None,
    };
    if let Some(values) = cells.iter().map(index).collect::<Option<Vec<_>>>() {
        return Content::Grid(Grid { n_rows, n_columns, values, is_boolean: false });
    }
    let mut rows = cells.chunks(n_columns.max(1)).map(<[Item]>::to_vec);
    if n_columns == 1 {
        return Content::Lists(rows.collect());
    }
    let pair = |mut row: Vec<Item>| {
        let references = row.split_off(1);
        Some((row.pop()?, references))
    };
    let rows = rows.by_ref().filter_map(pair).collect();
    Content::Pairs { rows, is_complete: false }
}

fn of_list(values: Vec<Value>) -> Result<Content, String> {
    if let Some(pairs) = vpr_bench(values.iter()) {
        return pairs;
    }
    if let Some(grid) = matrix(&values) {
        return Ok(Content::Grid(grid));
    }
    let lists = values
        .iter()
        .enumerate()
        .map(|(row, value)| items(value).map_err(|reason| format!("row {row}: {reason}")));
    Ok(Content::Lists(lists.collect::<Result<_, _>>()?))
}

/// Rows of VPR-Bench as lists of lists: `[[0, [1, 2]], [1, [4]]]`; `None` if they are none.
fn vpr_bench<'v>(
    values: impl ExactSizeIterator<Item = &'v Value> + Clone,
) -> Option<Result<Content, String>> {
    let parts = |value: &'v Value| match value {
        Value::List(parts) | Value::Tuple(parts) => Some(parts),
        Value::Array { shape, elements: Elements::Object(parts) } if shape.len() == 1 => {
            Some(parts)
        }
        _ => None,
    };
    let is_row = |value| parts(value).is_some_and(|it| it.len() == 2 && is_list(&it[1]));
    if values.len() == 0 || !values.clone().all(is_row) {
        return None;
    }
    let row = |(row, value): (usize, &'v Value)| {
        let pair = parts(value).map(Vec::as_slice).unwrap_or_default();
        let (query, references) =
            row_of_vpr_bench(pair).map_err(|reason| format!("row {row}: {reason}"))?;
        Ok((Item::Index(i64::try_from(query).unwrap_or(i64::MAX)), references))
    };
    let rows = values.enumerate().map(row).collect::<Result<_, String>>();
    Some(rows.map(|rows| Content::Pairs { rows, is_complete: true }))
}

/// Equally long rows of truth values, or of zeros and ones that repeat within a row: no lists.
fn matrix(values: &[Value]) -> Option<Grid> {
    let row = |value: &Value| match value {
        Value::List(cells) | Value::Tuple(cells) => {
            cells.iter().map(binary).collect::<Option<Vec<_>>>()
        }
        Value::Array { shape, elements: Elements::Bool(cells) } if shape.len() == 1 => {
            Some(cells.iter().map(|&cell| (i64::from(cell), true)).collect())
        }
        _ => None,
    };
    let rows = values.iter().map(row).collect::<Option<Vec<_>>>()?;
    let n_columns = rows.first()?.len();
    let is_boolean = rows.iter().flatten().all(|cell| cell.1);
    let repeats = n_columns > 2;
    if rows.iter().any(|row| row.len() != n_columns) || !(is_boolean || repeats) {
        return None;
    }
    let values = rows.iter().flatten().map(|cell| cell.0).collect();
    Some(Grid { n_rows: rows.len(), n_columns, values, is_boolean })
}

/// A zero, a one or a truth value, and whether it is the latter.
fn binary(value: &Value) -> Option<(i64, bool)> {
    match value {
        Value::Bool(value) => Some((i64::from(*value), true)),
        other => other.as_i64().filter(|value| matches!(value, 0 | 1)).map(|it| (it, false)),
    }
}

fn is_list(value: &Value) -> bool {
    match value {
        Value::List(_) | Value::Tuple(_) => true,
        Value::Array { shape, .. } => !shape.is_empty(),
        _ => false,
    }
}

/// The query and the references of one row of VPR-Bench.
pub(super) fn row_of_vpr_bench(pair: &[Value]) -> Result<(usize, Vec<Item>), String> {
    let [query, references] = pair else {
        return Err(format!("has {} parts, not a query and its references", pair.len()));
    };
    let index = query.as_i64().and_then(|query| usize::try_from(query).ok());
    let index = index.ok_or_else(|| format!("the query is {}, not an index", query.kind()))?;
    let wrong = || format!("the references are {}, not a list of integers", references.kind());
    if !is_list(references) {
        return Err(wrong());
    }
    Ok((index, items(references).map_err(|_| wrong())?))
}

/// A single index or name.
fn scalar(value: &Value) -> Option<Item> {
    if let Some(text) = value.as_text() {
        return Some(Item::Name(text.to_owned()));
    }
    if let Value::Array { shape, elements } = value {
        let values = elements.to_i64s().filter(|_| shape.is_empty())?;
        return values.first().map(|&index| Item::Index(index));
    }
    value.as_i64().map(Item::Index)
}

/// The references of one query: a list of indices or names, a single one, or nothing.
fn items(value: &Value) -> Result<Vec<Item>, String> {
    let each = |values: &[Value]| {
        let one = |value| scalar(value).ok_or_else(|| format!("holds {}", Value::kind(value)));
        values.iter().map(one).collect::<Result<Vec<_>, _>>()
    };
    match value {
        Value::None => Ok(Vec::new()),
        Value::List(values) | Value::Tuple(values) => each(values),
        // A vector, perhaps as a row or a column.
        Value::Array { shape, elements }
            if !shape.is_empty() && shape.iter().filter(|&&len| len != 1).count() <= 1 =>
        {
            match elements {
                Elements::Object(values) => each(values),
                numbers => numbers
                    .to_i64s()
                    .map(|values| values.into_iter().map(Item::Index).collect())
                    .ok_or_else(|| "holds values that are no whole numbers".to_owned()),
            }
        }
        single => match scalar(single) {
            Some(item) => Ok(vec![item]),
            None => Err(format!("holds {}, not references", single.kind())),
        },
    }
}
