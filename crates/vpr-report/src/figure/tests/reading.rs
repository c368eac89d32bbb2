//! A figure's document read again: where its texts and curves lie, and what is wrong with that.

use crate::figure::text::{BOLD, width};

/// Largest document, in bytes.
const MOST: usize = 300_000;

/// A box, and what is in it.
#[derive(Clone, Debug)]
pub(super) struct Bounds {
    pub(super) what: String,
    x: [f64; 2],
    y: [f64; 2],
}

impl Bounds {
    fn is_within(&self, other: &Self) -> bool {
        let lies = |a: [f64; 2], b: [f64; 2]| a[0] >= b[0] - 0.5 && a[1] <= b[1] + 0.5;
        lies(self.x, other.x) && lies(self.y, other.y)
    }

    fn overlaps(&self, other: &Self) -> bool {
        let meets = |a: [f64; 2], b: [f64; 2]| a[0] < b[1] - 0.5 && b[0] < a[1] - 0.5;
        meets(self.x, other.x) && meets(self.y, other.y)
    }
}

fn attribute<'a>(element: &'a str, name: &str) -> Option<&'a str> {
    let start = element.find(&format!(" {name}=\""))? + name.len() + 3;
    element[start..].split('"').next()
}

/// The box of every text of a document.
pub(super) fn texts(svg: &str) -> Vec<Bounds> {
    let elements = svg.lines().filter(|line| line.starts_with("<text"));
    let of = |line: &str| {
        let (head, rest) = line.split_once('>').unwrap();
        let text = rest.trim_end_matches("</text>").replace("&#39;", "'");
        let get = |name: &str| attribute(head, name).unwrap().parse::<f64>().unwrap();
        let class = attribute(head, "class").unwrap_or_default();
        let size = if class.contains('t') { 12.5 } else { 11.0 };
        let length = width(&text, if class.contains('t') { size * BOLD } else { size });
        let (x, y) = (get("x"), get("y"));
        let back = if class.contains('s') { 0.5 } else { f64::from(class.contains('e')) };
        let start = -back * length;
        if head.contains("rotate(-90") {
            return Bounds {
                what: text,
                x: [x - size * 0.8, x + 2.0],
                y: [y - length - start, y - start],
            };
        }
        Bounds { what: text, x: [x + start, x + start + length], y: [y - size * 0.75, y + 2.0] }
    };
    elements.map(of).collect()
}

/// The boxes of everything that is drawn with one of these classes.
fn drawn(svg: &str, classes: &[char]) -> Vec<Bounds> {
    let elements = svg.lines().filter(|line| {
        line.starts_with("<path")
            && attribute(line, "class").is_some_and(|it| it.starts_with(classes))
    });
    let of = |line: &str| {
        let data = attribute(line, "d").unwrap();
        let mut bounds =
            Bounds { what: line[..line.len().min(40)].into(), x: [1e9, -1e9], y: [1e9, -1e9] };
        for piece in data.split(['M', 'L']).filter(|it| !it.is_empty()) {
            let end = piece.find(|it: char| it.is_ascii_alphabetic()).unwrap_or(piece.len());
            let (x, y) = piece[..end].split_once(' ').unwrap();
            let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
            bounds.x = [bounds.x[0].min(x), bounds.x[1].max(x)];
            bounds.y = [bounds.y[0].min(y), bounds.y[1].max(y)];
        }
        bounds
    };
    elements.filter(|it| !attribute(it, "d").unwrap().is_empty()).map(of).collect()
}

/// The thin lines that lead to names, which run aslant, in short pieces.
fn leaders(svg: &str) -> Vec<Bounds> {
    let elements = svg.lines().filter(|line| line.starts_with("<path class=\"h"));
    let pieces = |line: &str| {
        let data = attribute(line, "d").unwrap().replace(['M', 'L'], " ");
        let ends: Vec<f64> = data.split_whitespace().map(|it| it.parse().unwrap()).collect();
        let at = |share: f64| [0, 1].map(|it| ends[it] + share * (ends[it + 2] - ends[it]));
        let piece = |index: u32| {
            let [from, to] = [index, index + 1].map(|it| at(f64::from(it) / 16.0));
            let side = |it: usize| [from[it].min(to[it]), from[it].max(to[it])];
            Bounds { what: "a line to a name".into(), x: side(0), y: side(1) }
        };
        (0..16).map(piece).collect::<Vec<_>>()
    };
    elements.flat_map(pieces).collect()
}

/// The plots of a document, by their axes.
fn plots(svg: &str) -> Vec<Bounds> {
    let axes = svg.lines().filter(|line| line.starts_with("<path class=\"a\""));
    let of = |line: &str| {
        let data =
            attribute(line, "d").unwrap().trim_start_matches('M').replace([' ', 'V', 'H'], " ");
        let ends: Vec<f64> = data.split(' ').map(|it| it.parse().unwrap()).collect();
        Bounds { what: "a plot".into(), x: [ends[0], ends[3]], y: [ends[1], ends[2]] }
    };
    axes.map(of).collect()
}

/// The colours of the curves in a plot, one for each curve: a line with its marks, scattered points, or
/// bars, which follow each other.
fn colours(svg: &str, plot: &Bounds) -> Vec<String> {
    let mut colours: Vec<String> = Vec::new();
    let mut is_line_before = false;
    let is_bar = |it: &str| it.split(" d=").nth(1).is_some_and(|path| path.contains('V'));
    for curve in drawn(svg, &['l', 'p', 'm', 'x']).iter().filter(|it| it.is_within(plot)) {
        let (kind, colour) = attribute(&curve.what, "class").unwrap().split_once(" c").unwrap();
        let is_marks = is_line_before && matches!(kind, "m" | "x");
        let is_more = is_marks || is_bar(&curve.what);
        if !(is_more && colours.last().is_some_and(|it| it == colour)) {
            colours.push(colour.to_owned());
        }
        is_line_before = kind == "l";
    }
    colours
}

/// What a reader would complain about: texts outside of the picture, over curves or over each
/// other, a colour twice in a plot, too many bytes.
pub(super) fn faults(svg: &str) -> Vec<String> {
    let mut faults = Vec::new();
    if svg.len() > MOST {
        faults.push(format!("{} bytes", svg.len()));
    }
    let root = svg.lines().next().unwrap();
    let side = |name: &str| attribute(root, name).unwrap().parse::<f64>().unwrap();
    let picture =
        Bounds { what: "the picture".into(), x: [0.0, side("width")], y: [0.0, side("height")] };
    let texts = texts(svg);
    let mut curves = drawn(svg, &['l', 'p', 'b', 'o', 'm', 'x', 'w']);
    curves.extend(leaders(svg));
    for (index, text) in texts.iter().enumerate() {
        if !text.is_within(&picture) {
            faults.push(format!("{} is outside of the picture", text.what));
        }
        let others = curves.iter().chain(&texts[..index]).filter(|it| it.overlaps(text));
        faults.extend(others.map(|it| format!("{text:?} lies over {it:?}")));
    }
    for (nth, plot) in plots(svg).iter().enumerate() {
        let mut colours = colours(svg, plot);
        colours.sort_unstable();
        let twice = colours.windows(2).filter(|it| it[0] == it[1]);
        faults.extend(twice.map(|it| format!("colour {} twice in plot {nth}", it[0])));
    }
    faults
}

/// The figures in `docs/results`, by file name, in order.
pub(super) fn committed() -> Vec<(String, String)> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/results");
    let files = std::fs::read_dir(folder).unwrap().map(|it| it.unwrap().path());
    let mut figures: Vec<(String, String)> = files
        .filter(|path| path.extension().is_some_and(|it| it == "svg"))
        .map(|path| {
            (
                path.file_name().unwrap().to_string_lossy().into_owned(),
                std::fs::read_to_string(&path).unwrap(),
            )
        })
        .collect();
    figures.sort_unstable();
    figures
}
