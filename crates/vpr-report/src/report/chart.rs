//! A small chart: axes from 0 to a maximum, one line per run, places for what the script adds.

use std::io::{self, Write};

use super::{clipped, escape, short};
use crate::figure::{Mark, Style};

/// The picture and the plot inside of it, in its own units; the script knows them too.
const SIZE: (f64, f64) = (340.0, 250.0);
const PLOT: (f64, f64, f64, f64) = (56.0, 10.0, 272.0, 196.0);
/// Most points of a line; the script shows their values.
const POINTS: usize = 160;

/// One line of a chart.
pub(super) struct Line {
    /// Who it is about.
    pub(super) name: String,
    pub(super) style: Style,
    pub(super) points: Vec<(f64, f64)>,
    /// Lower and upper end of intervals, or nothing.
    pub(super) band: Vec<(f64, f64)>,
}

/// What a chart shows.
pub(super) struct Chart<'a> {
    pub(super) id: &'a str,
    pub(super) title: &'a str,
    pub(super) x_label: &'a str,
    pub(super) y_label: &'a str,
    /// Ends of the horizontal axis.
    pub(super) x: (f64, f64),
    /// Ends of the vertical axis.
    pub(super) y: (f64, f64),
    pub(super) lines: Vec<Line>,
    /// Where matches to the left are accepted, and by which run.
    pub(super) cut: Option<(usize, f64)>,
}

impl Chart<'_> {
    fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let (left, top, width, height) = PLOT;
        let share = |value: f64, (low, high): (f64, f64)| {
            if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 }
        };
        (left + share(x, self.x) * width, top + (1.0 - share(y, self.y)) * height)
    }

    fn path(&self, points: impl Iterator<Item = (f64, f64)>) -> String {
        let place = |(index, point): (usize, (f64, f64))| {
            let (x, y) = self.place(point);
            format!("{}{x:.1} {y:.1}", if index == 0 { 'M' } else { 'L' })
        };
        points.enumerate().map(place).collect()
    }

    /// Writes the chart as a figure.
    pub(super) fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let (width, height) = SIZE;
        let (_, top, _, plot_height) = PLOT;
        let id = self.id;
        writeln!(
            out,
            "<figure class=\"chart\"><figcaption>{}</figcaption>\n<svg viewBox=\"0 0 {width} {height}\" \
             role=\"img\" aria-label=\"{}\" id=\"{id}\" data-x=\"{} {}\" data-y=\"{} {}\">",
            escape(self.title),
            escape(&self.spoken()),
            self.x.0,
            self.x.1,
            self.y.0,
            self.y.1
        )?;
        self.write_axes(out)?;
        self.write_lines(out)?;
        if let Some((run, cut)) = self.cut {
            let at = self.place((cut, self.y.0)).0;
            writeln!(
                out,
                "<path class=\"cut\" data-run=\"{run}\" d=\"M{at:.1} {top}v{plot_height}\"/>"
            )?;
        }
        writeln!(
            out,
            "<path class=\"chosen\"/><path class=\"cursor\"/></svg>\n<output class=\"values\"></output></figure>"
        )
    }

    fn write_axes(&self, out: &mut dyn Write) -> io::Result<()> {
        let (left, top, plot_width, plot_height) = PLOT;
        let bottom = top + plot_height;
        writeln!(out, "<path class=\"axis\" d=\"M{left} {top}V{bottom}H{}\"/>", left + plot_width)?;
        for step in 0..=4 {
            let share = f64::from(step) / 4.0;
            let mut x = self.x.0 + share * (self.x.1 - self.x.0);
            // Ranks are whole numbers.
            if self.x.1 - self.x.0 >= 4.0 {
                x = x.round();
            }
            let y = self.y.0 + share * (self.y.1 - self.y.0);
            let (at_x, at_y) = (self.place((x, self.y.0)).0, bottom - share * plot_height);
            writeln!(
                out,
                "<path class=\"grid\" d=\"M{left} {at_y:.1}h{plot_width}\"/>\
                 <text class=\"end\" x=\"{}\" y=\"{:.1}\">{}</text>\
                 <text class=\"mid\" x=\"{at_x:.1}\" y=\"{}\">{}</text>",
                left - 5.0,
                at_y + 4.0,
                tick(y),
                bottom + 15.0,
                tick(x)
            )?;
        }
        writeln!(
            out,
            "<text class=\"mid\" x=\"{}\" y=\"{}\">{}</text>\
             <text class=\"mid\" transform=\"rotate(-90 12 {y})\" x=\"12\" y=\"{y}\">{}</text>",
            left + plot_width / 2.0,
            SIZE.1 - 8.0,
            escape(&clipped(self.x_label, 44)),
            escape(self.y_label),
            y = top + plot_height / 2.0,
        )?;
        Ok(())
    }

    fn write_lines(&self, out: &mut dyn Write) -> io::Result<()> {
        for (nth, line) in self.lines.iter().enumerate() {
            let Style { colour, mark } = line.style;
            let points = thin(&line.points);
            if !line.band.is_empty() {
                let low = line.points.iter().zip(&line.band).map(|(point, band)| (point.0, band.0));
                let high = line.points.iter().zip(&line.band).rev();
                let high = high.map(|(point, band)| (point.0, band.1));
                writeln!(
                    out,
                    "<path class=\"band c{colour}\" d=\"{}Z\"/>",
                    self.path(low.chain(high))
                )?;
            }
            writeln!(
                out,
                "<path class=\"line c{colour}\" data-name=\"{}\" d=\"{}\"/>",
                escape(&line.name),
                self.path(points.iter().copied())
            )?;
            let step = (points.len() / 4).max(1);
            let offset = (nth * 2 + 1) % step;
            let marks: String = points
                .iter()
                .skip(offset)
                .step_by(step)
                .map(|point| shape(mark, self.place(*point)))
                .collect();
            writeln!(out, "<path class=\"{} c{colour}\" d=\"{marks}\"/>", class(mark))?;
        }
        Ok(())
    }

    /// What the chart shows, for those who hear it.
    fn spoken(&self) -> String {
        let ends = self.lines.iter().filter_map(|line| {
            let (first, last) = (line.points.first()?, line.points.last()?);
            Some(format!(
                "{}: from {} at {} to {} at {}",
                line.name,
                short(first.1),
                short(first.0),
                short(last.1),
                short(last.0)
            ))
        });
        let ends = ends.take(8).collect::<Vec<_>>().join("; ");
        format!("{}: {} over {}. {ends}", self.title, self.y_label, self.x_label)
    }
}

fn tick(value: f64) -> String {
    if value.fract().abs() < 1e-9 {
        format!("{value:.0}")
    } else {
        format!("{value:.3}").trim_end_matches('0').to_owned()
    }
}

/// At most [`POINTS`] points, the ends among them.
fn thin(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= POINTS {
        return points.to_vec();
    }
    let last = points.len() - 1;
    (0..POINTS).map(|index| points[index * last / (POINTS - 1)]).collect()
}

fn class(mark: Mark) -> &'static str {
    if matches!(mark, Mark::Cross | Mark::Plus) { "stroke" } else { "mark" }
}

/// A mark about a place.
fn shape(mark: Mark, (x, y): (f64, f64)) -> String {
    let at = format!("M{x:.1} {y:.1}");
    let rest = match mark {
        Mark::Circle => "m-3.2 0a3.2 3.2 0 1 0 6.4 0a3.2 3.2 0 1 0 -6.4 0Z",
        Mark::Square => "m-3 -3h6v6h-6Z",
        Mark::Triangle => "m0 -4l4 7h-8Z",
        Mark::Down => "m0 4l4 -7h-8Z",
        Mark::Diamond => "m0 -4.2l4.2 4.2l-4.2 4.2l-4.2 -4.2Z",
        Mark::Star => "m0 -4.6l1.3 3.1h3.2l-2.6 2.1l1 3.3l-2.9 -2l-2.9 2l1 -3.3l-2.6 -2.1h3.2Z",
        Mark::Plus => "m-3.5 0h7m-3.5 -3.5v7",
        Mark::Cross => "m-2.7 -2.7l5.4 5.4m0 -5.4l-5.4 5.4",
    };
    at + rest
}

/// The mark of a run before its name.
pub(super) fn sample(style: Style) -> String {
    format!(
        "<svg class=\"key\" viewBox=\"0 0 24 12\" aria-hidden=\"true\"><path class=\"line\" d=\"M0 6h24\"/>\
         <path class=\"{}\" d=\"{}\"/></svg>",
        class(style.mark),
        shape(style.mark, (12.0, 6.0))
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thin_lines_keep_their_ends() {
        let points: Vec<(f64, f64)> = (0..10_000).map(|it| (f64::from(it), 0.0)).collect();
        let thin = thin(&points);
        assert_eq!((thin.len(), thin[0].0, thin[POINTS - 1].0), (POINTS, 0.0, 9999.0));
    }
}
