//! Committed figures as a browser draws them, with the widths of real fonts.

use super::reading::committed;
use crate::browser::ask;

const FAULTS: &str = "(page) => {
  const faults = [];
  const meets = (a, b) => a.left < b.right - 1.5 && b.left < a.right - 1.5 && a.top < b.bottom - 2.5 && b.top < a.bottom - 2.5;
  for (const figure of page.querySelectorAll('figure')) {
    const name = figure.dataset.name, picture = figure.querySelector('svg').getBoundingClientRect();
    const texts = [...figure.querySelectorAll('text')].map((it) => [it.textContent, it.getBoundingClientRect()]);
    const curves = [...figure.querySelectorAll('path.l,path.m,path.x,path.p,path.w')].map((it) => it.getBoundingClientRect());
    texts.forEach(([text, box], index) => {
      if (box.left < picture.left || box.right > picture.right || box.bottom > picture.bottom + 1) faults.push(name + ': outside: ' + text);
      for (const [other, it] of texts.slice(0, index)) if (meets(box, it)) faults.push(name + ': ' + text + ' over ' + other);
      if (curves.some((it) => it.width && meets(box, it))) faults.push(name + ': over a curve: ' + text);
    });
  }
  return { n: page.querySelectorAll('text').length, faults };
}";

#[test]
fn committed_figures_fit_in_a_browser_too() {
    let figures = committed();
    let figures = figures.iter().map(|(name, svg)| {
        format!("<figure data-name=\"{name}\" style=\"margin:0\">{svg}</figure>")
    });
    let page = format!("<!doctype html>\n<body>{}</body>", figures.collect::<String>());
    let Some(found) = ask(&page, 1400, false, FAULTS) else { return };
    assert!(found["n"].as_u64().unwrap() > 1000, "{}", found["n"]);
    assert_eq!(found["faults"], serde_json::json!([]));
}
