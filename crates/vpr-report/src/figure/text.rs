//! Widths of text, by a table on the wide side, so that what fits here fits in any font.

/// Width of a text in pixels at a font size.
pub(super) fn width(text: &str, size: f64) -> f64 {
    size * text.chars().map(em).sum::<f64>()
}

/// How much wider a bold text is.
pub(super) const BOLD: f64 = 1.13;

/// Width of a character in units of the font size: `DejaVu Sans`, the widest of the usual fonts.
fn em(it: char) -> f64 {
    match it {
        'i' | 'j' | 'l' | '\'' | '|' => 0.29,
        ' ' | '\u{a0}' | '.' | ',' | ':' | ';' | '!' | 'I' | '/' | '(' | ')' | '[' | ']' | '-'
        | 't' | 'f' | 'r' => 0.4,
        'm' | 'w' | 'M' | 'W' | '%' | '@' | '…' | '—' => 0.99,
        'A'..='Z' => 0.72,
        '+' | '=' | '<' | '>' | '±' | '×' => 0.84,
        it if (it as u32) < 0x2E80 => 0.64,
        _ => 1.1,
    }
}

/// Lines of at most `limit` pixels and at most `n` of them, broken between words; what does not fit
/// ends in an ellipsis.
pub(super) fn wrap(text: &str, size: f64, limit: f64, n: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ').filter(|word| !word.is_empty()) {
        match lines.last_mut() {
            Some(line) if width(line, size) + width(word, size) + 0.4 * size <= limit => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    let is_cut = lines.len() > n;
    lines.truncate(n);
    let last = lines.len().saturating_sub(1);
    for (index, line) in lines.iter_mut().enumerate() {
        if width(line, size) > limit || (is_cut && index == last) {
            while !line.is_empty() && width(line, size) + size > limit {
                line.pop();
            }
            line.push('…');
        }
    }
    lines
}

/// Text as it may stand in XML and HTML, attributes included.
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for it in text.chars() {
        match it {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            // Neither XML nor a reader can do anything with these.
            it if it.is_control() || is_turning(it) => escaped.push('\u{fffd}'),
            it => escaped.push(it),
        }
    }
    escaped
}

/// Whether a character turns the direction of the text after it, also beyond its own name.
fn is_turning(it: char) -> bool {
    matches!(it, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_within_the_limit() {
        let text = "HOG, thesis configuration, multi-illumination (generated): illumination";
        let lines = wrap(text, 12.0, 220.0, 3);
        assert_eq!(lines.join(" "), text);
        assert!(lines.iter().all(|line| width(line, 12.0) <= 220.0), "{lines:?}");
        let cut = wrap(&"word ".repeat(99), 12.0, 100.0, 2);
        assert!(cut.len() == 2 && cut[1].ends_with('…') && width(&cut[1], 12.0) <= 100.0);
        assert!(wrap(&"x".repeat(300), 12.0, 100.0, 2)[0].ends_with('…'));
        assert_eq!(wrap("", 12.0, 100.0, 2), [""; 0]);
    }

    #[test]
    fn nothing_escapes() {
        assert_eq!(escape("a\u{202e}b"), "a\u{fffd}b");
        assert_eq!(escape("<b a=\"'\">&\u{1}"), "&lt;b a=&quot;&#39;&quot;&gt;&amp;\u{fffd}");
    }
}
