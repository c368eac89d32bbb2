//! What a shell wants to know of a program: completions and manual pages, from its flags.

use std::path::PathBuf;

use anyhow::Context;
use clap::{CommandFactory, Subcommand};

use super::{Outcome, print};

/// Commands that every program has.
#[derive(Subcommand, Clone, Debug)]
pub enum Shell {
    /// Print the completions for a shell, such as `~/.local/share/bash-completion/completions/NAME`
    /// has them
    Completions {
        /// The shell
        #[arg(value_enum)]
        shell: clap_complete::Shell,
    },
    /// Write the manual pages, one per command, into a folder, such as `~/.local/share/man/man1`
    Manual {
        /// The folder; it is made if it is not there
        #[arg(value_name = "DIR")]
        folder: PathBuf,
    },
}

impl Shell {
    /// Does it for the program whose command line is `C`.
    ///
    /// # Errors
    ///
    /// If stdout is closed, or the folder cannot be written.
    pub fn run<C: CommandFactory>(&self) -> anyhow::Result<Outcome> {
        let mut command = C::command();
        match self {
            Self::Completions { shell } => {
                let name = command.get_name().to_owned();
                let mut text = Vec::new();
                clap_complete::generate(*shell, &mut command, name, &mut text);
                print(&String::from_utf8(text)?)?;
            }
            Self::Manual { folder } => {
                let failed = || folder.display().to_string();
                std::fs::create_dir_all(folder).with_context(failed)?;
                clap_mangen::generate_to(command, folder).with_context(failed)?;
            }
        }
        Ok(Outcome::Success)
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    #[command(name = "toy", version, about = "A toy")]
    struct Cli {
        #[command(subcommand)]
        _command: Command,
    }

    #[derive(Subcommand)]
    enum Command {
        /// Play with it
        Play {
            /// How often
            #[arg(long)]
            _times: usize,
        },
        #[command(flatten)]
        Shell(Shell),
    }

    #[test]
    fn every_command_has_a_manual_page_that_tells_its_flags() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("man1");
        Shell::Manual { folder: folder.clone() }.run::<Cli>().unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
        assert!(read("toy.1").contains("A toy"));
        let page = read("toy-play.1");
        assert!(page.contains("Play with it") && page.contains("times"), "{page}");
        assert!(read("toy-completions.1").contains("zsh"));
    }
}
