//! The two ways in which protocol 0 escapes strings.

/// Undoes the escapes of a Python 2 string literal, quotes included; `None` if it is malformed.
pub(super) fn unescape_literal(line: &[u8]) -> Option<Vec<u8>> {
    let (&quote, rest) = line.split_first()?;
    let (&last, inner) = rest.split_last()?;
    if last != quote || !matches!(quote, b'\'' | b'"') {
        return None;
    }
    let mut out = Vec::with_capacity(inner.len());
    let mut bytes = inner.iter().copied().peekable();
    while let Some(byte) = bytes.next() {
        if byte != b'\\' {
            out.push(byte);
            continue;
        }
        out.push(match bytes.next()? {
            escaped @ (b'\\' | b'\'' | b'"') => escaped,
            b'a' => 0x07,
            b'b' => 0x08,
            b't' => b'\t',
            b'n' => b'\n',
            b'v' => 0x0b,
            b'f' => 0x0c,
            b'r' => b'\r',
            b'x' => hex(&[bytes.next()?, bytes.next()?])?.try_into().ok()?,
            first @ b'0'..=b'7' => {
                let mut value = u32::from(first - b'0');
                for _ in 0..2 {
                    let Some(digit) = bytes.next_if(|byte| matches!(byte, b'0'..=b'7')) else {
                        break;
                    };
                    value = value * 8 + u32::from(digit - b'0');
                }
                value.try_into().ok()?
            }
            _ => return None,
        });
    }
    Some(out)
}

/// Undoes `raw-unicode-escape`: Latin-1, in which `\uXXXX` and `\UXXXXXXXX` are escapes.
pub(super) fn unescape_unicode(line: &[u8]) -> Option<String> {
    let mut out = String::with_capacity(line.len());
    let mut rest = line;
    while let Some((&byte, tail)) = rest.split_first() {
        rest = tail;
        let n_digits = match (byte, tail.first()) {
            (b'\\', Some(b'u')) => 4,
            (b'\\', Some(b'U')) => 8,
            (b'\\', Some(&next)) => {
                out.extend(['\\', char::from(next)]);
                rest = &tail[1..];
                continue;
            }
            _ => {
                out.push(char::from(byte));
                continue;
            }
        };
        out.push(char::from_u32(hex(tail.get(1..=n_digits)?)?)?);
        rest = &tail[1 + n_digits..];
    }
    Some(out)
}

/// The bytes that `text` is in Latin-1; `None` if a character is beyond it.
pub(super) fn latin1(text: &str) -> Option<Vec<u8>> {
    text.chars().map(|char| u8::try_from(u32::from(char)).ok()).collect()
}

/// The number that up to eight hexadecimal digits are.
fn hex(digits: &[u8]) -> Option<u32> {
    digits.iter().try_fold(0, |value, &digit| Some(value << 4 | char::from(digit).to_digit(16)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_are_unescaped_as_python_2_does() {
        let literal = br#"'a\x00\xe9\\\'\n\t\101\7"'"#;
        assert_eq!(unescape_literal(literal).unwrap(), b"a\x00\xe9\\'\n\tA\x07\"");
        assert_eq!(unescape_literal(br#""it's""#).unwrap(), b"it's");
    }

    #[test]
    fn malformed_literals_are_none() {
        for bad in ["", "'", "abc", "'a\"", r"'\x1'", r"'\q'", r"'\400'"] {
            assert_eq!(unescape_literal(bad.as_bytes()), None, "{bad}");
        }
        // The closing quote is taken for the escaped one, so the literal ends inside the escape.
        assert_eq!(unescape_literal(br"'\'"), None);
    }

    #[test]
    fn unicode_is_latin_1_with_escapes() {
        assert_eq!(unescape_unicode(b"\xe9\\u20ac\\U0001f600\\\\u0041").unwrap(), "é€😀\\\\u0041");
        assert_eq!(unescape_unicode(b"\\ud800"), None);
        assert_eq!(unescape_unicode(b"\\u12"), None);
    }
}
