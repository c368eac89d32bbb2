//! What a shell asks of every program: completions that it can read, and a manual page for every
//! command.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    env, fs,
    path::PathBuf,
    process::{Command, Output, Stdio},
};

const PROGRAMS: [&str; 4] = ["bench", "copr", "rsf", "sue"];

/// The built program: this test lies in `deps` beside it.
fn program(name: &str) -> PathBuf {
    let path = env::current_exe().unwrap().ancestors().nth(2).unwrap().join(name);
    assert!(path.is_file(), "{name} is not built: `cargo test --workspace`, not one package");
    path
}

fn run(name: &str, arguments: &[&str]) -> Output {
    let output = Command::new(program(name)).args(arguments).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && stderr.is_empty(), "{name} {arguments:?}: {stderr}");
    output
}

/// The commands that `--help` lists.
fn commands(name: &str) -> Vec<String> {
    let help = String::from_utf8(run(name, &["--help"]).stdout).unwrap();
    let list = help.split("\nCommands:\n").nth(1).unwrap().split("\n\n").next().unwrap();
    // What goes on in the next line stands farther to the right.
    let commands = list.lines().filter_map(|line| line.strip_prefix("  "));
    let commands = commands.filter(|line| !line.starts_with(' '));
    let names = commands.filter_map(|line| line.split_whitespace().next());
    names.filter(|it| *it != "help").map(str::to_owned).collect()
}

#[test]
fn shells_can_complete_every_command() {
    for name in PROGRAMS {
        for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
            let text = run(name, &["completions", shell]).stdout;
            let text = String::from_utf8(text).unwrap();
            assert!(!text.contains(&format!("vpr-{name}")), "{name}: the name of the package");
            for command in commands(name) {
                assert!(text.contains(&command), "{name} {command} in {shell}");
            }
            // A shell that is here says whether it can read them.
            if !matches!(shell, "bash" | "zsh" | "fish") {
                continue;
            }
            let file = tempfile::NamedTempFile::new().unwrap();
            fs::write(file.path(), &text).unwrap();
            let read = Command::new(shell).arg("-n").arg(file.path()).stdin(Stdio::null()).status();
            assert!(read.is_err() || read.unwrap().success(), "{name}: {shell} cannot read them");
        }
    }
}

#[test]
fn every_command_has_a_manual_page() {
    for name in PROGRAMS {
        let folder = tempfile::tempdir().unwrap();
        run(name, &["manual", folder.path().to_str().unwrap()]);
        let read = |page: &str| fs::read_to_string(folder.path().join(page)).unwrap();
        assert!(read(&format!("{name}.1")).contains(".SH SYNOPSIS"));
        let commands = commands(name);
        assert!(commands.len() >= 5, "{name}: {commands:?}");
        for command in commands {
            let page = read(&format!("{name}-{command}.1"));
            assert!(page.contains(".SH NAME") && page.contains("help"), "{name} {command}");
        }
    }
}

#[test]
fn every_program_can_be_quiet() {
    for name in PROGRAMS {
        assert!(!run(name, &["completions", "bash", "--quiet"]).stdout.is_empty());
    }
}
