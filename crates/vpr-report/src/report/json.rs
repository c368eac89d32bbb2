//! JSON inside of HTML: nothing in it ends the element that it stands in.

use std::fmt::Write as _;

/// A string with its quotes.
pub(super) fn string(text: &str) -> String {
    let mut quoted = String::with_capacity(text.len() + 2);
    quoted.push('"');
    for it in text.chars() {
        match it {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            '<' | '>' | '&' | '\u{2028}' | '\u{2029}' | '\u{7f}'..='\u{9f}' | '\0'..='\u{1f}' => {
                let _ = write!(quoted, "\\u{:04x}", it as u32);
            }
            it => quoted.push(it),
        }
    }
    quoted.push('"');
    quoted
}

/// A number, all of its digits; null if it is none.
pub(super) fn exact(value: f64) -> String {
    if value.is_finite() { format!("{value:?}") } else { "null".to_owned() }
}

/// A number to five digits or so.
pub(super) fn rough(value: f64) -> String {
    if !value.is_finite() {
        return "null".to_owned();
    }
    if value != 0.0 && !(1e-2..1e9).contains(&value.abs()) {
        return format!("{value:.4e}");
    }
    let decimals = if value.abs() < 1.0 {
        5
    } else if value.abs() < 1000.0 {
        3
    } else {
        2
    };
    let text = format!("{value:.decimals$}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A list of what is JSON already.
pub(super) fn list(items: impl Iterator<Item = String>) -> String {
    let mut text = String::from("[");
    for (index, item) in items.enumerate() {
        if index > 0 {
            text.push(',');
        }
        text.push_str(&item);
    }
    text.push(']');
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back_and_ends_no_element() {
        for text in ["</script><!--", "\"\\\n\u{2028}é\u{202e}", ""] {
            let written = string(text);
            assert!(!written.contains('<') && !written.contains('\n'));
            assert_eq!(serde_json::from_str::<String>(&written).unwrap(), text);
        }
        for value in [0.0, -0.1, 1.0 / 3.0, 1e300, -2.5e-9, 123_456.789] {
            assert_eq!(serde_json::from_str::<f64>(&exact(value)).unwrap(), value);
            let near = serde_json::from_str::<f64>(&rough(value)).unwrap();
            assert!((near - value).abs() <= 1e-3 * value.abs(), "{value}: {near}");
        }
        assert_eq!((exact(f64::NAN), rough(f64::INFINITY)), ("null".into(), "null".into()));
        assert_eq!(list(["1".into(), "2".into()].into_iter()), "[1,2]");
    }
}
