//! Every parser of bytes from outside, against damaged files: an error in one line that names the
//! file, never a panic, never more memory than the file's size justifies.
//!
//! Runs on the stable compiler: deterministic mutations of a corpus that is kept here, and grows by
//! every input that ever failed. `VPR_FUZZ_ROUNDS` sets how many inputs each format gets.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]

mod mutate;
mod targets;
#[path = "../truth/files.rs"]
#[allow(dead_code, reason = "only the files are needed here")]
mod truth_files;
mod truths;

use std::{
    fs::{self, File},
    io::Write as _,
    panic::{self, AssertUnwindSafe},
    path::{Path, PathBuf},
};

use peak_alloc::PeakAlloc;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use targets::{TARGETS, Target};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Inputs per format: a quarter are cut off, a quarter have one bit flipped, half are wilder.
const ROUNDS: usize = 4000;
/// Memory a parser may use whatever the file: buffers, tables of decoders.
const FIXED_BYTES: usize = 256 << 10;
/// Memory per byte of the file: a line of two letters becomes names, poses and errors.
const BYTES_PER_BYTE: usize = 32;

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus")
}

/// A file of the corpus.
struct Seed {
    bytes: Vec<u8>,
    /// Whether it is as it should be, not an input that once failed.
    is_sound: bool,
}

/// The seeds of a format, in the order of their names.
fn seeds(target: &Target) -> Vec<Seed> {
    let folder = corpus().join(target.name);
    let mut files: Vec<PathBuf> = fs::read_dir(&folder)
        .unwrap_or_else(|err| panic!("{}: {err}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    assert!(!files.is_empty(), "no seed for {}", target.name);
    let seed = |file: &PathBuf| {
        let found = file.file_name().unwrap().to_string_lossy().starts_with("found-");
        // A manifest alone lacks its segments.
        let is_sound = !found && target.name != "manifest";
        Seed { bytes: fs::read(file).unwrap(), is_sound }
    };
    files.iter().map(seed).collect()
}

/// What became of one input.
struct Outcome {
    /// Whether the parser found anything wrong.
    noticed: bool,
    /// The most memory it had.
    used: usize,
}

/// Replaces the content of a file in place: some file systems flush a file to the disk that was cut
/// to nothing first, 72 000 times here.
fn overwrite(path: &Path, bytes: &[u8]) {
    let mut file = File::options().write(true).create(true).truncate(false).open(path).unwrap();
    file.write_all(bytes).unwrap();
    file.set_len(bytes.len() as u64).unwrap();
}

/// Gives one input to a parser; why that is wrong, if it is.
fn try_one(target: &Target, place: &Path, input: &[u8]) -> Result<Outcome, String> {
    overwrite(&place.join(target.file), input);
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let outcome = panic::catch_unwind(AssertUnwindSafe(|| (target.read)(place)));
    let used = MEMORY.peak_usage().saturating_sub(before);
    let problems = outcome.map_err(|_| "panicked".to_owned())?;
    let allowed = FIXED_BYTES + BYTES_PER_BYTE * input.len();
    if used > allowed {
        return Err(format!("used {used} bytes for a file of {}", input.len()));
    }
    let place = place.to_string_lossy();
    let unclear = |message: &String| message.contains('\n') || !message.contains(&*place);
    match problems.iter().map(ToString::to_string).find(unclear) {
        Some(message) => Err(format!("unclear: {message:?}")),
        None => Ok(Outcome { noticed: !problems.is_empty(), used }),
    }
}

/// Keeps an input that failed, so that it is tried first from now on.
fn keep(target: &Target, input: &[u8]) -> PathBuf {
    let digest = vpr_core::map::BlockDigest::of(input).to_hex();
    let file = corpus().join(target.name).join(format!("found-{}", &digest[..12]));
    fs::write(&file, input).unwrap();
    file
}

/// How many of the inputs were refused, and the most memory that one of them took.
fn fuzz(target: &Target, rounds: usize) -> Result<(usize, usize), String> {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path();
    fs::create_dir_all(place.join(target.file).parent().unwrap()).unwrap();
    let seeds = seeds(target);
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let (mut n_refused, mut most) = (0, 0);
    let failed = |input: &[u8], reason: String| -> Result<_, String> {
        Err(format!("{}: {reason}; kept as {}", target.name, keep(target, input).display()))
    };
    for Seed { bytes, is_sound } in &seeds {
        match try_one(target, place, bytes) {
            Err(reason) => return failed(bytes, reason),
            Ok(outcome) if *is_sound && outcome.noticed => {
                return Err(format!("{}: a sound file was refused", target.name));
            }
            Ok(_) => {}
        }
    }
    let seeds: Vec<Vec<u8>> = seeds.into_iter().map(|seed| seed.bytes).collect();
    for round in 0..rounds {
        let seed = &seeds[round / 4 % seeds.len()];
        let input = match round % 4 {
            0 => mutate::truncated(seed, &mut rng),
            1 => mutate::bit_flipped(seed, &mut rng),
            _ => mutate::mangled(seed, &seeds, &mut rng),
        };
        let Outcome { noticed, used } = match try_one(target, place, &input) {
            Ok(outcome) => outcome,
            Err(reason) => return failed(&input, reason),
        };
        let must_notice = match round % 4 {
            0 => target.notices_cuts,
            1 => target.notices_all,
            _ => false,
        };
        if must_notice && !noticed && input != *seed {
            return failed(&input, "damage went unnoticed".to_owned());
        }
        n_refused += usize::from(noticed);
        most = most.max(used);
    }
    Ok((n_refused, most))
}

#[test]
fn damaged_files_are_refused_in_one_line_and_in_little_memory() {
    let rounds = std::env::var("VPR_FUZZ_ROUNDS").ok().and_then(|text| text.parse().ok());
    let rounds = rounds.unwrap_or(ROUNDS);
    // A panic is counted, not printed thousands of times.
    panic::set_hook(Box::new(|_| {}));
    let all = TARGETS.iter().chain(truths::TARGETS);
    let outcomes: Vec<_> = all.map(|target| (target, fuzz(target, rounds))).collect();
    let _ = panic::take_hook();
    let mut failures = Vec::new();
    for (target, outcome) in outcomes {
        match outcome {
            Ok((n_refused, most)) => {
                let kib = most.div_ceil(1024);
                eprintln!("{}: {n_refused} of {rounds} refused, at most {kib} KiB", target.name);
            }
            Err(reason) => failures.push(reason),
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Makes the seeds anew: `cargo test -p vpr-core --test fuzz -- --ignored write_the_seeds`.
#[test]
#[ignore = "writes into the source tree"]
fn write_the_seeds() {
    targets::write_seeds(&corpus());
    truths::write_seeds(&corpus());
}
