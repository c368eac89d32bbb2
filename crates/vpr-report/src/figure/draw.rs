//! A figure as an SVG document.

use std::{collections::BTreeSet, fmt::Write as _};

use super::{
    COLOURS, Curve, Figure, Mark, Shape, Style,
    bars::bars,
    multiples::multiples,
    plan::{Anchor, Frame, Key, Plan, Rect, TEXT, TITLE, plan},
    text::escape,
    thin::{Place, scatter, simplify},
};

/// Largest document; a larger one is drawn again with coarser lines.
const MOST_BYTES: usize = 300_000;
/// How far a line may be from its points, and the side of the cells in which scattered points
/// become one; both in tenths of a pixel.
const TOLERANCES: [(i64, i64); 6] = [(2, 10), (4, 15), (8, 22), (15, 30), (30, 45), (60, 70)];
/// Marks on a line of many points.
const MARKS: usize = 5;
/// Points of a line up to which every one has its mark, and scattered points up to which they do.
const FEW: usize = 12;
const APART: usize = 300;

impl Figure {
    /// This figure as an SVG document of at most 300 KB, under a caption.
    ///
    /// Lines are simplified by at most 0.2 pixels, more if the document would be larger; the
    /// description inside says by how much.
    #[must_use]
    pub fn svg(&self, caption: &str) -> String {
        let multiples = multiples(&self.panels);
        let plan = plan(&multiples, caption);
        let mut document = String::new();
        for tolerance in TOLERANCES {
            document = draw(&plan, caption, tolerance);
            if document.len() <= MOST_BYTES {
                break;
            }
        }
        document
    }
}

/// Lines that all figures begin with.
fn style() -> String {
    let mut style = format!(
        "text{{font-family:Helvetica,Arial,'DejaVu Sans',sans-serif;font-size:{TEXT}px;fill:#222}}\
         .t{{font-size:{TITLE}px;font-weight:bold}}.s{{text-anchor:middle}}.e{{text-anchor:end}}\
         .a{{fill:none;stroke:#777}}.g{{fill:none;stroke:#e6e6e6}}.o{{fill:none;stroke:#bbb}}\
         .l{{fill:none;stroke:currentColor;stroke-width:1.8;stroke-linejoin:round}}\
         .h{{fill:none;stroke:currentColor;stroke-width:.8}}\
         .m{{fill:currentColor;stroke:#fff;stroke-width:.7}}\
         .w{{fill:#fff;stroke:currentColor;stroke-width:1.4}}\
         .x{{fill:none;stroke:currentColor;stroke-width:2}}\
         .b{{fill:currentColor;opacity:.14}}\
         .p{{fill:none;stroke:currentColor;stroke-width:3.4;stroke-linecap:round;opacity:.65}}"
    );
    for (index, colour) in COLOURS.iter().enumerate() {
        let _ = write!(style, ".c{index}{{color:{colour}}}");
    }
    style
}

fn draw(plan: &Plan<'_>, caption: &str, (tolerance, cell): (i64, i64)) -> String {
    let (width, height) = (tenths(plan.width.ceil()), tenths(plan.height.ceil()));
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
         role=\"img\" aria-labelledby=\"t d\">\n<title id=\"t\">{title}</title>\n\
         <desc id=\"d\">{description}</desc>\n<style>{style}</style>\n\
         <rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n",
        w = number(width),
        h = number(height),
        title = escape(caption),
        description = escape(&description(plan, tolerance)),
        style = style(),
    );
    for frame in &plan.frames {
        draw_frame(&mut out, plan, frame, (tolerance, cell));
    }
    for key in &plan.keys {
        draw_key(&mut out, key);
    }
    for text in &plan.texts {
        let mut classes = Vec::new();
        classes.extend(text.is_title.then_some("t"));
        match text.anchor {
            Anchor::Start => {}
            Anchor::Middle => classes.push("s"),
            Anchor::End => classes.push("e"),
        }
        let class = classes.join(" ");
        let class = if class.is_empty() { class } else { format!(" class=\"{class}\"") };
        let (x, y) = (number(tenths(text.x)), number(tenths(text.y)));
        let turn = if text.is_turned {
            format!(" transform=\"rotate(-90 {x} {y})\"")
        } else {
            String::new()
        };
        let _ = writeln!(
            out,
            "<text x=\"{x}\" y=\"{y}\"{class}{turn}>{}</text>",
            escape(&text.content)
        );
    }
    out += "</svg>\n";
    out
}

/// What a figure shows, for those who hear it.
fn description(plan: &Plan<'_>, tolerance: i64) -> String {
    let panels = plan.frames.iter().map(|frame| {
        let panel = frame.multiple.panel;
        let curves = frame.multiple.shown.iter().map(|&index| &panel.curves[index]);
        let names: BTreeSet<&str> =
            curves.map(|it| it.name.as_str()).filter(|it| !it.is_empty()).collect();
        let names = names.into_iter().collect::<Vec<_>>().join(", ");
        let names = if names.is_empty() { names } else { format!(": {names}") };
        format!("{} ({} over {}){names}.", frame.multiple.title, panel.y_label, panel.x_label)
    });
    let panels = panels.collect::<Vec<_>>().join(" ");
    format!("{panels} Lines are within {} pixels of their points.", number(tolerance))
}

/// Axes, and light lines at their numbers.
fn draw_grid(out: &mut String, frame: &Frame<'_>) {
    let Rect { x, y, width, height } = frame.plot;
    let mut grid = String::new();
    for (share, _) in &frame.y.ticks {
        let at = number(tenths(y + 6.0 + (1.0 - share) * (height - 12.0)));
        let _ = write!(grid, "M{} {at}H{}", number(tenths(x)), number(tenths(x + width)));
    }
    for (share, _) in &frame.x.ticks {
        let at = number(tenths(x + 6.0 + share * (width - 12.0)));
        let _ = write!(grid, "M{at} {}V{}", number(tenths(y)), number(tenths(y + height)));
    }
    let _ = writeln!(out, "<path class=\"g\" d=\"{grid}\"/>");
    let (left, top) = (number(tenths(x)), number(tenths(y)));
    let (right, bottom) = (number(tenths(x + width)), number(tenths(y + height)));
    let _ = writeln!(out, "<path class=\"a\" d=\"M{left} {top}V{bottom}H{right}\"/>");
}

fn draw_frame(out: &mut String, plan: &Plan<'_>, frame: &Frame<'_>, tolerance: (i64, i64)) {
    draw_grid(out, frame);
    let curves = &frame.multiple.panel.curves;
    for &index in &frame.multiple.grey {
        let line = line(frame, &curves[index].points, tolerance.0);
        let _ = writeln!(out, "<path class=\"o\" d=\"{line}\"/>");
    }
    let style = |curve: &Curve| plan.styles.iter().find(|it| it.0 == curve.name).map(|it| it.1);
    let shown = || {
        let curves = frame.multiple.shown.iter().map(|&index| &curves[index]);
        curves.filter_map(|curve| Some((curve, style(curve)?)))
    };
    for (curve, style) in shown().filter(|it| !it.0.band.is_empty() && it.0.shape != Shape::Bars) {
        let edge = |end: fn(&(f64, f64)) -> f64| -> Vec<(f64, f64)> {
            curve.points.iter().zip(&curve.band).map(|(point, band)| (point.0, end(band))).collect()
        };
        let (low, mut high) = (edge(|it| it.0), edge(|it| it.1));
        high.reverse();
        let around = line(frame, &[low, high].concat(), tolerance.0);
        let _ = writeln!(out, "<path class=\"b c{}\" d=\"{around}Z\"/>", style.colour);
    }
    let n_bars = shown().filter(|it| it.0.shape == Shape::Bars).count();
    for (nth, (curve, style)) in shown().enumerate() {
        let colour = style.colour;
        match curve.shape {
            Shape::Points => {
                let (cell, shift) = (tolerance.1, if nth % 2 == 0 { 0 } else { tolerance.1 / 2 });
                let dots = scatter(&places(frame, &curve.points), cell, shift);
                if dots.len() <= APART {
                    let path = dots.into_iter().map(|it| outline(style.mark, it, 2.2));
                    out.push_str(&marked(style, &path.collect::<String>()));
                    continue;
                }
                let dots = dots.iter().map(|it| format!("M{} {}h0", number(it.0), number(it.1)));
                let path = dots.collect::<Vec<_>>().concat();
                let _ = writeln!(out, "<path class=\"p c{colour}\" d=\"{path}\"/>");
            }
            Shape::Bars => out.push_str(&bars(frame, (nth, n_bars), curve, style)),
            Shape::Thesis => {
                let path =
                    places(frame, &curve.points).into_iter().map(|it| outline(style.mark, it, 4.2));
                let _ = writeln!(
                    out,
                    "<path class=\"w c{colour}\" d=\"{}\"/>",
                    path.collect::<String>()
                );
            }
            Shape::Line => {
                let path = line(frame, &curve.points, tolerance.0);
                let _ = writeln!(out, "<path class=\"l c{colour}\" d=\"{path}\"/>");
                let marks = marks(frame, curve, nth);
                let path = marks.into_iter().map(|it| outline(style.mark, it, 3.6));
                out.push_str(&marked(style, &path.collect::<String>()));
            }
        }
    }
}

fn draw_key(out: &mut String, key: &Key) {
    let colour = key.style.colour;
    let (x, y) = (tenths(key.x), tenths(key.y));
    match key.leader {
        Some((from_x, from_y)) => {
            let _ = writeln!(
                out,
                "<path class=\"h c{colour}\" d=\"M{} {}L{} {}\"/>",
                number(tenths(from_x)),
                number(tenths(from_y)),
                number(x - 60),
                number(y)
            );
        }
        None if key.shape == Shape::Line => {
            let _ = writeln!(
                out,
                "<path class=\"l c{colour}\" d=\"M{} {}h16\"/>",
                number(x - 80),
                number(y)
            );
        }
        None => {}
    }
    let mark = if key.shape == Shape::Bars { Mark::Square } else { key.style.mark };
    let path = outline(mark, (x, y), 3.6);
    if key.shape == Shape::Thesis {
        let _ = writeln!(out, "<path class=\"w c{colour}\" d=\"{path}\"/>");
    } else {
        out.push_str(&marked(key.style, &path));
    }
}

/// Marks, filled or, where they are only strokes, stroked.
fn marked(style: Style, path: &str) -> String {
    let class = if matches!(style.mark, Mark::Cross | Mark::Plus) { 'x' } else { 'm' };
    format!("<path class=\"{class} c{}\" d=\"{path}\"/>\n", style.colour)
}

/// The places of the points that can be shown, in tenths of a pixel.
fn places(frame: &Frame<'_>, points: &[(f64, f64)]) -> Vec<Place> {
    let places = points.iter().filter_map(|&point| frame.place(point));
    places.map(|(x, y)| (tenths(x), tenths(y))).collect()
}

/// What can be seen of a line through all points, in tenths of a pixel.
fn pieces(frame: &Frame<'_>, points: &[(f64, f64)]) -> Vec<Vec<Place>> {
    let whole =
        |piece: Vec<(f64, f64)>| piece.iter().map(|it| (tenths(it.0), tenths(it.1))).collect();
    frame.pieces(points).into_iter().map(whole).collect()
}

/// A line through all points, cut where it leaves the axes.
fn line(frame: &Frame<'_>, points: &[(f64, f64)], tolerance: i64) -> String {
    let mut path = String::new();
    for piece in pieces(frame, points) {
        for (index, place) in simplify(&piece, tolerance).into_iter().enumerate() {
            let command = if index == 0 { 'M' } else { 'L' };
            let _ = write!(path, "{command}{} {}", number(place.0), number(place.1));
        }
    }
    path
}

/// Where a line has its marks: at each of few points, otherwise along its way. A curve without a
/// name, such as a histogram, is told from no other.
fn marks(frame: &Frame<'_>, curve: &Curve, nth: usize) -> Vec<Place> {
    let points = places(frame, &curve.points);
    match points.len() {
        _ if curve.name.is_empty() => Vec::new(),
        0..=FEW => points,
        _ => along(&pieces(frame, &curve.points), nth),
    }
}

/// Places at equal steps along a line, most of all along the
/// horizontal, shifted by its place among the curves, so that lines that run together show all of
/// their marks.
fn along(pieces: &[Vec<Place>], nth: usize) -> Vec<Place> {
    let steps = || pieces.iter().flat_map(|piece| piece.windows(2));
    let step = |pair: &[Place]| {
        let (dx, dy) = ((pair[1].0 - pair[0].0) as f64, (pair[1].1 - pair[0].1) as f64);
        // Mostly along: what goes up and down on the spot needs no marks.
        dx.abs() + 0.1 * dy.abs()
    };
    let length: f64 = steps().map(step).sum();
    let shift = (nth % 8) as f64 / 8.0;
    let mut wanted =
        (0..MARKS).map(|it| (it as f64 + 0.1 + 0.8 * shift) / MARKS as f64 * length).peekable();
    let (mut way, mut marks) = (0.0, Vec::new());
    for pair in steps() {
        let reach = way + step(pair);
        while let Some(at) = wanted.next_if(|&at| at <= reach) {
            let share = if reach > way { (at - way) / (reach - way) } else { 0.0 };
            let between = |a: i64, b: i64| a + tenths((b - a) as f64 * share / 10.0);
            marks.push((between(pair[0].0, pair[1].0), between(pair[0].1, pair[1].1)));
        }
        way = reach;
    }
    marks
}

/// The outline of a mark of a radius in pixels about a place.
fn outline(mark: Mark, (x, y): Place, radius: f64) -> String {
    let corners = |degrees: &[f64], radii: &[f64]| {
        let corner = |(index, degree): (usize, &f64)| {
            let radius = radii[index % radii.len()] * radius;
            let (sin, cos) = degree.to_radians().sin_cos();
            let command = if index == 0 { 'M' } else { 'L' };
            let (x, y) = (x + tenths(radius * cos), y - tenths(radius * sin));
            format!("{command}{} {}", number(x), number(y))
        };
        degrees.iter().enumerate().map(corner).collect::<String>() + "Z"
    };
    let r = tenths(radius);
    let stroke = |dx: i64, dy: i64| {
        format!("M{} {}L{} {}", number(x - dx), number(y - dy), number(x + dx), number(y + dy))
    };
    match mark {
        Mark::Circle => {
            let (r, d) = (number(r), number(2 * r));
            format!(
                "M{} {}a{r} {r} 0 1 0 {d} 0a{r} {r} 0 1 0 -{d} 0Z",
                number(x - tenths(radius)),
                number(y)
            )
        }
        Mark::Square => corners(&[45.0, 135.0, 225.0, 315.0], &[1.25]),
        Mark::Triangle => corners(&[90.0, 210.0, 330.0], &[1.35]),
        Mark::Down => corners(&[30.0, 150.0, 270.0], &[1.35]),
        Mark::Diamond => corners(&[0.0, 90.0, 180.0, 270.0], &[1.3]),
        Mark::Star => {
            let degrees: Vec<f64> = (0..10).map(|it| 90.0 + 36.0 * f64::from(it)).collect();
            corners(&degrees, &[1.5, 0.65])
        }
        Mark::Plus => stroke(r, 0) + &stroke(0, r),
        Mark::Cross => stroke(r * 3 / 4, r * 3 / 4) + &stroke(r * 3 / 4, -r * 3 / 4),
    }
}

/// Pixels as whole tenths.
pub(super) fn tenths(pixels: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "pixels of a page")]
    let tenths = (pixels * 10.0).round() as i64;
    tenths
}

/// Tenths as a decimal number.
pub(super) fn number(tenths: i64) -> String {
    let (whole, rest) = (tenths.abs() / 10, tenths.abs() % 10);
    let sign = if tenths < 0 { "-" } else { "" };
    if rest == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{rest}") }
}
