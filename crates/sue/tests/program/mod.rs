//! The program `sue` as tests run it, and what they expect of its output.
#![allow(dead_code, reason = "not every test needs all of it")]

use std::{
    path::Path,
    process::{Command, Output},
};

/// Runs it in a folder, without anybody's data.
pub(crate) fn sue(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sue"));
    command.current_dir(folder).args(arguments).env_remove("VPR_DATA");
    command.output().expect("the program starts")
}

pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("UTF-8")
}

/// What it printed; asserts exit code 0.
pub(crate) fn success(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", stderr(output));
    stdout(output)
}

/// Asserts exit code 2, nothing on stdout, and a one-line error that contains all of these.
pub(crate) fn assert_refused(output: &Output, parts: &[&str]) {
    let text = stderr(output);
    assert_eq!(output.status.code(), Some(2), "{text}{}", stdout(output));
    assert_eq!(stdout(output), "", "nothing is printed before an error");
    assert!(text.starts_with("error: "), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}
