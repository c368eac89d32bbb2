//! Reports as a browser shows them.

use std::time::Instant;

use super::*;
use crate::{
    browser::{ask, audit, document},
    page,
    table::{Cell, Drawings, Table, html_page},
};

/// A report on disk.
struct Saved {
    path: std::path::PathBuf,
    // Removed with this.
    _folder: tempfile::TempDir,
}

fn saved(html: &str) -> Saved {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    std::fs::write(&path, html).unwrap();
    Saved { path, _folder: folder }
}

#[test]
fn filters_change_map_curves_and_gallery_together() {
    let road = Road::new(200);
    let report = report(road.dataset(), vec![road.run("HOG", 5, 3), road.run("CoHOG", 5, 4)]);
    let saved = saved(&text(&report));
    let judged = Judged::new(&report, &report.runs[0]);
    let of = |right: bool, accepted: bool| {
        let is = |&query: &usize| {
            judged.is_correct(query) == Some(right) && judged.accepts(query) == accepted
        };
        (0..200).filter(is).count()
    };
    for (fragment, is_dark, n, n_right) in [
        ("", false, 200, of(true, true) + of(true, false)),
        ("#wr", true, of(false, false), 0),
        ("#ra", false, of(true, true), of(true, true)),
    ] {
        let Some(dom) = document(&saved.path, fragment, is_dark) else { return };
        let count = format!("{n} of 200 queries, {n_right} of them right");
        assert!(dom.contains(&count), "{fragment}: not `{count}`");
        assert!(dom.contains(&format!("HOG, {n} queries</span>")), "the map of {fragment}");
        let cards = dom.matches("<article class=\"card\">").count();
        assert_eq!(cards, n.min(24), "cards of {fragment}");
        let last = dom.split("id=\"risk-coverage\"").nth(1).unwrap();
        let chosen = last.split("<path class=\"chosen\" d=\"").nth(1).unwrap();
        let risk = 1.0 - n_right as f64 / n as f64;
        let end = format!("L328.0 {:.1}\"", 10.0 + (1.0 - risk) * 196.0);
        let curve = chosen.split_inclusive('"').next().unwrap();
        assert!(curve.ends_with(&end), "{fragment}: {curve} does not end in {end}");
    }
}

#[test]
fn everybody_can_read_hear_and_reach_everything() {
    let road = Road::new(60);
    let thumbnails = |asked: &[(Side, usize)], _: u32| {
        let picture = |it: &(Side, usize)| match it.1 % 5 {
            0 => Err("the file ends too early".to_owned()),
            _ => Ok(png::grey(40, 30, &[128; 1200])),
        };
        asked.iter().map(picture).collect()
    };
    let dataset = Dataset { thumbnails: Some(&thumbnails), ..road.dataset() };
    audit(&text(&report(dataset, vec![road.run("HOG", 5, 3), road.run("CoHOG", 5, 4)])));
}

#[test]
fn pages_and_their_list_can_be_read_heard_and_reached_too() {
    let mut table = Table::new("table-0", "Recall@1");
    for column in ["HOG", "CoHOG", "NetVLAD, MobileNetV2", "default network", "AP-GeM"] {
        let cell = Cell::new("Corridor", column, 0.477, vpr_core::Provenance::Measured, 111);
        table.push(cell.within(0.4, 0.5, "Wilson").noted("as released"));
    }
    audit(&html_page(&table, "thesis, table 0", Drawings { figure: true, sheet: Some("Grey") }));
    let folder = tempfile::tempdir().unwrap();
    let report = page::Report::new(table, Some(crate::figure::Figure::default()));
    let experiment = crate::experiment::Experiment::new("table-0", "t", ());
    report.write_site(&experiment, folder.path()).unwrap();
    audit(&std::fs::read_to_string(folder.path().join(crate::index::HTML)).unwrap());
}

/// Everything at once that a report was not made for.
#[test]
fn hostile_names_and_numbers_do_nothing_in_a_browser() {
    let road = Road::new(6);
    let evil = "</script><script>document.title='x'</script><img src=x onerror=\"document.title='x'\">\u{202e}\u{2028}";
    let thumbnails = |asked: &[(Side, usize)], _: u32| {
        asked.iter().map(|_| Err(format!("no image: {evil}"))).collect::<Vec<_>>()
    };
    let mut dataset = Dataset { thumbnails: Some(&thumbnails), ..road.dataset() };
    dataset.name = evil.into();
    dataset.queries =
        (0..6).map(|it| if it == 1 { "y".repeat(300) } else { format!("{evil}{it}") }).collect();
    dataset.references = dataset.queries.iter().map(|it| format!("'\"\\{it}")).collect();
    let mut run = road.run(evil, 3, 1);
    run.estimator = Some("</style><style>*{display:none}</style>".into());
    run.uncertainty = Some(vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, 1e300, -1e-300]);
    run.matches[2].clear();
    run.matches[3][0].distance = f64::NAN;
    let mut report = report(dataset, vec![run.clone(), Run { name: "z".repeat(300), ..run }]);
    report.title = format!("title {evil}");
    let html = text(&report);
    for (width, is_dark) in [(360, false), (1600, true)] {
        let Some(found) = ask(
            &html,
            width,
            is_dark,
            "(page) => { \
                const found = { title: page.title, scripts: page.scripts.length, images: page.images.length, cards: 0, \
                    shown: page.querySelector('h1').getClientRects().length, count: [], \
                    wide: page.documentElement.scrollWidth > page.defaultView.innerWidth }; \
                for (const it of page.querySelectorAll('[data-preset]')) { \
                    it.click(); found.count.push(page.getElementById('count').textContent); } \
                for (const it of page.querySelectorAll('select')) it.dispatchEvent(new Event('input', { bubbles: true })); \
                found.cards = page.querySelectorAll('#cards article').length; \
                return found; }",
        ) else {
            return;
        };
        assert!(found["title"].as_str().unwrap().starts_with("title </script>"), "{found}");
        assert_eq!((&found["scripts"], &found["images"]), (&3.into(), &0.into()), "{found}");
        assert_eq!((&found["shown"], &found["cards"]), (&1.into(), &6.into()), "{found}");
        assert_eq!(found["wide"], false, "at {width} pixels");
        let all = found["count"][2].as_str().unwrap();
        assert!(all.starts_with("6 of 6 queries"), "{all}");
    }
}

/// Positions that are not known, all of them or some, leave a map of what is.
#[test]
fn positions_may_be_missing() {
    let nowhere = [f64::NAN; 2];
    let mut road = Road::new(5);
    let at = |it: usize| if it == 2 { nowhere.into() } else { [it as f64, 1.0].into() };
    road.poses = Poses::Planar((0..5).map(at).collect());
    let some = text(&report(road.dataset(), vec![road.run("HOG", 2, 1)]));
    let is_clean = |html: &str| !html.split("<script>").next().unwrap().contains("NaN");
    assert!(some.contains("id=\"map\"") && is_clean(&some));
    road.poses = Poses::Planar(vec![nowhere.into(); 5]);
    let none = text(&report(road.dataset(), vec![road.run("HOG", 2, 1)]));
    assert!(!none.contains("id=\"map\"") && is_clean(&none));
    for html in [some, none] {
        let Some(found) =
            ask(&html, 800, false, "(page) => page.getElementById('count').textContent")
        else {
            return;
        };
        assert!(found.as_str().unwrap().starts_with("5 of 5 queries"), "{found}");
    }
}

/// Resident memory of this process at its highest, in MB.
fn peak() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1e3)
}

/// Size, time and memory of a report of 10 000 queries with 5 references each, and how fast a
/// browser opens and filters it. Run alone: `cargo test -p vpr-report --lib -- --ignored large
/// --nocapture`.
#[test]
#[ignore = "takes half a minute, and measures times"]
#[expect(clippy::print_stderr, reason = "says what it measured")]
fn a_large_report_is_made_opened_and_filtered_in_time() {
    let road = Road::new(10_000);
    // Pictures as heavy as JPEG thumbnails: bytes that cannot be packed.
    let thumbnails = |asked: &[(Side, usize)], side: u32| {
        let picture = |it: &(Side, usize)| {
            let mut random = noise(it.1 as u64);
            let n = (side * side / 6) as usize;
            let level = |_| {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a byte"
                )]
                let level = (random() * 256.0) as u8;
                level
            };
            Ok(png::grey(
                side as usize / 2,
                n / (side as usize / 2),
                &(0..n).map(level).collect::<Vec<u8>>(),
            ))
        };
        asked.iter().map(picture).collect()
    };
    let dataset = Dataset { thumbnails: Some(&thumbnails), ..road.dataset() };
    let report = report(dataset, vec![road.run("HOG", 5, 1)]);
    let (before, start) = (peak(), Instant::now());
    let mut html = Vec::new();
    report.write(&mut html).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let megabytes = html.len() as f64 / 1e6;
    eprintln!(
        "{megabytes:.2} MB in {seconds:.2} s, at most {:?} MB resident ({before:?} before)",
        peak()
    );
    assert!(megabytes <= 10.0 && seconds <= 30.0);
    assert!(peak().is_none_or(|it| it <= 300.0), "{:?} MB", peak());
    // Other programs take time from this one too: the least of several.
    let probe = "<script>onload=()=>setTimeout(()=>{\
        const opened=performance.timing.loadEventEnd-performance.timing.navigationStart, least=[];\
        for(const it of document.querySelectorAll('[data-preset]')){const times=[];\
        for(let n=0;n<7;n++){const start=performance.now();it.click();document.body.offsetHeight;\
        times.push(performance.now()-start)}least.push(Math.min(...times))}\
        document.title='opened '+opened+' filtered '+Math.max(...least)},0)</script>";
    html.extend(probe.as_bytes());
    let saved = saved(&String::from_utf8(html).unwrap());
    let (mut opened, mut filtered) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..3 {
        let Some(dom) = document(&saved.path, "", false) else { return };
        let title = dom.split("<title>").nth(1).unwrap().split('<').next().unwrap();
        let mut numbers = title.split(' ').filter_map(|it| it.parse::<f64>().ok());
        opened = opened.min(numbers.next().unwrap());
        filtered = filtered.min(numbers.next().unwrap());
    }
    eprintln!("opened in {opened:.0} ms, filtered in {filtered:.0} ms");
    assert!(opened <= 2000.0 && filtered <= 100.0, "{opened} ms to open, {filtered} ms to filter");
}
