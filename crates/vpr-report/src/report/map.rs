//! Where queries and references are, and what became of the queries.

use std::io::{self, Write};

use vpr_core::Poses;

use super::{Dataset, Judged, Report, escape, summary::title};

/// Longest side of a view and the margin around its points; the script knows the margin too.
const SIDE: f64 = 640.0;
/// Shortest side of a view.
const SHORT: f64 = 120.0;
const MARGIN: f64 = 10.0;

/// Positions seen along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct View {
    pub(super) title: &'static str,
    /// Which coordinates go to the right and up.
    pub(super) axes: (usize, usize),
    /// The lowest of both.
    pub(super) origin: (f64, f64),
    /// Pixels per metre.
    pub(super) scale: f64,
    width: f64,
    pub(super) height: f64,
}

/// From above, and from the side where heights differ; none without positions.
pub(super) fn views(dataset: &Dataset<'_>) -> Vec<View> {
    let Some((queries, references)) = dataset.poses else { return Vec::new() };
    let range = |axis: usize| {
        let all = [queries, references].into_iter();
        let values = all.flat_map(|poses| (0..poses.len()).map(move |it| poses.position(it)[axis]));
        values
            .filter(|it| it.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), it| (low.min(it), high.max(it)))
    };
    let [x, y, z] = [0, 1, 2].map(range);
    if x.0 > x.1 || y.0 > y.1 {
        return Vec::new();
    }
    let view = |title, axes, a: (f64, f64), b: (f64, f64)| {
        let inner = SIDE - 2.0 * MARGIN;
        let (wide, high) = ((a.1 - a.0).max(1e-6), (b.1 - b.0).max(1e-6));
        let scale = (inner / wide).min(inner / high);
        let [width, height] = [wide, high].map(|it| (it * scale + 2.0 * MARGIN).max(SHORT));
        View { title, axes, origin: (a.0, b.0), scale, width, height }
    };
    let mut views = vec![view("from above", (0, 1), x, y)];
    let is_planar = matches!(queries, Poses::Planar(_)) && matches!(references, Poses::Planar(_));
    if !is_planar && z.1 > z.0 {
        views.push(view("from the side", (0, 2), x, z));
    }
    views
}

impl View {
    /// Whether it is clearly higher than wide.
    pub(super) fn is_high(&self) -> bool {
        self.height > 1.2 * self.width
    }

    fn place(&self, poses: &Poses, index: usize) -> Option<(f64, f64)> {
        let at = poses.position(index);
        let (a, b) = (at[self.axes.0], at[self.axes.1]);
        if !(a.is_finite() && b.is_finite()) {
            return None;
        }
        let x = MARGIN + (a - self.origin.0) * self.scale;
        Some((x, self.height - MARGIN - (b - self.origin.1) * self.scale))
    }
}

pub(super) fn write(out: &mut dyn Write, report: &Report<'_>, judged: &[Judged]) -> io::Result<()> {
    let with = |it: &&Dataset<'_>| !views(it).is_empty();
    if report.datasets.iter().find(with).is_none() {
        return Ok(());
    }
    writeln!(
        out,
        "<section id=\"map\">\n<h2>Map</h2>\n<p class=\"notes\"><svg class=\"key\" viewBox=\"0 0 24 12\" aria-hidden=\"true\">\
         <path class=\"dot c0\" d=\"M12 6h0\"/></svg> right and accepted, \
         <svg class=\"key\" viewBox=\"0 0 24 12\" aria-hidden=\"true\"><path class=\"dot c0\" d=\"M12 6h0\"/><path class=\"hole\" d=\"M12 6h0\"/></svg> right and rejected, \
         <svg class=\"key\" viewBox=\"0 0 24 12\" aria-hidden=\"true\"><path class=\"stroke c1\" d=\"M9 3l6 6m0 -6l-6 6\"/></svg> wrong and accepted, \
         <svg class=\"key\" viewBox=\"0 0 24 12\" aria-hidden=\"true\"><path class=\"thin c1\" d=\"M9 6h6m-3 -3v6\"/></svg> wrong and rejected; \
         grey: references. <span class=\"script\">A line leads to the reference that was found. Click a query to see its pictures.</span></p>"
    )?;
    for (index, dataset) in report.datasets.iter().enumerate() {
        let run = report.runs.iter().position(|run| run.dataset == index);
        for (nth, view) in views(dataset).iter().enumerate() {
            let (Some((queries, references)), Some(run)) = (dataset.poses, run) else { continue };
            // As large as the widest view on the same screen.
            let (across, height, most) = (view.width, view.height, 900.0 * view.width / SIDE);
            let about = format!("{} {}", dataset.name, view.title);
            writeln!(
                out,
                "<figure class=\"map\" data-dataset=\"{index}\" data-view=\"{nth}\"><figcaption>{}, <span class=\"who\">{}</span></figcaption>\n\
                 <svg viewBox=\"0 0 {across:.1} {height:.1}\" style=\"max-width:{most:.0}px\" role=\"img\" aria-label=\"Map of {}: {}\">",
                escape(&about),
                escape(&title(report, &report.runs[run])),
                escape(&about),
                spoken(&judged[run])
            )?;
            let all = (0..references.len()).filter_map(|it| view.place(references, it));
            write_path(out, "reference", all, "h0")?;
            writeln!(out, "<path class=\"thread\"/>")?;
            for kind in KINDS {
                let of = (0..queries.len()).filter(|&query| kind.holds(&judged[run], query));
                let places: Vec<(f64, f64)> =
                    of.filter_map(|query| view.place(queries, query)).collect();
                for (class, shape) in kind.layers() {
                    write_path(out, class, places.iter().copied(), shape)?;
                }
            }
            writeln!(out, "</svg></figure>")?;
        }
    }
    writeln!(out, "</section>")
}

/// What became of a query; the script draws the same four.
#[derive(Clone, Copy)]
enum Kind {
    WrongRejected,
    RightRejected,
    RightAccepted,
    WrongAccepted,
}

/// What matters most is drawn last.
const KINDS: [Kind; 4] =
    [Kind::WrongRejected, Kind::RightRejected, Kind::RightAccepted, Kind::WrongAccepted];

impl Kind {
    /// Queries without a truth count as right: nobody says that they are wrong.
    fn holds(self, judged: &Judged, query: usize) -> bool {
        let is_right = judged.is_correct(query).unwrap_or(true);
        match self {
            Self::WrongRejected => !is_right && !judged.accepts(query),
            Self::RightRejected => is_right && !judged.accepts(query),
            Self::RightAccepted => is_right && judged.accepts(query),
            Self::WrongAccepted => !is_right && judged.accepts(query),
        }
    }

    fn layers(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Self::WrongRejected => &[("thin c1 wr", "m-3 0h6m-3 -3v6")],
            Self::RightRejected => &[("dot c0 rr", "h0"), ("hole rr", "h0")],
            Self::RightAccepted => &[("dot c0 ra", "h0")],
            Self::WrongAccepted => &[("stroke c1 wa", "m-3.5 -3.5l7 7m0 -7l-7 7")],
        }
    }
}

fn write_path(
    out: &mut dyn Write,
    class: &str,
    places: impl Iterator<Item = (f64, f64)>,
    shape: &str,
) -> io::Result<()> {
    write!(out, "<path class=\"{class}\" d=\"")?;
    for (x, y) in places {
        write!(out, "M{x:.1} {y:.1}{shape}")?;
    }
    writeln!(out, "\"/>")
}

fn spoken(judged: &Judged) -> String {
    let count =
        |kind: Kind| (0..judged.uncertainty.len()).filter(|&it| kind.holds(judged, it)).count();
    let [wrong_rejected, right_rejected, right_accepted, wrong_accepted] = KINDS.map(count);
    if judged.correct.is_none() {
        return format!("{right_accepted} queries accepted, {right_rejected} rejected");
    }
    format!(
        "{right_accepted} queries right and accepted, {right_rejected} right and rejected, \
         {wrong_accepted} wrong and accepted, {wrong_rejected} wrong and rejected"
    )
}
