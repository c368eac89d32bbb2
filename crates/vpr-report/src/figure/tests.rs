//! Every figure of the book from synthetic curves of the same shapes: names stay off the curves and
//! inside of the picture, and no two curves of a panel look alike.

mod bars;
mod reading;
mod shown;

use std::collections::BTreeSet;

use vpr_core::Provenance::{Generated, Measured, Published};

use super::{Curve, Figure, Panel, Scale, Shape, multiples::multiples, plan::plan};
use reading::{committed, faults, texts};

const TECHNIQUES: [&str; 10] = [
    "NetVLAD",
    "RegionVLAD",
    "CoHOG",
    "HOG",
    "AlexNet",
    "AMOSNet",
    "HybridNet",
    "CALC",
    "AP-GeM",
    "DenseVLAD",
];
const RUNNING: [&str; 5] =
    ["HOG", "HOG, thesis configuration", "CoHOG", "default network", "NetVLAD, MobileNetV2"];
const ESTIMATORS: [&str; 15] = [
    "L2-distance",
    "PA-Score",
    "SUE",
    "SUE, as released",
    "SUE, eqs. 5.1–5.3",
    "Similarity distribution",
    "Ratio spread",
    "Statistical uncertainty",
    "BTL",
    "STUN",
    "SIFT-RANSAC",
    "XFeat-RANSAC",
    "DISK-RANSAC",
    "Super-RANSAC",
    "DELF-RANSAC",
];

/// Numbers between 0 and 1 that look random and are always the same.
fn noise(seed: usize) -> impl FnMut() -> f64 {
    let mut state = seed as u64 * 7919 + 12345;
    move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1_u64 << 31) as f64
    }
}

/// A precision–recall curve of `n` queries.
fn precision(seed: usize, n: usize) -> Vec<(f64, f64)> {
    let mut random = noise(seed);
    let quality = 0.4 + 0.5 * random();
    let (mut right, mut points) = (0.0, vec![(0.0, 1.0)]);
    for query in 1..=n {
        right += f64::from(random() < quality);
        points.push((query as f64 / n as f64, right / query as f64));
    }
    points
}

fn panel(title: &str, axes: (&str, &str), curves: Vec<Curve>) -> Panel {
    let (x_label, y_label) = (axes.0.to_owned(), axes.1.to_owned());
    Panel { title: title.into(), x_label, y_label, curves, ..Panel::default() }
}

fn chapter_3(title: &str, axes: (&str, &str), n: usize, has_stored: bool) -> Panel {
    let mut curves = Vec::new();
    for (seed, name) in TECHNIQUES.iter().enumerate().filter(|_| has_stored) {
        curves.push(Curve::new(*name, precision(seed, n)).of(Published));
    }
    for (seed, name) in RUNNING.iter().enumerate() {
        let origin = if title.contains("generated") { Generated } else { Measured };
        curves.push(Curve::new(*name, precision(50 + seed, n)).of(origin));
    }
    panel(title, axes, curves)
}

fn curves_of_chapter_3() -> Figure {
    let titles = [
        "SPEDTest",
        "Corridor",
        "GardensPoint thumbnails",
        "ESSEX3IN1 thumbnails",
        "Nordland 64×32, 100 frames",
        "Generated fixture",
        "street (generated)",
        "campus (generated)",
        "corridor (generated)",
        "rail (generated)",
    ];
    let axes = ("recall", "precision");
    let settled = |panel| Panel { settled_from: Some(0.02), ..panel };
    let panels =
        titles.iter().enumerate().map(|(index, title)| chapter_3(title, axes, 1500, index < 2));
    Figure { panels: panels.map(settled).collect() }
}

fn exchanged() -> Figure {
    let ends = |seed: usize| {
        let mut random = noise(seed);
        vec![(0.0, random()), (1.0, random())]
    };
    let curves = RUNNING.iter().enumerate().map(|(seed, name)| Curve::new(*name, ends(seed)));
    let x_ticks = vec![(0.0, "as released".to_owned()), (1.0, "exchanged".to_owned())];
    let panel = panel("Corridor", ("", "AUC-PR (published)"), curves.collect());
    Figure { panels: vec![Panel { x_ticks, ..panel }; 6] }
}

fn speeds() -> Figure {
    let panel = |(index, name): (usize, &&str)| {
        let level = |size: usize| 800.0 / (0.3 + index as f64 + 0.4 * size as f64);
        let mut curves = vec![Curve::new(
            "required",
            (0..60).map(|v| (f64::from(v), 2.0 * f64::from(v))).collect(),
        )];
        for size in [1, 10, 100, 500, 1000, 5000] {
            curves.push(Curve::new(
                format!("Z={size}"),
                vec![(0.0, level(size)), (59.0, level(size))],
            ));
        }
        let panel = panel(name, ("platform speed, m/s", "frames per second"), curves);
        Panel { y_scale: Scale::Log, ..panel }
    };
    Figure { panels: TECHNIQUES.iter().enumerate().map(panel).collect() }
}

fn invariance() -> Figure {
    let scores = |seed: usize, n: usize| {
        let mut random = noise(seed);
        (1..=n).map(|x| (x as f64, random())).collect()
    };
    let mut panels = Vec::new();
    for (index, name) in TECHNIQUES.iter().chain(&RUNNING).enumerate() {
        let title = format!("{name}, multi-illumination (generated): illumination");
        let curves = vec![
            Curve::new("same place", scores(index, 500)),
            Curve::new("other place", scores(index + 40, 500)),
        ];
        panels.push(panel(&title, ("position", "score"), curves));
    }
    Figure { panels }
}

fn estimators(n_panels: usize, names: &[&str]) -> Figure {
    let panel = |index: usize| {
        let curves = names.iter().enumerate();
        let curves = curves.map(|(it, name)| Curve::new(*name, precision(index * 20 + it, 1000)));
        let title = format!("7-Scenes RedKitchen, sequence 01 / netvlad-mobilenetv2-rgb {index}");
        panel(&title, ("recall", "precision"), curves.collect())
    };
    Figure { panels: (0..n_panels).map(panel).collect() }
}

fn sweep() -> Figure {
    let over = |values: &[f64]| {
        let mut panels = Vec::new();
        for (at, dataset) in ["Corridor", "GardensPoint thumbnails", "generated"].iter().enumerate()
        {
            let names = TECHNIQUES.iter().chain(&RUNNING).enumerate();
            let curves = names.map(|(index, name)| {
                let mut random = noise(at * 30 + index);
                let points = values.iter().map(|&x| (x, 0.6 + 0.3 * random())).collect();
                let is_stored = index < TECHNIQUES.len();
                Curve::new(*name, points).of(if is_stored { Published } else { Measured })
            });
            panels.push(panel(&format!("{dataset}, λ = 350"), ("K", "AUC-PR"), curves.collect()));
        }
        panels
    };
    let mut panels = over(&[2.0, 3.0, 5.0, 10.0, 15.0, 20.0]);
    panels.extend(over(&[1.0, 10.0, 100.0, 350.0, 1000.0]).into_iter().map(|panel| Panel {
        x_label: "λ".into(),
        x_scale: Scale::Log,
        ..panel
    }));
    Figure { panels }
}

fn clouds() -> Figure {
    let cloud = |seed: usize, n: usize| {
        let mut random = noise(seed);
        (0..n).map(|_| (random() + random(), -6.0 * random() * random())).collect()
    };
    let one = |index: usize| {
        let line =
            |by: f64| (0..40).map(|x| (f64::from(x) / 20.0, by - f64::from(x) / 10.0)).collect();
        let curves = vec![
            Curve::new("correct", cloud(index, 9000)).shaped(Shape::Points),
            Curve::new("wrong", cloud(index + 9, 3000)).shaped(Shape::Points),
            Curve::new("SVM boundary", line(-0.5)),
            Curve::new("margin, accepted", line(-1.0)),
            Curve::new("margin, rejected", line(0.0)),
        ];
        let axes = ("SIFT-RANSAC, scaled", "log₁₀ of Statistical uncertainty, scaled");
        panel("San Francisco", axes, curves)
    };
    Figure { panels: (0..8).map(one).collect() }
}

fn histograms() -> Figure {
    let points = (0..20).flat_map(|bar: i32| {
        let height = f64::from((bar * 7) % 11) / 60.0;
        [(f64::from(bar), height), (f64::from(bar + 1), height)]
    });
    let axes = ("distance to the nearest neighbour, m", "share");
    let panel = panel("St Lucia, references", axes, vec![Curve::new("", points.collect())]);
    Figure { panels: vec![panel; 6] }
}

fn intervals() -> Figure {
    let one = |title: &str, names: &[&str]| {
        let curves = names.iter().enumerate().map(|(seed, name)| {
            let mut random = noise(seed + 3);
            let points: Vec<(f64, f64)> =
                (0..6).map(|x| (f64::from(x), 0.9 - 0.1 * f64::from(x) + 0.1 * random())).collect();
            let band = points.iter().map(|it| (it.1 - 0.07, it.1 + 0.05)).collect();
            Curve::new(*name, points).within(band)
        });
        let mut panel = panel(title, ("darkness", "recall@1"), curves.collect());
        let thesis = Curve::new(names[0], vec![(2.0, 0.7), (4.0, 0.6)]).shaped(Shape::Thesis);
        panel.curves.push(thesis);
        panel
    };
    Figure { panels: vec![one("darkness", &RUNNING), one("BTL", &["BTL"]), one("few", &["SUE"])] }
}

fn times() -> Figure {
    let sizes = [1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6];
    let curve =
        |name: &str, times: [f64; 7]| Curve::new(name, sizes.into_iter().zip(times).collect());
    let curves = vec![
        curve("1 query", [0.0247, 0.0480, 0.1455, 0.5096, 2.5964, 8.1427, 28.0866]),
        curve("100 queries, per query", [0.0097, 0.0181, 0.0348, 0.0778, 0.2151, 0.6056, 2.7487]),
        curve("one pass over memory", [0.0115, 0.0220, 0.1025, 0.3335, 2.2068, 7.1252, 25.5344]),
    ];
    let panel = panel("References of 128 values", ("references", "milliseconds"), curves);
    Figure { panels: vec![Panel { x_scale: Scale::Log, y_scale: Scale::Log, ..panel }] }
}

/// Every figure of the book, by the file it is like.
fn figures() -> Vec<(&'static str, Figure)> {
    vec![
        ("figure-3.10", curves_of_chapter_3()),
        (
            "figure-3.13",
            Figure {
                panels: vec![chapter_3(
                    "street-new-places (generated)",
                    ("FPR", "TPR"),
                    200,
                    false,
                )],
            },
        ),
        ("figure-3.15", exchanged()),
        ("figure-3.18", speeds()),
        ("figure-3.19", invariance()),
        (
            "figure-5.1",
            estimators(
                1,
                &["L2-distance", "PA-Score", "SUE", "Statistical uncertainty", "SIFT-RANSAC"],
            ),
        ),
        ("figure-5.7", sweep()),
        ("figure-5.8", estimators(3, &ESTIMATORS)),
        ("figure-5.9", histograms()),
        ("figure-5.10", estimators(33, &ESTIMATORS[..8])),
        ("figure-5.11", clouds()),
        ("worlds", intervals()),
        ("search-scaling", times()),
        ("bars", bars::encoders()),
        ("empty", Figure { panels: vec![Panel::default()] }),
        ("none", Figure::default()),
    ]
}

#[test]
fn names_stay_off_the_curves_and_inside_of_the_picture() {
    for (id, figure) in figures() {
        let svg = figure.svg(&format!("{id}: a caption that says what the numbers are"));
        if let Some(folder) = std::env::var_os("VPR_FIGURES") {
            std::fs::write(std::path::Path::new(&folder).join(format!("{id}.svg")), &svg).unwrap();
        }
        assert_eq!(faults(&svg), [""; 0], "{id}");
        assert!(id == "none" || !texts(&svg).is_empty(), "{id}");
    }
}

#[test]
fn committed_figures_are_read_without_a_fault() {
    let committed = committed();
    assert!(committed.len() >= 20, "{} figures", committed.len());
    let of = |(name, svg): &(String, String)| {
        faults(svg).into_iter().map(|fault| format!("{name}: {fault}")).collect::<Vec<_>>()
    };
    assert_eq!(committed.iter().flat_map(of).collect::<Vec<_>>(), [""; 0]);
}

#[test]
fn faults_are_found() {
    let figure = figures().remove(0).1;
    let svg = figure.svg("caption");
    let found = |from: &str, to: &str| {
        assert!(svg.contains(from), "{from}");
        faults(&svg.replacen(from, to, 1)).join("; ")
    };
    let longer = |text: &str, n: usize| {
        found(&format!(">{text}</text>"), &format!(">{}</text>", format!("{text} ").repeat(n)))
    };
    assert!(longer("caption", 99).contains("outside"));
    assert!(longer("AlexNet", 9).contains("over"));
    assert!(found("class=\"l c5\"", "class=\"l c0\"").contains("colour 0 twice"));
}

#[test]
fn no_two_curves_of_a_panel_look_alike_and_eight_are_enough() {
    let mut book: Vec<(String, super::Style)> = Vec::new();
    for (id, figure) in figures() {
        let multiples = multiples(&figure.panels);
        let plan = plan(&multiples, "");
        for multiple in &multiples {
            let names: BTreeSet<&str> =
                multiple.shown.iter().map(|&it| multiple.panel.curves[it].name.as_str()).collect();
            assert!(names.len() <= 8, "{id}");
            let style = |name: &str| plan.styles.iter().find(|it| it.0 == name).unwrap().1;
            let colours: BTreeSet<_> = names.iter().map(|name| style(name).colour).collect();
            assert_eq!(colours.len(), names.len(), "{id}: {names:?}");
        }
        for &(name, style) in &plan.styles {
            if super::style_of(name).is_some() {
                let known = book.iter().find(|it| it.0 == name).map(|it| it.1);
                assert_eq!(known.unwrap_or(style), style, "{id}: {name}");
                book.push((name.to_owned(), style));
            }
        }
    }
}

#[test]
fn every_name_is_told_and_every_curve_drawn() {
    let svg = chapter_3("Corridor", ("recall", "precision"), 100, true);
    let svg = Figure { panels: vec![svg] }.svg("caption");
    for name in TECHNIQUES.iter().chain(&["NetVLAD, MobileNetV2", "recall", "precision", "caption"])
    {
        assert!(svg.contains(&format!(">{name}</text>")), "{name}");
    }
    assert_eq!(svg.matches("class=\"l c").count(), 15);
    assert_eq!(svg.matches("class=\"o\"").count(), 10 + 10 + 10);
}

#[test]
fn hostile_names_and_numbers_are_drawn_safely() {
    let points = vec![(0.0, 1.0), (f64::NAN, 2.0), (1.0, f64::INFINITY), (2.0, 3.0), (3.0, 3.5)];
    let name = format!("<script>alert('\"')</script>{}", "x".repeat(300));
    let curves = vec![Curve::new(name.clone(), points)];
    let panel = Panel { title: name.clone(), x_label: name.clone(), curves, ..Panel::default() };
    let svg = Figure { panels: vec![panel] }.svg(&name);
    assert!(!svg.contains("<script") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
}
