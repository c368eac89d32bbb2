//! Folders that are named by the time of a run.

use std::{
    fs,
    io::ErrorKind,
    path::{Path, PathBuf},
    time::{SystemTime, UNIX_EPOCH},
};

use anyhow::Context;

/// Makes a folder below `parent` that is named by this second, `2026-11-28_23-59-59` in UTC as
/// VPR-methods-evaluation names them; a second run within it gets `…_2`.
pub(super) fn create(parent: &Path) -> anyhow::Result<PathBuf> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    create_at(parent, &name(now.as_secs()))
}

fn create_at(parent: &Path, name: &str) -> anyhow::Result<PathBuf> {
    fs::create_dir_all(parent).with_context(|| parent.display().to_string())?;
    let mut folder = parent.join(name);
    for number in 2.. {
        match fs::create_dir(&folder) {
            Ok(()) => return Ok(folder),
            Err(err) if err.kind() == ErrorKind::AlreadyExists => {
                folder = parent.join(format!("{name}_{number}"));
            }
            Err(err) => return Err(err).with_context(|| folder.display().to_string()),
        }
    }
    unreachable!("there are fewer folders than numbers")
}

/// Seconds since 1970 as `year-month-day_hour-minute-second` of UTC.
fn name(seconds: u64) -> String {
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    // Days since 1 March of the year 0, in cycles of 400 years; years begin in March.
    let day = days + 719_468;
    let (era, of_era) = (day / 146_097, day % 146_097);
    let year_of_era = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * of_year + 2) / 153;
    let date = of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    let (hour, minute, second) = (second / 3_600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{date:02}_{hour:02}-{minute:02}-{second:02}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_are_dates() {
        // date -u -d @N +%Y-%m-%d_%H-%M-%S
        for (seconds, expected) in [
            (0, "1970-01-01_00-00-00"),
            (951_782_399, "2000-02-28_23-59-59"),
            (951_782_400, "2000-02-29_00-00-00"),
            (1_709_251_200, "2024-03-01_00-00-00"),
            (1_796_083_199, "2026-11-30_23-59-59"),
            (4_107_542_400, "2100-03-01_00-00-00"),
        ] {
            assert_eq!(name(seconds), expected);
        }
    }

    #[test]
    fn runs_of_one_second_get_folders_of_their_own() {
        let parent = tempfile::tempdir().unwrap();
        let folders = [(); 3].map(|()| create_at(parent.path(), "now").unwrap());
        assert_eq!(folders, ["now", "now_2", "now_3"].map(|name| parent.path().join(name)));
    }
}
