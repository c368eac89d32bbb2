//! Archives and dictionaries with several arrays: which of them is the truth.

use vpr_core::{Error, Result};
use vpr_files::{npy::npz, pickle::Value};

use super::{
    content::Said,
    positions,
    resolve::resolve,
    task::{Lists, Task},
    value,
};

/// Lists with what a person should know.
type Read = (Lists, Vec<String>);

/// The truth in an `.npz`.
pub(super) fn read(task: Task<'_>) -> Result<Read> {
    let names = npz::names(task.path)?;
    let array = |name: &str| npz::read_value(task.path, name).map_err(Error::from);
    let pair = positions::arrays(&names);
    let both = |pair: [&str; 2]| positions::lists(task, pair, [array(pair[0])?, array(pair[1])?]);
    if let Some(key) = task.reading.key.as_deref() {
        return match pair {
            Some(pair) if pair.contains(&key) => both(pair),
            _ => of_array(task, key, array(key)?),
        };
    }
    let others = names.iter().filter(|name| pair.is_none_or(|pair| !pair.contains(&name.as_str())));
    let mut tried: Vec<(String, Result<Read>)> = others
        .map(|name| (name.clone(), array(name).and_then(|value| of_array(task, name, value))))
        .collect();
    if let Some(pair) = pair {
        tried.push((pair[0].to_owned(), both(pair)));
    }
    choose(task, tried)
}

/// The truth in a dictionary of arrays, under a key.
pub(super) fn entry(task: Task<'_>, entries: Vec<(Value, Value)>, key: &str) -> Result<Read> {
    let names: Vec<String> =
        entries.iter().filter_map(|entry| entry.0.as_text()).map(str::to_owned).collect();
    let found = entries.into_iter().find(|entry| entry.0.as_text() == Some(key));
    let (_, found) = found.ok_or_else(|| {
        let known = vpr_files::shorten(&names.join(", "));
        task.err(
            format!("entry `{}`", vpr_files::shorten(key)),
            format!("is not there; known: {known}"),
        )
    })?;
    of_array(task, key, found)
}

fn of_array(task: Task<'_>, name: &str, value: Value) -> Result<Read> {
    let name = vpr_files::shorten(name);
    let content =
        value::content_of(value).map_err(|reason| task.err(format!("array `{name}`"), reason))?;
    resolve(task, Said { array: Some(name), ..Said::of(content) })
}

/// The only array that is a truth for these images.
fn choose(task: Task<'_>, tried: Vec<(String, Result<Read>)>) -> Result<Read> {
    let names = |of: &dyn Fn(&Result<Read>) -> bool| {
        let names = tried.iter().filter(|entry| of(&entry.1)).map(|entry| entry.0.as_str());
        vpr_files::shorten(&names.collect::<Vec<_>>().join(", "))
    };
    let n_truths = tried.iter().filter(|entry| entry.1.is_ok()).count();
    if n_truths > 1 {
        let reason = format!(
            "several could be the truth: {}; choose one with `--truth-key`",
            names(&Result::is_ok)
        );
        return Err(task.err("arrays", reason));
    }
    let others = names(&Result::is_err);
    let n_tried = tried.len();
    let mut first_problem = None;
    for (_, read) in tried {
        match read {
            Ok((lists, mut notes)) => {
                if !others.is_empty() {
                    notes.push(format!("other arrays are not looked at: {others}"));
                }
                return Ok((lists, notes));
            }
            Err(problem) => first_problem = first_problem.or(Some(problem)),
        }
    }
    match first_problem {
        Some(problem) if n_tried == 1 => Err(problem),
        _ => {
            let (n_queries, n_references) = (task.n_queries(), task.n_references());
            let reason = format!(
                "none is a truth for {n_queries} queries and {n_references} references: {others}; \
                 `--truth-key` says why one is not"
            );
            Err(task.err("arrays", reason))
        }
    }
}
