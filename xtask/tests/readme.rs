//! What README.md shows of the library is compiled, though it belongs to no package.

/// The page itself, and the README of `vpr-core`, whose snippets are doctests.
const PAGE: &str = include_str!("../../README.md");
const COMPILED: &str = include_str!("../../crates/vpr-core/README.md");

/// The lines of every block of Rust.
fn snippets(page: &str) -> Vec<&str> {
    let blocks = page.split("\n```rust\n").skip(1);
    blocks.filter_map(|rest| rest.split_once("```")).map(|(snippet, _)| snippet).collect()
}

#[test]
fn the_readmes_rust_stands_word_for_word_in_a_snippet_that_is_compiled() {
    let shown = snippets(PAGE);
    assert!(!shown.is_empty(), "README.md shows no Rust");
    for snippet in shown {
        let is_compiled = snippets(COMPILED).iter().any(|compiled| compiled.contains(snippet));
        assert!(is_compiled, "not in crates/vpr-core/README.md:\n{snippet}");
    }
}
