//! The tutorial in `docs/book` is true: its commands run one after the other and print what it
//! shows, its Rust stands word for word in an example that is compiled, its links lead somewhere.
//!
//! `BOOK_WRITE=1` writes what the commands print into the pages instead of comparing it.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

/// Where the pages lie.
fn book() -> PathBuf {
    root().join("docs/book/src")
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// The pages in the order of the summary.
fn pages() -> Vec<PathBuf> {
    let summary = fs::read_to_string(book().join("SUMMARY.md")).unwrap();
    let links = summary.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
    let pages: Vec<PathBuf> = links.map(|(link, _)| book().join(link)).collect();
    assert!(pages.len() >= 10, "{} pages", pages.len());
    pages
}

/// A fenced block of a page: its language, its lines, and where these stand in the page.
struct Block<'a> {
    language: &'a str,
    text: &'a str,
    start: usize,
}

fn blocks(page: &str) -> Vec<Block<'_>> {
    let mut blocks = Vec::new();
    let mut from = 0;
    while let Some(at) = page[from..].find("\n```").map(|at| from + at + 4) {
        let Some(line) = page[at..].find('\n').map(|end| at + end) else { break };
        let end = line + 1 + page[line..].find("\n```").expect("a block ends");
        blocks.push(Block {
            language: &page[at..line],
            text: &page[line + 1..end],
            start: line + 1,
        });
        from = end + 3;
    }
    blocks
}

/// The folder of the built programs: this test lies in `deps` below it.
fn programs() -> PathBuf {
    let test = env::current_exe().unwrap();
    let folder = test.ancestors().nth(2).unwrap().to_owned();
    for program in ["bench", "rsf", "sue", "copr", "worlds", "examples/own_regressor"] {
        let is_there = folder.join(program).is_file();
        assert!(is_there, "{program} is not built: `cargo test --workspace`, not one package");
    }
    folder
}

/// What a block of commands prints on stdout. They run in one folder for the whole book, without
/// data and with a cache that begins empty, as in a fresh clone.
fn run(commands: &str, folder: &Path, page: &Path) -> String {
    let programs = programs();
    let path = env::join_paths(
        [programs.clone(), programs.join("examples")]
            .into_iter()
            .chain(env::split_paths(&env::var_os("PATH").unwrap_or_default())),
    );
    // Examples are built with the tests; a reader's cargo would build them first.
    let script = commands.replace("cargo run --quiet --example ", "");
    let output = Command::new("sh")
        .args(["-e", "-c", &script])
        .current_dir(folder)
        .env("PATH", path.unwrap())
        .env("LC_ALL", "C")
        .env_remove("VPR_DATA")
        .env_remove("VPR_CACHE")
        .env_remove("COLUMNS")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    let page = page.display();
    assert!(output.status.success(), "{page}: {:?}\n{commands}{stderr}", output.status.code());
    String::from_utf8(output.stdout).unwrap()
}

/// Whether a text reads as shown; a line `…` stands for any number of lines.
fn reads_as(printed: &str, shown: &str) -> bool {
    let mut rest: Vec<&str> = printed.lines().collect();
    let shown: Vec<&str> = shown.lines().collect();
    let mut parts = shown.split(|line| *line == "…");
    let first = parts.next().unwrap_or_default();
    if !rest.starts_with(first) {
        return false;
    }
    rest.drain(..first.len());
    let parts: Vec<&[&str]> = parts.collect();
    for (index, part) in parts.iter().enumerate() {
        if index + 1 == parts.len() {
            return rest.ends_with(part);
        }
        let starts = 0..=rest.len().saturating_sub(part.len());
        let Some(at) = starts.into_iter().find(|at| rest[*at..].starts_with(part)) else {
            return false;
        };
        rest.drain(..at + part.len());
    }
    rest.is_empty()
}

#[test]
fn dots_stand_for_lines() {
    for (shown, is_so) in [
        ("a\nb\nc\n", true),
        ("a\n…\n", true),
        ("a\nb\nc…\n", false),
        ("…\nc\n", true),
        ("a\n…\nc\n", true),
        ("…\nb\n…\n", true),
        ("a\nb\n", false),
        ("b\n…\n", false),
        ("…\nb\n", false),
        ("a\n…\na\n…\n", false),
        ("", false),
    ] {
        assert_eq!(reads_as("a\nb\nc\n", shown), is_so, "{shown}");
    }
    assert!(reads_as("a…\nb\n", "a…\nb\n"), "dots at the end of a line are text");
}

#[test]
fn every_command_prints_what_the_page_shows() {
    let folder = tempfile::tempdir().unwrap();
    let is_written = env::var_os("BOOK_WRITE").is_some();
    let (mut n_commands, mut n_shown, mut wrong) = (0, 0, Vec::new());
    for path in pages() {
        let page = fs::read_to_string(&path).unwrap();
        let blocks = blocks(&page);
        let mut written = page.clone();
        let mut shift = 0_isize;
        for (index, block) in blocks.iter().enumerate() {
            if block.language != "sh" {
                assert!(!block.language.is_empty(), "{}: a block without a word", path.display());
                continue;
            }
            n_commands += 1;
            let printed = run(block.text, folder.path(), &path);
            let Some(shown) = blocks.get(index + 1).filter(|it| it.language == "text") else {
                continue;
            };
            n_shown += 1;
            if reads_as(&printed, shown.text) {
                continue;
            }
            wrong.push(format!("{}:\n{}prints\n{printed}", path.display(), block.text));
            let at = shown.start.checked_add_signed(shift).unwrap();
            written.replace_range(at..at + shown.text.len(), &printed);
            shift += isize::try_from(printed.len()).unwrap()
                - isize::try_from(shown.text.len()).unwrap();
        }
        if is_written && written != page {
            fs::write(&path, written).unwrap();
        }
    }
    assert!(is_written || wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(n_commands >= 20 && n_shown >= 15, "{n_commands} commands, {n_shown} shown outputs");
}

#[test]
fn the_books_rust_stands_word_for_word_in_an_example_that_is_compiled() {
    let mut n = 0;
    for path in pages() {
        let page = fs::read_to_string(&path).unwrap();
        // "From [`crates/…/own_encoder.rs`](…)" above the block says where it is from.
        for block in blocks(&page).iter().filter(|it| it.language == "rust") {
            let link = page[..block.start].rsplit_once("](").unwrap().1;
            let source = path.parent().unwrap().join(link.split(')').next().unwrap());
            let source = fs::read_to_string(&source).unwrap();
            assert!(source.contains(block.text), "{}:\n{}", path.display(), block.text);
            n += 1;
        }
    }
    assert!(n >= 3, "{n} blocks of Rust");
}

#[test]
fn links_lead_somewhere() {
    for path in pages() {
        let page = fs::read_to_string(&path).unwrap();
        for link in page.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = link.split('#').next().unwrap();
            let is_there =
                file.starts_with("https://") || path.parent().unwrap().join(file).exists();
            assert!(is_there, "{}: {link}", path.display());
        }
    }
}
