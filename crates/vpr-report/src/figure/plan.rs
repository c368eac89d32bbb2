//! Where everything in a figure stands: panels in a grid, names beside or above them, nothing over
//! a curve.

use super::{
    Shape,
    apart::apart,
    axis::Axis,
    bars::reach,
    multiples::Multiple,
    text::{BOLD, width, wrap},
    theme::{Style, styles},
    visible::visible,
};

/// Font sizes in pixels, and from one line to the next.
pub(super) const TITLE: f64 = 12.5;
pub(super) const TEXT: f64 = 11.0;
const LINE: f64 = 14.0;
/// Margin of the figure, gap between panels.
const MARGIN: f64 = 10.0;
/// Between the frame of a plot and its outermost points.
const INSET: f64 = 6.0;
/// Longest name before it is broken, in pixels.
const NAME: f64 = 150.0;
/// Room for a mark before a name.
const KEY: f64 = 22.0;

/// A rectangle in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

/// Which point of a text lies at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A line of text.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Text {
    pub(super) x: f64,
    /// Its base line.
    pub(super) y: f64,
    pub(super) content: String,
    pub(super) anchor: Anchor,
    pub(super) is_title: bool,
    /// Whether it is read from below.
    pub(super) is_turned: bool,
}

/// The mark before a name, and the thin line that leads to its curve's end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Key {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) style: Style,
    /// How its curve is drawn.
    pub(super) shape: Shape,
    pub(super) leader: Option<(f64, f64)>,
}

/// One coordinate system.
pub(super) struct Frame<'a> {
    pub(super) multiple: &'a Multiple<'a>,
    pub(super) plot: Rect,
    pub(super) x: Axis,
    pub(super) y: Axis,
}

/// The whole figure.
pub(super) struct Plan<'a> {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) texts: Vec<Text>,
    pub(super) keys: Vec<Key>,
    pub(super) frames: Vec<Frame<'a>>,
    pub(super) styles: Vec<(&'a str, Style)>,
}

impl Frame<'_> {
    /// A point in pixels; `None` if it cannot be shown.
    pub(super) fn place(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        Some(self.pixels((self.x.share(x)?, self.y.share(y)?)))
    }

    fn pixels(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let Rect { x: left, y: top, width, height } = self.plot;
        (left + INSET + x * (width - 2.0 * INSET), top + INSET + (1.0 - y) * (height - 2.0 * INSET))
    }

    /// What can be seen of the straight lines between points, in pixels: unbroken pieces.
    pub(super) fn pieces(&self, points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
        let shares = points.iter().map(|&(x, y)| Some((self.x.beyond(x)?, self.y.beyond(y)?)));
        let pixels = |piece: Vec<(f64, f64)>| piece.into_iter().map(|it| self.pixels(it)).collect();
        visible(shares).into_iter().map(pixels).collect()
    }
}

/// Columns, and the size of a plot.
fn grid(n: usize) -> (usize, f64, f64) {
    match n {
        0 | 1 => (1, 460.0, 300.0),
        2..=4 => (2, 320.0, 225.0),
        5..=9 => (3, 255.0, 180.0),
        _ => (4, 205.0, 150.0),
    }
}

/// The names of the curves in colour, panel by panel, in order.
fn names<'a>(multiples: &'a [Multiple<'a>]) -> Vec<Vec<&'a str>> {
    let names = |it: &'a Multiple<'a>| {
        it.shown.iter().map(|&index| it.panel.curves[index].name.as_str()).collect()
    };
    multiples.iter().map(names).collect()
}

fn is_said(multiple: &Multiple<'_>, name: &str) -> bool {
    name.is_empty() || (multiple.shown.len() == 1 && name == multiple.panel.title)
}

/// Puts everything in its place.
pub(super) fn plan<'a>(multiples: &'a [Multiple<'a>], caption: &str) -> Plan<'a> {
    let (columns, plot_width, plot_height) = grid(multiples.len());
    let styles = styles(&names(multiples));
    let is_apart = |it: &Multiple<'_>| {
        let mut shapes = it.shown.iter().map(|&index| it.panel.curves[index].shape);
        shapes.any(|it| matches!(it, Shape::Points | Shape::Bars))
    };
    let is_direct = multiples.len() <= 4 && !multiples.iter().any(is_apart);
    let axes: Vec<(Axis, Axis)> =
        multiples.iter().map(|it| axes(it, plot_width, plot_height)).collect();
    let y_lines: Vec<Vec<String>> =
        multiples.iter().map(|it| wrap(&it.panel.y_label, TEXT, plot_height, 3)).collect();
    let tick_width = axes
        .iter()
        .flat_map(|(_, y)| y.ticks.iter().map(|it| width(&it.1, TEXT)))
        .fold(12.0, f64::max);
    let left = tick_width + 8.0 + LINE * y_lines.iter().map(Vec::len).max().unwrap_or(0) as f64;
    let right = if is_direct { label_width(multiples) } else { 18.0 };
    let cell = left + plot_width + right;
    let n_columns = columns.min(multiples.len().max(1));
    let mut plan = Plan {
        width: 2.0 * MARGIN + n_columns as f64 * cell,
        height: 0.0,
        texts: Vec::new(),
        keys: Vec::new(),
        frames: Vec::new(),
        styles,
    };
    let mut top = head(&mut plan, multiples, caption, is_direct);
    let shares_y = all_same(multiples.iter().map(|it| it.panel.y_label.as_str()));
    for (row, (multiples, axes)) in multiples.chunks(columns).zip(axes.chunks(columns)).enumerate()
    {
        let titles = titles(multiples, plot_width + right - 10.0, n_columns);
        let title_height = LINE * titles.iter().map(Vec::len).max().unwrap_or(0) as f64;
        let y = top + title_height + 6.0;
        let mut bottom = 0.0_f64;
        for (column, (multiple, (x_axis, y_axis))) in multiples.iter().zip(axes).enumerate() {
            let x = MARGIN + column as f64 * cell + left;
            let plot = Rect { x, y, width: plot_width, height: plot_height };
            // Titles stand on their plots.
            let first = y - 6.0 - LINE * titles[column].len() as f64;
            for (line, title) in titles[column].iter().enumerate() {
                plan.line(x, first + 11.0 + LINE * line as f64, title, Anchor::Start, true);
            }
            if column == 0 || !shares_y {
                let lines = &y_lines[row * columns + column];
                plan.turned(plot, x - tick_width - 12.0, lines);
            }
            let frame = Frame { multiple, plot, x: x_axis.clone(), y: y_axis.clone() };
            bottom = bottom.max(plan.numbers(&frame));
            if is_direct {
                plan.ends(&frame);
            }
            plan.frames.push(frame);
        }
        top += title_height + 6.0 + plot_height + bottom + 14.0;
    }
    plan.height = top - 14.0 + MARGIN;
    plan
}

/// Titles of a row of panels, in lines. Beside a panel there is room up to the next one's plot, beside
/// the last one there is none.
fn titles(multiples: &[Multiple<'_>], width: f64, n_columns: usize) -> Vec<Vec<String>> {
    let size = |column: usize| if column + 1 == n_columns { TITLE * BOLD } else { TITLE };
    let lines = |(column, it): (usize, &Multiple<'_>)| wrap(&it.title, size(column), width, 4);
    multiples.iter().enumerate().map(lines).collect()
}

fn all_same<'a>(mut items: impl Iterator<Item = &'a str>) -> bool {
    let first = items.next();
    items.all(|it| Some(it) == first)
}

/// Axes over all curves of a panel, also those that are grey.
fn axes(multiple: &Multiple<'_>, plot_width: f64, plot_height: f64) -> (Axis, Axis) {
    let panel = multiple.panel;
    let finite = |point: &&(f64, f64)| point.0.is_finite() && point.1.is_finite();
    let points = || panel.curves.iter().flat_map(|it| it.points.iter().filter(finite));
    let is_settled = |x: f64| panel.settled_from.is_none_or(|from| x >= from);
    let settled = || points().filter(|point| is_settled(point.0));
    let heights = if settled().next().is_some() {
        settled().map(|it| it.1).collect()
    } else {
        points().map(|it| it.1).collect::<Vec<_>>()
    };
    let bands = panel.curves.iter().flat_map(|it| it.band.iter().flat_map(|it| [it.0, it.1]));
    let bars = reach(&panel.curves);
    let sides = bars.iter().flat_map(|it| it.0);
    let xs = points().map(|it| it.0).chain(sides);
    let ys = heights.into_iter().chain(bands).chain(bars.map(|it| it.1));
    (
        Axis::over(xs, panel.x_scale, plot_width / 60.0, &panel.x_ticks),
        Axis::over(ys, panel.y_scale, plot_height / 42.0, &[]),
    )
}

/// Room for names beside the ends of curves.
fn label_width(multiples: &[Multiple<'_>]) -> f64 {
    let names = multiples.iter().flat_map(|it| {
        let names = it.shown.iter().map(|&index| it.panel.curves[index].name.as_str());
        names.filter(|name| !is_said(it, name))
    });
    let lines = names.flat_map(|name| wrap(name, TEXT, NAME, 2));
    lines.map(|line| width(&line, TEXT) + KEY + 16.0).fold(18.0, f64::max)
}

/// Caption, legend and notes above the panels; where the panels begin.
fn head(plan: &mut Plan<'_>, multiples: &[Multiple<'_>], caption: &str, is_direct: bool) -> f64 {
    let limit = plan.width - 2.0 * MARGIN;
    let mut y = MARGIN;
    for line in wrap(caption, TITLE * BOLD, limit, 3) {
        plan.line(MARGIN, y + 11.0, &line, Anchor::Start, true);
        y += LINE + 2.0;
    }
    let curves = || {
        multiples.iter().flat_map(|it| it.shown.iter().map(move |&index| &it.panel.curves[index]))
    };
    let is_any_hollow = curves().any(|it| it.shape == Shape::Thesis);
    let mut entries: Vec<(&str, Style, Shape)> = Vec::new();
    if !is_direct {
        let unsaid = |name: &str| {
            multiples.iter().any(|it| {
                let is_here = it.shown.iter().any(|&index| it.panel.curves[index].name == name);
                is_here && !is_said(it, name)
            })
        };
        let shape =
            |name: &str| curves().find(|it| it.name == name).map_or(Shape::Line, |it| it.shape);
        let styles = plan.styles.iter().filter(|it| unsaid(it.0));
        entries.extend(styles.map(|&(name, style)| (name, style, shape(name))));
    }
    if is_any_hollow {
        let style = plan.styles.first().map(|it| it.1);
        entries.extend(style.map(|style| ("hollow: the thesis", style, Shape::Thesis)));
    }
    let mut x = MARGIN;
    for (name, style, shape) in entries {
        let name = wrap(name, TEXT, limit - KEY, 1).concat();
        let length = KEY + width(&name, TEXT);
        if x > MARGIN && x + length > plan.width - MARGIN {
            (x, y) = (MARGIN, y + LINE + 2.0);
        }
        plan.keys.push(Key { x: x + KEY / 2.0 - 2.0, y: y + 8.0, style, shape, leader: None });
        plan.line(x + KEY, y + 12.0, &name, Anchor::Start, false);
        x += length + 14.0;
    }
    if x > MARGIN {
        y += LINE + 2.0;
    }
    let mut notes = Vec::new();
    if curves().any(|it| !it.band.is_empty()) {
        notes.push("Bands are 95 % intervals.");
    }
    if multiples.iter().any(|it| !it.grey.is_empty()) {
        notes.push("Grey: the other curves of the same panel, for comparison.");
    }
    let settled = multiples.iter().find_map(|it| Some((&it.panel.x_label, it.panel.settled_from?)));
    let settled = settled.map(|(x, from)| format!("Below {x} {from} curves may leave the panel."));
    notes.extend(settled.as_deref());
    for line in wrap(&notes.join(" "), TEXT, limit, 3) {
        plan.line(MARGIN, y + 11.0, &line, Anchor::Start, false);
        y += LINE;
    }
    y + 6.0
}

impl Plan<'_> {
    fn line(&mut self, x: f64, y: f64, text: &str, anchor: Anchor, is_title: bool) {
        let content = text.to_owned();
        self.texts.push(Text { x, y, content, anchor, is_title, is_turned: false });
    }

    /// The label of a vertical axis, its last line at `x`.
    fn turned(&mut self, plot: Rect, x: f64, lines: &[String]) {
        let y = plot.y + plot.height / 2.0;
        for (index, line) in lines.iter().rev().enumerate() {
            self.texts.push(Text {
                x: x - LINE * index as f64,
                y,
                content: line.clone(),
                anchor: Anchor::Middle,
                is_title: false,
                is_turned: true,
            });
        }
    }

    /// Numbers beside both axes and the name of the horizontal one; the height of what is below the
    /// plot.
    fn numbers(&mut self, frame: &Frame<'_>) -> f64 {
        let Rect { x, y, width: plot_width, height } = frame.plot;
        let (inner_width, inner_height) = (plot_width - 2.0 * INSET, height - 2.0 * INSET);
        for (share, text) in &frame.y.ticks {
            let at = y + INSET + (1.0 - share) * inner_height + 4.0;
            self.line(x - 6.0, at, text, Anchor::End, false);
        }
        let mut taken = f64::NEG_INFINITY;
        let is_named = !frame.multiple.panel.x_ticks.is_empty();
        for (share, text) in &frame.x.ticks {
            let at = x + INSET + share * inner_width;
            let length = width(text, TEXT);
            let (anchor, from) = match (is_named, *share) {
                (true, share) if share < 0.1 => (Anchor::Start, at),
                (true, share) if share > 0.9 => (Anchor::End, at - length),
                _ => (Anchor::Middle, at - length / 2.0),
            };
            if from > taken + 6.0 {
                self.line(at, y + height + 15.0, text, anchor, false);
                taken = from + length;
            }
        }
        let lines = wrap(&frame.multiple.panel.x_label, TEXT, plot_width, 3);
        for (index, line) in lines.iter().enumerate() {
            let at = y + height + 30.0 + LINE * index as f64;
            self.line(x + plot_width / 2.0, at, line, Anchor::Middle, false);
        }
        20.0 + LINE * lines.len() as f64
    }

    /// Names beside the ends of curves, pushed apart.
    fn ends(&mut self, frame: &Frame<'_>) {
        let mut labels: Vec<(f64, Style, Vec<String>)> = Vec::new();
        for &index in &frame.multiple.shown {
            let curve = &frame.multiple.panel.curves[index];
            let is_last = |a: &(f64, f64), b: &(f64, f64)| a.0.total_cmp(&b.0);
            let places = curve.points.iter().filter_map(|&point| frame.place(point));
            let Some((_, end)) = places.max_by(is_last) else { continue };
            let style = self.styles.iter().find(|it| it.0 == curve.name).map(|it| it.1);
            if let (Some(style), false) = (style, is_said(frame.multiple, &curve.name))
                && labels.iter().all(|it| it.1 != style)
            {
                labels.push((end, style, wrap(&curve.name, TEXT, NAME, 2)));
            }
        }
        labels.sort_by(|a, b| a.0.total_cmp(&b.0));
        let heights: Vec<f64> = labels.iter().map(|it| LINE * it.2.len() as f64).collect();
        let wanted: Vec<f64> = labels.iter().map(|it| it.0).collect();
        let plot = frame.plot;
        let placed = apart(&wanted, &heights, plot.y - 4.0, plot.y + plot.height + 20.0);
        let edge = plot.x + plot.width;
        for (((end, style, lines), middle), height) in labels.iter().zip(placed).zip(heights) {
            let leader = Some((edge + 1.0, *end));
            let key = Key { x: edge + 20.0, y: middle, style: *style, shape: Shape::Line, leader };
            self.keys.push(key);
            for (index, line) in lines.iter().enumerate() {
                let at = middle - height / 2.0 + 11.0 + LINE * index as f64;
                self.line(edge + 30.0, at, line, Anchor::Start, false);
            }
        }
    }
}
