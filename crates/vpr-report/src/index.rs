//! The list of all pages of a folder: what each shows, where its numbers come from, and how they
//! stand against the thesis.

use std::{fs, path::Path};

use vpr_core::{Error, Provenance, Result};

use crate::{
    figure::escape,
    table::{Cell, html_document, read_csv},
};

/// Name of the list.
pub const FILE: &str = "index.md";

/// Name of the list for a browser.
pub const HTML: &str = "index.html";

/// What a page says of its agreement, before the numbers.
const VERDICT: &str = "Against the thesis: ";

/// The list of the pages in a folder, as Markdown.
///
/// # Errors
///
/// [`Error::Io`] or [`Error::Format`] for a page or its CSV that cannot be read.
pub fn index(folder: &Path) -> Result<String> {
    let entries = entries(folder)?;
    let lines: String = entries.iter().map(Entry::line).collect();
    Ok(format!(
        "# Results\n\nEvery table and figure, where its numbers come from, and how many of those that \
         the thesis prints read the same. Written with the pages; do not edit.\n\n\
         | page | what it shows | cells by origin | as the thesis |\n|---|---|---|---|\n{lines}"
    ))
}

/// The same list for a browser: pages that have none of HTML are linked as they are.
///
/// # Errors
///
/// As [`index`].
pub fn html(folder: &Path) -> Result<String> {
    let row = |entry: &Entry| {
        let id = escape(&entry.id);
        let page = format!("{}.html", entry.id);
        let is_there = folder.join(&page).is_file();
        let page = if is_there { escape(&page) } else { format!("{id}.md") };
        let picture = ["svg", "png"]
            .into_iter()
            .find(|it| folder.join(format!("{}.{it}", entry.id)).is_file())
            .map(|it| {
                format!("<a href=\"{page}\"><img src=\"{id}.{it}\" alt=\"{id} as a picture\" loading=\"lazy\"></a>")
            });
        format!(
            "<tr><td><a href=\"{page}\">{id}</a></td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
            escape(&entry.title),
            escape(&entry.origins),
            escape(&entry.verdict),
            picture.unwrap_or_default()
        )
    };
    let rows: String = entries(folder)?.iter().map(row).collect();
    let head = ["page", "what it shows", "cells by origin", "as the thesis", "picture"];
    let head: String = head.map(|it| format!("<th scope=\"col\">{it}</th>")).concat();
    let body = format!(
        "<p>Every table and figure, where its numbers come from, and how many of those that the \
         thesis prints read the same.</p>\n<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"all results\"><table>\n\
         <thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n"
    );
    Ok(html_document("Results", &body))
}

/// What the list says of a page.
struct Entry {
    id: String,
    title: String,
    origins: String,
    verdict: String,
}

/// All pages of a folder, in order.
fn entries(folder: &Path) -> Result<Vec<Entry>> {
    let mut ids = Vec::new();
    for entry in fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        let is_page = path.extension().is_some_and(|it| it == "md") && !path.ends_with(FILE);
        let id = path.file_stem().and_then(|it| it.to_str()).filter(|_| is_page);
        ids.extend(id.map(str::to_owned));
    }
    ids.sort_by_key(|id| sort_key(id));
    ids.iter().map(|id| Entry::read(folder, id)).collect()
}

/// The line of one page.
///
/// # Errors
///
/// As [`index`].
pub fn line(folder: &Path, id: &str) -> Result<String> {
    Ok(Entry::read(folder, id)?.line())
}

impl Entry {
    fn read(folder: &Path, id: &str) -> Result<Self> {
        let path = folder.join(format!("{id}.md"));
        let page = fs::read_to_string(&path).map_err(Error::io(&path))?;
        let head = page.lines().next().unwrap_or_default().trim_start_matches("# ");
        let title = head.split_once(": ").map_or(head, |it| it.1);
        let verdict = page.lines().find_map(|line| line.strip_prefix(VERDICT)).unwrap_or_default();
        let verdict = verdict.split(" numbers").next().unwrap_or_default();
        let path = folder.join(format!("{id}.csv"));
        let cells = if path.try_exists().map_err(Error::io(&path))? {
            read_csv(&path)?
        } else {
            Vec::new()
        };
        Ok(Self {
            id: id.to_owned(),
            title: title.to_owned(),
            origins: origins(&cells),
            verdict: verdict.to_owned(),
        })
    }

    fn line(&self) -> String {
        let Self { id, origins, verdict, .. } = self;
        let title = self.title.replace('|', "\\|");
        format!("| [{id}]({id}.md) | {title} | {origins} | {verdict} |\n")
    }
}

fn origins(cells: &[Cell]) -> String {
    let all =
        [Provenance::Published, Provenance::Measured, Provenance::Generated, Provenance::Absent];
    let counts = all.into_iter().filter_map(|origin| {
        let n = cells.iter().filter(|cell| cell.provenance == origin).count();
        (n > 0).then(|| format!("{n} {origin}"))
    });
    counts.collect::<Vec<_>>().join(", ")
}

/// Tables before figures before the rest, by number.
fn sort_key(id: &str) -> (usize, Vec<u32>, String) {
    let kind = ["table-", "figure-"].iter().position(|prefix| id.starts_with(prefix));
    let numbers = id.split(|it: char| !it.is_ascii_digit()).filter_map(|it| it.parse().ok());
    (kind.unwrap_or(2), numbers.collect(), id.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_listed_in_order_with_origin_and_verdict() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        write("figure-3.1.md", "# figure-3.1: A | B\n");
        write("table-3.10.md", "# table-3.10: later\n");
        write(
            "table-3.9.md",
            "# table-3.9: Sizes\n\nAgainst the thesis: 1 of 2 numbers read the same.\n",
        );
        write(
            "table-3.9.csv",
            "row,column,value,thesis,definition,provenance,n,low,high,interval,note\n\
             a,x,1.0,,,measured,9,,,,\na,y,,,,absent,0,,,,no data\n",
        );
        write(FILE, "old");
        let text = index(folder.path()).unwrap();
        let lines: Vec<&str> =
            text.lines().skip_while(|line| !line.starts_with("|---")).skip(1).collect();
        assert_eq!(
            lines,
            [
                "| [table-3.9](table-3.9.md) | Sizes | 1 measured, 1 absent | 1 of 2 |",
                "| [table-3.10](table-3.10.md) | later |  |  |",
                "| [figure-3.1](figure-3.1.md) | A \\| B |  |  |",
            ]
        );
        assert!(line(folder.path(), "nowhere").is_err());
        write("table-3.9.html", "");
        write("figure-3.1.svg", "");
        let html = html(folder.path()).unwrap();
        for part in [
            "<a href=\"table-3.9.html\">table-3.9</a></td><td>Sizes</td><td>1 measured, 1 absent</td><td>1 of 2",
            "<a href=\"table-3.10.md\">",
            "<img src=\"figure-3.1.svg\"",
        ] {
            assert!(html.contains(part), "{part}: {html}");
        }
    }
}
