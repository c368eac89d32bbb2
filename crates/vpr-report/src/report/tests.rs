//! Reports of synthetic runs: nothing hostile gets through, nothing needed is missing, and large
//! ones stay within their budget.

mod shown;

use std::cell::RefCell;

use vpr_core::{GroundTruth, Poses};

use super::*;

fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(7919) + 12345;
    move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1_u64 << 31) as f64
    }
}

/// `n` queries along a road of `n` references, and a truth of three references each.
struct Road {
    poses: Poses,
    truth: GroundTruth,
}

impl Road {
    fn new(n: usize) -> Self {
        let at = |it: usize| {
            let turn = it as f64 / 40.0;
            [4.0 * it as f64 + 30.0 * turn.sin(), 200.0 * turn.cos()].into()
        };
        let poses = Poses::Planar((0..n).map(at).collect());
        Self { poses, truth: GroundTruth::within_frames(n, n, 1) }
    }

    fn dataset(&self) -> Dataset<'_> {
        let names = |side: &str| {
            (0..self.truth.len()).map(|it| format!("data/road/{side}/{it:06}.jpg")).collect()
        };
        Dataset {
            name: "road".into(),
            queries: names("query"),
            references: names("ref"),
            poses: Some((&self.poses, &self.poses)),
            truth: Some(&self.truth),
            thumbnails: None,
            similarities: None,
        }
    }

    fn run(&self, name: &str, k: usize, seed: u64) -> Run {
        let n = self.truth.len();
        let mut random = noise(seed);
        let (mut matches, mut uncertainty) = (Vec::new(), Vec::new());
        for query in 0..n {
            let is_right = random() < 0.75;
            let mut distance = if is_right { 0.2 } else { 0.5 } + 0.4 * random();
            uncertainty.push(distance * (0.8 + 0.4 * random()));
            matches.push(
                (0..k)
                    .map(|rank| {
                        distance += 0.02 * random();
                        let far = query + n / 2 + rank * 7;
                        let reference = if is_right && rank == 0 { query } else { far % n };
                        Match { reference, distance, inliers: Some(rank) }
                    })
                    .collect(),
            );
        }
        Run { name: name.into(), matches, uncertainty: Some(uncertainty), ..Run::default() }
    }
}

fn report(dataset: Dataset<'_>, runs: Vec<Run>) -> Report<'_> {
    let facts = vec![("command".to_owned(), "bench evaluate --dataset road".to_owned())];
    Report { title: "Road".into(), facts, datasets: vec![dataset], runs, budget: Some(BUDGET) }
}

fn text(report: &Report<'_>) -> String {
    let mut bytes = Vec::new();
    report.write(&mut bytes).unwrap();
    if let Some(folder) = std::env::var_os("VPR_FIGURES") {
        let name = format!("report-{}.html", report.datasets[0].queries.len());
        std::fs::write(std::path::Path::new(&folder).join(name), &bytes).unwrap();
    }
    String::from_utf8(bytes).unwrap()
}

/// The JSON of an element of the report.
fn embedded(html: &str, id: &str) -> serde_json::Value {
    let head = format!("<script type=\"application/json\" id=\"{id}\">");
    let json = html.split(&head).nth(1).unwrap().split("</script>").next().unwrap();
    serde_json::from_str(json).unwrap()
}

#[test]
fn two_runs_stand_side_by_side() {
    let road = Road::new(300);
    let size = RefCell::new(Vec::new());
    let thumbnails = |asked: &[(Side, usize)], side: u32| {
        size.borrow_mut().push(side);
        let grey = |it: &(Side, usize)| {
            let level = |at: usize| u8::try_from((at * 5 + it.1) % 256).unwrap();
            Ok(png::grey(40, 30, &(0..1200).map(level).collect::<Vec<u8>>()))
        };
        asked.iter().map(grey).collect()
    };
    let dataset = Dataset { thumbnails: Some(&thumbnails), ..road.dataset() };
    let runs = vec![road.run("HOG", 5, 1), Run { threshold: Some(0.4), ..road.run("CoHOG", 5, 2) }];
    let html = text(&report(dataset, runs));
    for part in ["recall@5", "bench evaluate --dataset road", "only first", "from above", "✗ wrong"]
    {
        assert!(html.contains(part), "{part}");
    }
    assert!(!html.contains("from the side"), "a road in the plane has none");
    assert_eq!(html.matches("class=\"line c2\" data-name=\"HOG\"").count(), 4, "four curves");
    let data = embedded(&html, "data");
    let run = &data["runs"][1];
    assert_eq!((run["th"].as_f64(), run["p"][7].as_array().map(Vec::len)), (Some(0.4), Some(5)));
    let right = |flags: &serde_json::Value| flags.as_str().unwrap().starts_with('1');
    let n_right = run["ok"].as_array().unwrap().iter().filter(|it| right(it)).count();
    let share = format!("{:.3} <small>", n_right as f64 / 300.0);
    assert!(html.contains(&share), "recall@1 is {share}");
    // All pictures fit, each once, and the file says so.
    assert!(size.borrow().iter().all(|it| *it == 200), "{:?}", size.borrow());
    let here = embedded(&html, "pictures")["here"].as_array().unwrap().len();
    assert_eq!(here, html.matches("background-image:url(data:image/png").count());
    assert_eq!(here, 600, "300 queries, 300 references");
}

#[test]
fn hostile_names_do_nothing() {
    let road = Road::new(4);
    let evil = "</script><script>alert(1)</script>\"'><img src=x onerror=alert(2)>\u{202e}";
    let long = "x".repeat(300);
    let thumbnails = |asked: &[(Side, usize)], _: u32| {
        asked.iter().map(|_| Err(format!("no image: {evil}"))).collect::<Vec<_>>()
    };
    let mut dataset = Dataset { thumbnails: Some(&thumbnails), ..road.dataset() };
    dataset.name = evil.into();
    dataset.queries = vec![evil.into(), long.clone(), "é/ü".into(), String::new()];
    dataset.references = dataset.queries.clone();
    let mut run = road.run(evil, 3, 1);
    run.estimator = Some(evil.into());
    let mut report = report(dataset, vec![run.clone(), Run { name: long, ..run }]);
    report.title = evil.into();
    report.facts.push((evil.into(), evil.into()));
    let html = text(&report);
    assert!(!html.contains("<script>alert") && !html.contains("<img"), "an element was made");
    assert_eq!(html.matches("</script>").count(), 3, "data, pictures and the script");
    assert!(html.contains("cannot be read"));
    let data = embedded(&html, "data");
    assert_eq!(data["datasets"][0]["q"][0], evil);
    assert_eq!(embedded(&html, "pictures")["bad"]["q0-0"], format!("no image: {evil}"));
}

#[test]
fn what_is_not_known_is_said_not_invented() {
    let road = Road::new(1);
    let mut dataset = road.dataset();
    (dataset.poses, dataset.truth) = (None, None);
    let matches = vec![vec![Match { reference: 0, distance: f64::NAN, inliers: None }]];
    let run = Run { name: "HOG".into(), matches, ..Run::default() };
    let html = text(&report(dataset, vec![run]));
    for absent in ["id=\"map\"", "id=\"curves\"", "id=\"pairs\"", "NaN", "recall@5"] {
        assert!(!html.split("<script>").next().unwrap().contains(absent), "{absent}");
    }
    for part in
        ["without truth, positions, pictures", "not judged", "not a number", "no picture here"]
    {
        assert!(html.contains(part), "{part}");
    }
    assert_eq!(embedded(&html, "data")["runs"][0]["u"][0], serde_json::Value::Null);
    // Nothing at all is a report too.
    let road = Road::new(2);
    assert!(text(&report(road.dataset(), Vec::new())).contains("2 queries"));
}

#[test]
fn a_run_that_does_not_fit_its_dataset_is_refused() {
    let road = Road::new(3);
    let mut run = road.run("HOG", 2, 1);
    run.matches[1][0].reference = 3;
    let refused = |run: &Run| {
        let err = report(road.dataset(), vec![run.clone()]).write(&mut Vec::new()).unwrap_err();
        err.to_string()
    };
    assert!(refused(&run).contains("reference 3 of 3"));
    run.matches.pop();
    assert!(refused(&run).contains("2 lists of matches for 3"));
    assert!(refused(&Run { dataset: 7, ..run }).contains("no dataset 7"));
}

#[test]
fn a_large_report_keeps_its_budget_and_the_most_telling_pictures() {
    let road = Road::new(2000);
    let thumbnails = |asked: &[(Side, usize)], side: u32| {
        let side = side as usize;
        asked.iter().map(|_| Ok(png::grey(side, side / 2, &vec![99; side * side / 2]))).collect()
    };
    let dataset = Dataset { thumbnails: Some(&thumbnails), ..road.dataset() };
    let mut report = report(dataset, vec![road.run("HOG", 5, 1)]);
    report.budget = Some(1_500_000);
    let html = text(&report);
    assert!(html.len() <= 1_500_000 && html.len() > 1_200_000, "{}", html.len());
    let judged = Judged::new(&report, &report.runs[0]);
    let first = thumbnails::by_interest(&judged)[0];
    assert!(judged.accepts(first) && judged.is_correct(first) == Some(false));
    assert!(html.contains(&format!(".q0-{first}{{background-image")));
}
