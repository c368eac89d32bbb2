//! Positions of both sides in one archive, as the datasets of Pittsburgh and Tokyo have them.

use nalgebra::{Point2, Point3};
use vpr_core::{GroundTruth, Poses, Result};
use vpr_files::pickle::Value;

use super::task::{Lists, Task};

/// Names of the arrays, lower case without `_`: positions of the queries.
const QUERIES: [&str; 6] = ["utmq", "qutm", "qutms", "utmqueries", "queriesutm", "queriesutms"];
/// Of the references.
const REFERENCES: [&str; 6] =
    ["utmdb", "dbutm", "dbutms", "utmdatabase", "databaseutm", "databaseutms"];

/// The two arrays of positions, if an archive has both.
pub(super) fn arrays(names: &[String]) -> Option<[&str; 2]> {
    let find = |known: &[&str]| {
        let is = |name: &&String| known.contains(&&*name.to_lowercase().replace('_', ""));
        names.iter().find(is).map(String::as_str)
    };
    Some([find(&QUERIES)?, find(&REFERENCES)?])
}

/// References within the radius; `[-1]` for a query that has none.
pub(super) fn lists(
    task: Task<'_>,
    names: [&str; 2],
    values: [Value; 2],
) -> Result<(Lists, Vec<String>)> {
    let counts = [task.n_queries(), task.n_references()];
    let [queries, references] = values;
    let queries = poses(task, names[0], queries, counts[0])?;
    let references = poses(task, names[1], references, counts[1])?;
    let radius = task.reading.radius;
    let truth = GroundTruth::within_radius(&queries, &references, radius)?;
    let list = |query: usize| match truth.correct(query) {
        [] => vec![-1],
        list => list.iter().map(|&it| i64::try_from(it).unwrap_or(i64::MAX)).collect(),
    };
    let note = format!("positions `{}` and `{}`, correct within {radius} m", names[0], names[1]);
    Ok(((0..truth.len()).map(list).collect(), vec![note]))
}

/// `n × 2` or `n × 3` metres, or the transpose.
fn poses(task: Task<'_>, name: &str, value: Value, n: usize) -> Result<Poses> {
    let err = |reason: String| task.err(format!("array `{name}`"), reason);
    let Value::Array { shape, elements } = value else {
        return Err(err("is no array of positions".to_owned()));
    };
    let values = elements.to_f64s().ok_or_else(|| err("holds no numbers".to_owned()))?;
    let (axes, is_transposed) = match *shape.as_slice() {
        [rows, axes @ (2 | 3)] if rows == n => (axes, false),
        [axes @ (2 | 3), columns] if columns == n => (axes, true),
        _ => return Err(err(format!("has shape {shape:?}, but there are {n} images"))),
    };
    let at = |image: usize, axis: usize| {
        values[if is_transposed { axis * n + image } else { image * axes + axis }]
    };
    let poses = if axes == 2 {
        Poses::Planar((0..n).map(|it| Point2::new(at(it, 0), at(it, 1))).collect())
    } else {
        Poses::Spatial((0..n).map(|it| Point3::new(at(it, 0), at(it, 1), at(it, 2))).collect())
    };
    poses.check_finite().map_err(|cause| err(cause.to_string()))?;
    Ok(poses)
}
