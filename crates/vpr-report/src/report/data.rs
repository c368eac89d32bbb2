//! What the script knows: per query what was found and what became of it.

use std::io::{self, Write};

use super::{
    Dataset, Judged, Report, json,
    map::views,
    outcome::label,
    summary::{style, title},
};

/// Matches per query that the gallery shows.
pub(super) const SHOWN: usize = 5;

pub(super) fn write(out: &mut dyn Write, report: &Report<'_>, judged: &[Judged]) -> io::Result<()> {
    write!(out, "<script type=\"application/json\" id=\"data\">{{\"datasets\":[")?;
    for (index, dataset) in report.datasets.iter().enumerate() {
        if index > 0 {
            write!(out, ",")?;
        }
        write_dataset(out, dataset)?;
    }
    write!(out, "],\"runs\":[")?;
    for (index, judged) in judged.iter().enumerate() {
        if index > 0 {
            write!(out, ",")?;
        }
        write_run(out, report, index, judged)?;
    }
    writeln!(out, "]}}</script>")
}

fn write_dataset(out: &mut dyn Write, dataset: &Dataset<'_>) -> io::Result<()> {
    write!(out, "{{\"name\":{}", json::string(&dataset.name))?;
    for (key, names) in [("q", &dataset.queries), ("r", &dataset.references)] {
        // Paths share most of their letters.
        let shared = shared(names);
        let rest = names.iter().map(|name| json::string(&name[shared..]));
        let prefix = names.first().map_or("", |name| &name[..shared]);
        write!(out, ",\"{key}0\":{},\"{key}\":{}", json::string(prefix), json::list(rest))?;
    }
    if let Some(truth) = dataset.truth {
        let first = (0..truth.len())
            .map(|query| truth.correct(query).first().map_or("-1".to_owned(), ToString::to_string));
        write!(out, ",\"t\":{}", json::list(first))?;
    }
    let views = views(dataset);
    if let (Some((queries, references)), false) = (dataset.poses, views.is_empty()) {
        for (key, poses) in [("qp", queries), ("rp", references)] {
            write!(out, ",\"{key}\":[")?;
            for axis in 0..3 {
                let comma = if axis > 0 { "," } else { "" };
                let at = (0..poses.len()).map(|it| json::rough(poses.position(it)[axis]));
                write!(out, "{comma}{}", json::list(at))?;
            }
            write!(out, "]")?;
        }
        let view = views.iter().map(|it| {
            let numbers = [it.origin.0, it.origin.1, it.scale, it.height].map(json::exact);
            format!("[{},{},{}]", it.axes.0, it.axes.1, numbers.join(","))
        });
        write!(out, ",\"views\":{}", json::list(view))?;
    }
    write!(out, "}}")
}

fn write_run(
    out: &mut dyn Write,
    report: &Report<'_>,
    index: usize,
    judged: &Judged,
) -> io::Result<()> {
    let run = &report.runs[index];
    let truth = report.datasets[run.dataset].truth;
    let name = json::string(&title(report, run));
    let label = json::string(&label(run, judged));
    write!(
        out,
        "{{\"name\":{name},\"by\":{label},\"d\":{},\"c\":{}",
        run.dataset,
        style(report, index).colour
    )?;
    write!(out, ",\"th\":{}", json::exact(judged.threshold))?;
    write!(out, ",\"u\":{}", json::list(judged.uncertainty.iter().map(|it| json::exact(*it))))?;
    let lists = |of: &dyn Fn(usize, &super::Match) -> String| {
        let list = |(query, matches): (usize, &Vec<super::Match>)| {
            json::list(matches.iter().take(SHOWN).map(|it| of(query, it)))
        };
        json::list(run.matches.iter().enumerate().map(list))
    };
    write!(out, ",\"p\":{}", lists(&|_, it| it.reference.to_string()))?;
    write!(out, ",\"s\":{}", lists(&|_, it| json::rough(it.distance)))?;
    if run.matches.iter().flatten().any(|it| it.inliers.is_some()) {
        let inliers = |it: &super::Match| it.inliers.map_or("null".to_owned(), |it| it.to_string());
        write!(out, ",\"n\":{}", lists(&|_, it| inliers(it)))?;
    }
    if let Some(truth) = truth {
        let right = |(query, matches): (usize, &Vec<super::Match>)| {
            let flag =
                |it: &super::Match| if truth.is_correct(query, it.reference) { '1' } else { '0' };
            format!("\"{}\"", matches.iter().take(SHOWN).map(flag).collect::<String>())
        };
        write!(out, ",\"ok\":{}", json::list(run.matches.iter().enumerate().map(right)))?;
    }
    write!(out, "}}")
}

/// Bytes that all names begin with, up to the last slash of them.
fn shared(names: &[String]) -> usize {
    let Some(first) = names.first() else { return 0 };
    let common = names.iter().fold(first.len(), |length, name| {
        first.bytes().zip(name.bytes()).take(length).take_while(|(a, b)| a == b).count()
    });
    first.as_bytes()[..common].iter().rposition(|it| *it == b'/').map_or(0, |at| at + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_shared_and_letters_stay_whole() {
        let names = |list: &[&str]| list.iter().map(|it| (*it).to_owned()).collect::<Vec<_>>();
        assert_eq!(shared(&names(&["a/b/é1", "a/b/é2"])), 4);
        assert_eq!(shared(&names(&["a/b", "c/d"])), 0);
        assert_eq!(shared(&names(&["a/"])), 2);
        assert_eq!(shared(&[]), 0);
    }
}
