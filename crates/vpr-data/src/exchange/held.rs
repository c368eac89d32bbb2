//! What names a format can hold: a file that cannot be read back as it was is not written.

use std::path::Path;

use super::parts::Parts;
use vpr_core::{Error, Result};
use vpr_files::shorten;

/// What a format does to names that have no quotes around them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Names {
    /// Blanks separate them from what follows, and `#` starts a comment.
    Words,
    /// Commas separate them from what follows.
    BetweenCommas,
    /// They fill a line.
    Line,
    /// They may be anything but empty.
    Quoted,
}

impl Names {
    /// Why a name cannot be held.
    fn refusal(self, name: &str) -> Option<&'static str> {
        let has_break = name.contains(['\n', '\r']);
        match self {
            _ if name.is_empty() => Some("is empty"),
            Self::Quoted => None,
            _ if has_break => Some("has a line break, and lines are what this format has"),
            Self::Words if name.contains(char::is_whitespace) => {
                Some("has a blank, and blanks end a name in this format")
            }
            Self::Words if name.starts_with('#') => {
                Some("starts with `#`, which starts a comment in this format")
            }
            Self::BetweenCommas if name.contains(',') => {
                Some("has a comma, and commas end a name in this format")
            }
            _ if name.trim() != name => Some("starts or ends with a blank, which is not kept"),
            _ => None,
        }
    }

    /// Refuses a name that would not be read back as it is.
    pub(super) fn check(self, path: &Path, name: &str) -> Result<()> {
        let Some(reason) = self.refusal(name) else { return Ok(()) };
        let reason =
            format!("{reason}: rename the image, or choose a format with quotes or lengths");
        Err(Error::format(path, format!("name `{}`", shorten(name)), reason))
    }

    /// Refuses names that would not be read back as they are, and such as two images have.
    pub(super) fn check_all(self, path: &Path, parts: &Parts) -> Result<()> {
        let Some(names) = &parts.names else { return Ok(()) };
        names.iter().try_for_each(|name| self.check(path, name))?;
        match names.repeated() {
            None => Ok(()),
            Some((name, [first, second])) => {
                let reason = format!("is the name of two images, in rows {first} and {second}");
                Err(Error::format(path, format!("name `{}`", shorten(name)), reason))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_refuses_what_it_would_lose() {
        let holds = |names: Names, name: &str| names.check(Path::new("a"), name).is_ok();
        for (name, expected) in [
            ("db/a.jpg", [true, true, true, true]),
            ("IMG 1.jpg", [false, true, true, true]),
            ("#1.jpg", [false, true, true, true]),
            ("a, b.jpg", [false, false, true, true]),
            (" a.jpg", [false, false, false, true]),
            ("a\nb", [false, false, false, true]),
            ("", [false, false, false, false]),
        ] {
            let all = [Names::Words, Names::BetweenCommas, Names::Line, Names::Quoted];
            assert_eq!(all.map(|it| holds(it, name)), expected, "{name:?}");
        }
        let err = Names::Words.check(Path::new("pairs.txt"), "IMG 1.jpg").unwrap_err().to_string();
        assert!(err.starts_with("pairs.txt: name `IMG 1.jpg`: has a blank"), "{err}");
    }
}
