//! The domain gap: recall@1 on different kinds of places at equal viewpoint change.

use serde::Deserialize;
use vpr_core::{Error, Provenance, Result, metrics::bootstrap::Interval};
use vpr_report::table::{Cell, Table};

use super::{super::Context, recall, techniques};

/// A kind of place.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    /// What the page calls it.
    pub name: String,
    /// World of that kind.
    pub world: String,
    /// Name of an earlier domain that it is compared with; none: it is a home itself.
    pub home: Option<String>,
}

pub(super) fn run(table: &mut Table, domains: &[Domain], context: Context<'_>) -> Result<()> {
    check_homes(domains)?;
    for runner in techniques(context)? {
        let mut known: Vec<(&str, Interval)> = Vec::new();
        for domain in domains {
            let row = format!("domain: {}", domain.name);
            let Some(here) = recall(table, &row, &domain.world, runner, context)? else {
                continue;
            };
            let home = known.iter().find(|(name, _)| Some(*name) == domain.home.as_deref());
            if let Some((home, there)) = home {
                let (gap, low, high) = difference(there, &here);
                let row = format!("domain gap: {home} minus {}", domain.name);
                let cell = Cell::new(row, runner.column, gap, Provenance::Generated, 2);
                table.push(cell.within(low, high, "Newcombe"));
            }
            known.push((&domain.name, here));
        }
    }
    Ok(())
}

/// Refuses a home that is no earlier domain.
fn check_homes(domains: &[Domain]) -> Result<()> {
    for (index, domain) in domains.iter().enumerate() {
        let Some(home) = &domain.home else { continue };
        if !domains[..index].iter().any(|earlier| earlier.name == *home) {
            let reason = format!("`{}` names `{home}`, which is no earlier domain", domain.name);
            return Err(Error::format("domains", "home", reason));
        }
    }
    Ok(())
}

/// The difference of two independent shares with its interval (Newcombe 1998, method 10).
fn difference(first: &Interval, second: &Interval) -> (f64, f64, f64) {
    let gap = first.estimate - second.estimate;
    let below = (first.estimate - first.low).hypot(second.high - second.estimate);
    let above = (first.high - first.estimate).hypot(second.estimate - second.low);
    (gap, gap - below, gap + above)
}

#[cfg(test)]
mod tests {
    use vpr_core::metrics::bootstrap::{Z_95, wilson_interval};

    use super::*;

    #[test]
    fn a_home_comes_before_those_compared_with_it() {
        let domain = |name: &str, home: Option<&str>| Domain {
            name: name.into(),
            world: "world/street".into(),
            home: home.map(Into::into),
        };
        let domains = [domain("street", None), domain("rail", Some("street"))];
        check_homes(&domains).unwrap();
        let err = check_homes(&domains[1..]).unwrap_err().to_string();
        assert!(err.contains("`rail` names `street`"), "{err}");
        assert!(check_homes(&[domain("rail", Some("rail"))]).is_err());
    }

    #[test]
    fn the_difference_of_shares_has_newcombes_interval() {
        // Newcombe 1998, table II, case (a): 56/70 against 48/80.
        let first = wilson_interval(56, 70, Z_95).unwrap();
        let second = wilson_interval(48, 80, Z_95).unwrap();
        let (gap, low, high) = difference(&first, &second);
        assert!((gap - 0.2).abs() < 1e-12);
        assert!((low - 0.0524).abs() < 5e-5 && (high - 0.3339).abs() < 5e-5, "{low} {high}");
    }
}
