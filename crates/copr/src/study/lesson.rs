//! How long H takes to learn a room: the first row of table 6.5.

use std::time::Instant;

use vpr_core::{Definition, Error as CoreError};
use vpr_nets::train::Run;

use super::Room;
use crate::{
    Result,
    net::{Pairs, Training, train},
};

/// Images of a sequence that are a pair: metres and degrees apart at most, what a grid around an anchor
/// asks for.
const NEAR: (f64, f64) = (0.8, 45.0);
/// Validations of a training.
const VALIDATIONS: usize = 5;

/// What a training took.
pub(super) struct Lesson {
    /// From the first step to the best validation, seconds, with the validations between.
    pub(super) seconds: f64,
    /// Steps until then.
    pub(super) step: usize,
    /// Steps until it ended.
    pub(super) of: usize,
}

/// Trains H for some steps on the pairs of a room's queries, validated on those of its references, as the thesis does
/// (C-10), and forgets it.
pub(super) fn learn(room: &Room, steps: usize) -> Result<Lesson> {
    let of = |side: &super::Side| {
        Pairs::near(side.map.clone(), &side.sequences, NEAR, Definition::Corrected)
    };
    let (training, validation) = (of(&room.queries)?, of(&room.references)?);
    let folder = tempfile::tempdir().map_err(CoreError::io("a temporary folder"))?;
    let validated_every = steps.div_ceil(VALIDATIONS);
    let settings = Training { steps, validated_every, ..Training::default() };
    let facts = settings.facts(&training, &validation, "timed");
    let log = settings.log(&folder.path().join("log.csv"));
    let work = folder.path().join("work");
    let mut run = Run::open(&work, &facts, log)?;
    let start = Instant::now();
    let (mut least, mut lesson) = (f64::INFINITY, Lesson { seconds: f64::NAN, step: 0, of: steps });
    let observe = |report: &vpr_nets::train::Report, loss: f64| {
        if loss < least {
            least = loss;
            lesson.seconds = start.elapsed().as_secs_f64();
            lesson.step = report.step;
        }
        Ok(())
    };
    let output = folder.path().join("h.safetensors");
    let both = (&training, &validation);
    train(&settings, both, &mut run, &work, (&output, &facts), observe)?;
    Ok(lesson)
}
