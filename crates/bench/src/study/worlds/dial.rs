//! Nuisance dials: recall@1 as numbers of a recipe rise.

use std::collections::BTreeMap;

use serde::Deserialize;
use vpr_core::{
    Error, Result,
    figure::{Curve, Figure, Panel},
    metrics::bootstrap::Interval,
    table::{Cell, Provenance, Table},
};

use super::{super::Context, recall, techniques};

/// A number of a recipe, or several that are one nuisance, turned up.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dial {
    /// What the page calls it, unit included.
    pub name: String,
    /// World at which it is turned, with the settings that stay.
    pub world: String,
    /// The recipe's keys, which all get the same value.
    pub keys: Vec<String>,
    /// Their values, rising.
    pub values: Vec<f64>,
    /// Keys that go with them, with their own value for each of those.
    #[serde(default)]
    pub beside: BTreeMap<String, Vec<f64>>,
}

impl Dial {
    /// The world at every value.
    fn worlds(&self) -> Result<Vec<String>> {
        if let Some((key, own)) = self.beside.iter().find(|(_, it)| it.len() != self.values.len()) {
            return Err(Error::Parameter {
                name: "beside",
                value: format!("{} values of `{key}` in dial `{}`", own.len(), self.name),
                reason: "must be as many as the dial has",
            });
        }
        Ok((0..self.values.len()).map(|index| self.at(index)).collect())
    }

    fn at(&self, index: usize) -> String {
        let joint = if self.world.contains('?') { '&' } else { '?' };
        let shared = self.keys.iter().map(|key| (key, self.values[index]));
        let own = self.beside.iter().map(|(key, values)| (key, values[index]));
        let settings: Vec<String> =
            shared.chain(own).map(|(key, value)| format!("{key}={value:?}")).collect();
        format!("{}{joint}{}", self.world, settings.join("&"))
    }
}

pub(super) fn run(
    table: &mut Table,
    figure: &mut Figure,
    dial: &Dial,
    context: Context<'_>,
) -> Result<()> {
    let mut panel = Panel {
        title: dial.name.clone(),
        x_label: dial.name.clone(),
        y_label: "recall@1".into(),
        ..Panel::default()
    };
    let worlds = dial.worlds()?;
    for runner in techniques(context)? {
        let mut intervals = Vec::new();
        for (value, world) in dial.values.iter().zip(&worlds) {
            let row = format!("{} {value}", dial.name);
            intervals.extend(recall(table, &row, world, &runner, context)?);
        }
        let points = dial.values.iter().zip(&intervals).map(|(&x, it)| (x, it.estimate)).collect();
        panel.curves.push(Curve { name: runner.0.to_owned(), points });
        let row = format!("{}: how recall@1 moves", dial.name);
        let text = trend(&dial.values, &intervals);
        let n = intervals.len();
        let note = "judged by 95 % intervals: a rise is a lower end above an earlier upper end";
        let cell = Cell::new(row, runner.0, text.as_str(), Provenance::Generated, n);
        table.push(cell.noted(note));
    }
    figure.panels.push(panel);
    Ok(())
}

/// Whether recall falls, stays or rises, as far as the intervals tell.
fn trend(values: &[f64], intervals: &[Interval]) -> String {
    for (later, high) in intervals.iter().enumerate() {
        if let Some(earlier) = intervals[..later].iter().position(|it| it.high < high.low) {
            return format!("rises from {} to {}", values[earlier], values[later]);
        }
    }
    match (intervals.first(), intervals.last()) {
        (Some(first), Some(last)) if last.high < first.low => "falls".to_owned(),
        _ => "does not move beyond the intervals".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn intervals(ends: &[(f64, f64)]) -> Vec<Interval> {
        let interval = |&(low, high): &(f64, f64)| Interval {
            estimate: 0.5 * (low + high),
            low,
            high,
            n_undefined: 0,
        };
        ends.iter().map(interval).collect()
    }

    #[test]
    fn a_trend_is_only_told_beyond_the_intervals() {
        let values = [0.0, 0.5, 1.0];
        let of = |ends: &[(f64, f64)]| trend(&values, &intervals(ends));
        assert_eq!(of(&[(0.8, 1.0), (0.7, 0.9), (0.1, 0.3)]), "falls");
        assert_eq!(
            of(&[(0.5, 0.7), (0.6, 0.8), (0.45, 0.65)]),
            "does not move beyond the intervals"
        );
        assert_eq!(of(&[(0.5, 0.7), (0.1, 0.2), (0.3, 0.4)]), "rises from 0.5 to 1");
    }

    #[test]
    fn a_dial_names_the_world_it_turns() {
        let mut dial = Dial {
            name: "darkness".into(),
            world: "world/street".into(),
            keys: vec!["queries.condition.darkness".into()],
            values: vec![0.25, 1.0],
            beside: BTreeMap::new(),
        };
        assert_eq!(
            dial.worlds().unwrap(),
            [0.25, 1.0].map(|it| format!("world/street?queries.condition.darkness={it:?}"))
        );
        dial.world += "?places=9";
        dial.keys = vec!["a".into(), "b".into()];
        dial.beside = [("c".to_owned(), vec![9.0, 8.0])].into();
        assert_eq!(
            dial.worlds().unwrap(),
            [
                "world/street?places=9&a=0.25&b=0.25&c=9.0",
                "world/street?places=9&a=1.0&b=1.0&c=8.0"
            ]
        );
        dial.beside = [("c".to_owned(), vec![9.0])].into();
        let error = dial.worlds().unwrap_err().to_string();
        assert!(error.contains("darkness") && error.contains("`c`"), "{error}");
    }
}
