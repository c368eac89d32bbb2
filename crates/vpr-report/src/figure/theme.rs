//! Colours and marks, one pair per technique through all figures.

/// Okabe and Ito's colours, which stay apart for colour-blind eyes; the light ones are darkened to
/// a contrast of three to one on white (WCAG 2.2, 1.4.11).
pub const COLOURS: [&str; 8] =
    ["#0072b2", "#d55e00", "#00875f", "#b8559a", "#b87d00", "#2b8fcb", "#7d7300", "#222222"];

/// The same hues on a dark ground.
pub const DARK_COLOURS: [&str; 8] =
    ["#5aaeea", "#ff8a3d", "#2cc596", "#e39ac9", "#f0b030", "#8fd0f7", "#d6ca3c", "#e6e6e6"];

/// A shape that tells curves apart without colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Mark {
    /// ●
    Circle,
    /// ■
    Square,
    /// ▲
    Triangle,
    /// ◆
    Diamond,
    /// ▼
    Down,
    /// ×
    Cross,
    /// +
    Plus,
    /// ★
    Star,
}

use Mark::{Circle, Cross, Diamond, Down, Plus, Square, Star, Triangle};

const MARKS: [Mark; 8] = [Circle, Square, Triangle, Diamond, Down, Cross, Plus, Star];

/// How a curve looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Style {
    /// Index into [`COLOURS`].
    pub colour: usize,
    /// The mark on the line.
    pub mark: Mark,
}

/// Techniques and estimators by their columns, and the two sides of judged matches. Those that
/// share panels have different colours, as far as eight reach.
const KNOWN: [(&str, usize, Mark); 51] = [
    ("NetVLAD", 0, Circle),
    ("RegionVLAD", 5, Square),
    ("CoHOG", 1, Triangle),
    ("HOG", 2, Diamond),
    ("AlexNet", 3, Down),
    ("AMOSNet", 4, Plus),
    ("HybridNet", 2, Triangle),
    ("CALC", 7, Cross),
    ("AP-GeM", 5, Cross),
    ("DenseVLAD", 3, Plus),
    ("HOG, thesis configuration", 3, Square),
    ("default network", 7, Circle),
    ("NetVLAD, MobileNetV2", 0, Square),
    ("L2-distance", 7, Square),
    ("PA-Score", 4, Triangle),
    ("SUE", 0, Star),
    ("SUE, as released", 5, Star),
    ("SUE, eqs. 5.1–5.3", 3, Star),
    ("Similarity distribution", 1, Square),
    ("Ratio spread", 6, Plus),
    ("Statistical uncertainty", 2, Circle),
    ("BTL", 6, Square),
    ("STUN", 5, Plus),
    ("SIFT-RANSAC", 1, Circle),
    ("XFeat-RANSAC", 3, Triangle),
    ("DISK-RANSAC", 0, Plus),
    ("Super-RANSAC", 4, Down),
    ("DELF-RANSAC", 7, Star),
    ("correct", 0, Triangle),
    ("wrong", 1, Diamond),
    ("same place", 0, Diamond),
    ("other place", 4, Cross),
    ("SVM boundary", 7, Plus),
    ("margin, accepted", 2, Cross),
    ("margin, rejected", 3, Cross),
    ("required", 7, Triangle),
    ("netvlad", 0, Down),
    ("netvlad-mobilenetv2-gray", 0, Cross),
    ("boq-dinov2", 2, Down),
    ("boq-resnet50", 2, Plus),
    ("salad", 3, Diamond),
    ("mixvpr", 4, Star),
    ("cosplace", 5, Circle),
    ("cosplace-resnet18", 5, Triangle),
    ("cosplace-resnet101", 5, Diamond),
    ("cosplace-vgg16", 5, Down),
    ("eigenplaces", 6, Circle),
    ("eigenplaces-resnet18", 6, Triangle),
    ("eigenplaces-resnet101", 6, Diamond),
    ("eigenplaces-vgg16", 6, Down),
    ("cricavpr", 7, Diamond),
];

/// What a technique is called where it is typed, and its column.
const ALIASES: [(&str, &str); 5] = [
    ("hog", "HOG"),
    ("hog-thesis", "HOG, thesis configuration"),
    ("cohog", "CoHOG"),
    ("default", "default network"),
    ("netvlad-mobilenetv2-rgb", "NetVLAD, MobileNetV2"),
];

/// The style of a technique or estimator that has one everywhere.
#[must_use]
pub fn style_of(name: &str) -> Option<Style> {
    let name = name.trim_end_matches(", stored scores");
    let name = ALIASES.iter().find(|it| it.0 == name).map_or(name, |it| it.1);
    let &(_, colour, mark) = KNOWN.iter().find(|it| it.0 == name)?;
    Some(Style { colour, mark })
}

/// One style per name of these panels, the same for the same panels: known names have their own,
/// others take what is left, a colour that nobody in their panels has as long as there is one.
pub(crate) fn styles<'a>(panels: &[Vec<&'a str>]) -> Vec<(&'a str, Style)> {
    let mut styles: Vec<(&str, Style)> = Vec::new();
    for &name in panels.iter().flatten() {
        match style_of(name) {
            Some(style) if styles.iter().all(|it| it.0 != name) => styles.push((name, style)),
            _ => {}
        }
    }
    for &name in panels.iter().flatten() {
        if styles.iter().any(|it| it.0 == name) {
            continue;
        }
        let beside: Vec<&str> =
            panels.iter().filter(|panel| panel.contains(&name)).flatten().copied().collect();
        let is_new = |style: &Style| styles.iter().all(|it| it.1 != *style);
        let uses = |colour: usize| {
            let same = || styles.iter().filter(|it| it.1.colour == colour);
            (same().filter(|it| beside.contains(&it.0)).count(), same().count())
        };
        // Column by column through the square of colours and marks.
        let all = (0..64).map(|it| Style { colour: it % 8, mark: MARKS[(it + it / 8) % 8] });
        let free = all.filter(is_new).min_by_key(|style| uses(style.colour));
        // Beyond 64 names styles repeat.
        styles.push((name, free.unwrap_or(Style { colour: styles.len() % 8, mark: Circle })));
    }
    styles
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance of a colour (WCAG 2.2).
    fn luminance(colour: &str) -> f64 {
        let channel = |at: usize| {
            let value = f64::from(u8::from_str_radix(&colour[at..at + 2], 16).unwrap()) / 255.0;
            if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5)
    }

    fn contrast(a: &str, b: &str) -> f64 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn colours_stand_out_from_their_ground() {
        assert!((contrast("#ffffff", "#000000") - 21.0).abs() < 1e-9);
        for (light, dark) in COLOURS.iter().zip(DARK_COLOURS) {
            assert!(contrast(light, "#ffffff") >= 3.0, "{light}: {}", contrast(light, "#ffffff"));
            assert!(contrast(dark, "#14171c") >= 4.5, "{dark}");
        }
    }

    #[test]
    fn no_two_known_names_look_the_same() {
        for (index, (name, colour, mark)) in KNOWN.iter().enumerate() {
            let same = KNOWN[..index].iter().find(|it| (it.1, it.2) == (*colour, *mark));
            assert_eq!(same, None, "{name}");
        }
        assert!(ALIASES.iter().all(|(_, column)| style_of(column).is_some()));
    }

    #[test]
    fn unknown_names_take_free_colours_first() {
        let names = ["SUE", "Z=1", "Z=10", "Z=100", "Z=500", "Z=1000", "Z=5000", "required"];
        let styles = styles(&[names.to_vec()]);
        let mut colours: Vec<usize> = styles.iter().map(|it| it.1.colour).collect();
        colours.sort_unstable();
        colours.dedup();
        assert_eq!(colours.len(), 8, "{styles:?}");
        assert_eq!(styles[0], ("SUE", style_of("SUE").unwrap()));
        assert_eq!(style_of("default"), style_of("default network"));
        assert_eq!(style_of("HOG, stored scores"), style_of("HOG"));
    }
}
