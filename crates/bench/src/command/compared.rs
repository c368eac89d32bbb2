//! How the comparisons of `bench compare` are printed.

use std::fmt::Write as _;

use bench::comparison::{Comparison, Metric, Pair, Protocol};
use vpr_core::{
    Definition, GroundTruth, Provenance,
    metrics::{McNemar, effective},
};
use vpr_report::table::{Cell, Table, Value, p_value};

use super::retrieved::Retrieved;

/// Methods with their comparisons.
pub(super) struct Compared<'a> {
    pub(super) names: &'a [&'a str],
    pub(super) comparison: &'a Comparison<'a>,
    pub(super) protocol: &'a Protocol,
    pub(super) truth: &'a GroundTruth,
    pub(super) provenance: Provenance,
}

const BOOTSTRAP: &str = "paired bootstrap over queries";

impl Compared<'_> {
    /// One line per method, one per pair and metric, one per metric.
    pub(super) fn lines(&self) -> vpr_core::Result<String> {
        let mut text = String::new();
        for (index, name) in self.names.iter().enumerate() {
            let values = self.protocol.metrics.iter().map(|&metric| {
                let value = self.comparison.value(index, metric, Definition::Corrected)?.estimate;
                Ok(match metric {
                    Metric::RecallAt(n) => format!("R@{n}: {:.1}", 100.0 * value),
                    Metric::AucPr => format!("AUC-PR: {value:.3} (corrected)"),
                })
            });
            let values = values.collect::<vpr_core::Result<Vec<String>>>()?;
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{name}: {}", values.join(", "));
        }
        for pair in &self.comparison.pairs {
            let _ = writeln!(text, "{}", self.line(pair));
        }
        Ok(text + &self.verdicts()?)
    }

    fn line(&self, pair: &Pair) -> String {
        let difference = pair.difference.estimate;
        let size = match pair.metric {
            Metric::RecallAt(_) => format!("{:+.1}", 100.0 * difference),
            Metric::AucPr => format!("{difference:+.3}"),
        };
        let counts = pair
            .discordant
            .map_or_else(String::new, |it| format!(" ({} wins, {} losses)", it.first, it.second));
        let needed = match pair.queries_for {
            Some(n) => format!("{n} queries"),
            None => "no number of queries found".to_owned(),
        };
        format!(
            "{}: {size}{counts}, p {}, corrected {}; power {:.2}, {needed} for {}",
            self.row(pair),
            p_value(pair.p_value),
            p_value(pair.corrected),
            pair.power,
            self.protocol.power
        )
    }

    /// Who is best by each metric, and who cannot be told from it.
    pub(super) fn verdicts(&self) -> vpr_core::Result<String> {
        let mut text = String::new();
        for &metric in &self.protocol.metrics {
            let best = self.comparison.best(metric)?;
            let others: Vec<&str> = best.not_told_apart.iter().map(|&it| self.names[it]).collect();
            let verdict = match others[..] {
                [] => "and differs from all others".to_owned(),
                _ => format!("and is not told apart from {}", others.join(", ")),
            };
            // Writing to a string cannot fail.
            let _ =
                writeln!(text, "{}: {} is best {verdict}", name(metric), self.names[best.method]);
        }
        Ok(text)
    }

    /// The metrics of each method with their intervals.
    pub(super) fn methods(&self) -> vpr_core::Result<Table> {
        let n = self.truth.len();
        let title = format!(
            "{n} queries, {} references; {} queries have a correct one",
            self.truth.n_references(),
            self.truth.n_known()
        );
        let mut table = Table::new("comparison", title);
        for (index, row) in self.names.iter().enumerate() {
            for &metric in &self.protocol.metrics {
                let definitions: &[Definition] = match metric {
                    Metric::RecallAt(_) => &[Definition::Corrected],
                    Metric::AucPr => &[Definition::Published, Definition::Corrected],
                };
                for &definition in definitions {
                    table.push(self.value(index, row, metric, definition)?);
                }
            }
        }
        Ok(table)
    }

    fn value(
        &self,
        index: usize,
        row: &str,
        metric: Metric,
        definition: Definition,
    ) -> vpr_core::Result<Cell> {
        let (provenance, n) = (self.provenance, self.truth.len());
        match self.comparison.value(index, metric, definition) {
            Ok(it) => {
                let cell = Cell::new(row, name(metric), it.estimate, provenance, n);
                Ok(match metric {
                    Metric::RecallAt(_) => cell.within(it.low, it.high, "Wilson"),
                    Metric::AucPr => {
                        cell.defined(definition).within(it.low, it.high, effective::METHOD)
                    }
                })
            }
            Err(err @ vpr_core::Error::Undefined { .. }) => {
                Ok(Cell::absent(row, name(metric), err.to_string()).defined(definition))
            }
            Err(err) => Err(err),
        }
    }

    /// Every pair by every metric.
    pub(super) fn pairs(&self) -> Table {
        let title = format!(
            "differences; p corrected by Holm for the pairs of each metric, level {}",
            self.protocol.level
        );
        let mut table = Table::new("comparison", title);
        let needed = format!("queries for power {}", self.protocol.power);
        for pair in &self.comparison.pairs {
            let row = self.row(pair);
            let cell = |column: &str, value: f64| {
                Cell::new(
                    row.clone(),
                    column,
                    Value::Number(value),
                    self.provenance,
                    self.truth.len(),
                )
            };
            let (it, test) = (pair.difference, self.test(pair.metric));
            table.push(cell("difference", it.estimate).within(it.low, it.high, BOOTSTRAP));
            if let Some(counts) = pair.discordant {
                table.push(cell("wins", counts.first as f64));
                table.push(cell("losses", counts.second as f64));
            }
            table.push(cell("p", pair.p_value).noted(test));
            table.push(cell("p corrected", pair.corrected));
            table.push(cell("power", pair.power));
            table.push(match pair.queries_for {
                Some(n) => cell(&needed, n as f64),
                None => Cell::absent(row.clone(), &needed, "no number of queries was found"),
            });
        }
        table
    }

    fn test(&self, metric: Metric) -> &'static str {
        match (metric, self.protocol.test) {
            (Metric::AucPr, _) => BOOTSTRAP,
            (_, McNemar::MidP) => "McNemar, mid-p",
            (_, McNemar::Exact) => "McNemar, exact",
        }
    }

    fn row(&self, pair: &Pair) -> String {
        format!("{} − {}, {}", self.names[pair.first], self.names[pair.second], name(pair.metric))
    }
}

fn name(metric: Metric) -> String {
    match metric {
        Metric::RecallAt(n) => format!("R@{n}"),
        Metric::AucPr => "AUC-PR".to_owned(),
    }
}

/// Which method is right on which query, by its best reference: a line per query.
pub(super) fn per_query(
    found: &[(String, Retrieved)],
    truth: &GroundTruth,
) -> vpr_core::Result<String> {
    let Some((_, first)) = found.first() else { return Ok(String::new()) };
    let best: Vec<Vec<usize>> = found.iter().map(|(_, it)| it.ranking.best()).collect();
    let right = best.iter().map(|it| truth.judge(it)).collect::<vpr_core::Result<Vec<_>>>()?;
    let columns = found.iter().map(|(name, _)| {
        format!("{},{}", quoted(&format!("{name} right")), quoted(&format!("{name} reference")))
    });
    let mut text = format!("query,known,{}\n", columns.collect::<Vec<_>>().join(","));
    for query in 0..truth.len() {
        let known = u8::from(!truth.is_new_place(query));
        let of = |method: usize| {
            let reference = &first.references.names[best[method][query]];
            format!("{},{}", u8::from(right[method][query]), quoted(&reference.to_string_lossy()))
        };
        let methods: Vec<String> = (0..found.len()).map(of).collect();
        let query = quoted(&first.queries.names[query].to_string_lossy());
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{query},{known},{}", methods.join(","));
    }
    Ok(text)
}

/// A field of CSV.
pub(super) fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        return format!("\"{}\"", text.replace('"', "\"\""));
    }
    text.to_owned()
}
