//! How far work is: one look for all programs.

use std::{
    io::IsTerminal,
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering},
    },
};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use vpr_core::Observer;

/// What, a bar, n of N, how many a second, how long it still takes. No colours, so that there is
/// nothing for `NO_COLOR` to turn off; clap heeds it for help and errors.
const LOOK: &str = "{msg} {bar:30} {human_pos} of {human_len}, {per_sec}, {eta} left";

/// Whether `--quiet` was given.
static IS_QUIET: AtomicBool = AtomicBool::new(false);

/// Whether a person wants to see how far the work is.
#[derive(Args, Clone, Copy, Debug)]
pub struct Quiet {
    /// Show no progress; where stderr is no terminal none is shown anyway
    #[arg(long, global = true)]
    quiet: bool,
}

impl Quiet {
    /// Heeds the flag from here on, for the whole program.
    pub fn heed(self) {
        IS_QUIET.store(self.quiet, Ordering::Relaxed);
    }
}

/// A progress bar on stderr; invisible with `--quiet`, if stderr is no terminal or if
/// `VPR_NO_PROGRESS` is set.
#[must_use]
pub fn progress(what: &str, n: usize) -> ProgressBar {
    let is_unwanted =
        IS_QUIET.load(Ordering::Relaxed) || std::env::var_os("VPR_NO_PROGRESS").is_some();
    if is_unwanted || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(n as u64);
    bar.set_style(look());
    bar.set_message(what.to_owned());
    bar
}

fn look() -> ProgressStyle {
    ProgressStyle::with_template(LOOK).unwrap_or_else(|_| ProgressStyle::default_bar())
}

/// The progress bar of the work under way, on stderr.
#[derive(Default)]
pub struct Bar(Mutex<Option<ProgressBar>>);

impl Bar {
    fn with(&self, act: impl FnOnce(&mut Option<ProgressBar>)) {
        // A poisoned lock means another thread panicked: progress no longer matters.
        if let Ok(mut bar) = self.0.lock() {
            act(&mut bar);
        }
    }
}

impl Observer for Bar {
    fn start(&self, what: &str, n: usize) {
        self.with(|bar| *bar = Some(progress(what, n)));
    }

    fn step(&self) {
        self.with(|bar| bar.iter().for_each(|bar| bar.inc(1)));
    }

    fn end(&self) {
        self.with(|bar| bar.take().iter().for_each(ProgressBar::finish_and_clear));
    }
}

#[cfg(test)]
mod tests {
    use std::{io, sync::Arc};

    use indicatif::{ProgressDrawTarget, TermLike};

    use super::*;

    /// A terminal that keeps what was written.
    #[derive(Clone, Debug, Default)]
    struct Screen(Arc<Mutex<String>>);

    impl TermLike for Screen {
        fn width(&self) -> u16 {
            120
        }

        fn move_cursor_up(&self, _: usize) -> io::Result<()> {
            Ok(())
        }

        fn move_cursor_down(&self, _: usize) -> io::Result<()> {
            Ok(())
        }

        fn move_cursor_right(&self, _: usize) -> io::Result<()> {
            Ok(())
        }

        fn move_cursor_left(&self, _: usize) -> io::Result<()> {
            Ok(())
        }

        fn write_line(&self, text: &str) -> io::Result<()> {
            self.write_str(text)
        }

        fn write_str(&self, text: &str) -> io::Result<()> {
            self.0.lock().unwrap().push_str(text);
            Ok(())
        }

        fn clear_line(&self) -> io::Result<()> {
            Ok(())
        }

        fn flush(&self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_bar_says_what_how_many_of_how_many_how_fast_and_how_long() {
        let screen = Screen::default();
        let target = ProgressDrawTarget::term_like(Box::new(screen.clone()));
        let bar = ProgressBar::with_draw_target(Some(1200), target).with_style(look());
        bar.set_message("describing");
        bar.inc(300);
        bar.tick();
        let line = screen.0.lock().unwrap().clone();
        for part in ["describing ", " 300 of 1,200, ", "/s, ", " left"] {
            assert!(line.contains(part), "`{part}` is not in `{line}`");
        }
    }
}
