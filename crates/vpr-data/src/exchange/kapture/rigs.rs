//! `rigs.txt`: where sensors, and rigs, sit on rigs.

use std::{collections::BTreeMap, path::Path};

use super::{
    super::report::{Read, Report, content_lines, read_text},
    transform_of,
};
use vpr_core::Pose;
use vpr_files::shorten;

/// Rigs within rigs are no deeper than this; kapture stops at ten.
const DEEPEST: usize = 10;
/// A device is on no more rigs than this, those of rigs included.
const MOST_WAYS: usize = 100;

/// Which rig every device sits on, and how.
#[derive(Debug, Default)]
pub(super) struct Rigs {
    /// Rigs with `rig_from_device`, which is `None` where the file leaves it open, by device.
    rigs_of: BTreeMap<String, BTreeMap<String, Option<Pose>>>,
}

/// A device above another.
#[derive(Debug)]
pub(super) struct Link {
    /// The rig.
    pub(super) device: String,
    /// The pose of the other in its frame, if it is known.
    pub(super) from_device: Option<Pose>,
}

/// Reads `rig, device, qw, qx, qy, qz, tx, ty, tz` per line: points go from rig to device.
pub(super) fn read(path: &Path) -> Read<Rigs> {
    let text = read_text(path)?;
    let mut report = Report::new(path);
    let mut rigs = Rigs::default();
    for (line, content) in content_lines(&text) {
        let fields: Vec<&str> = content.split(',').map(str::trim).collect();
        let [rig, device, transform @ ..] = fields.as_slice() else {
            report.line(line, "expected rig, sensor, qw, qx, qy, qz, tx, ty, tz");
            continue;
        };
        // The inverse of device from rig is the pose of the device on the rig.
        let Some(pose) = report.keep(line, transform_of(transform)) else { continue };
        let of_device = rigs.rigs_of.entry((*device).to_owned()).or_default();
        if of_device.insert((*rig).to_owned(), pose).is_some() {
            report
                .line(line, format!("`{}` is on rig `{}` already", shorten(device), shorten(rig)));
        }
    }
    for device in rigs.rigs_of.keys() {
        if let Err(reason) = rigs.check_above(device) {
            report.file(format!("`{}` {reason}", shorten(device)));
            break;
        }
    }
    report.finish(rigs)
}

impl Rigs {
    /// Whether a device carries others.
    pub(super) fn is_rig(&self, device: &str) -> bool {
        self.rigs_of.values().any(|rigs| rigs.contains_key(device))
    }

    /// All rigs above a device, the nearest first, with its pose in their frames.
    pub(super) fn above(&self, device: &str) -> Vec<Link> {
        let mut above = Vec::new();
        self.climb(device, Some(Pose::identity()), 0, &mut above);
        above
    }

    fn climb(&self, device: &str, pose: Option<Pose>, depth: usize, above: &mut Vec<Link>) {
        if depth == DEEPEST {
            return;
        }
        for (rig, rig_from_device) in self.rigs_of.get(device).into_iter().flatten() {
            let from_device = rig_from_device.zip(pose).map(|(outer, inner)| outer * inner);
            above.push(Link { device: rig.clone(), from_device });
            self.climb(rig, from_device, depth + 1, above);
        }
    }

    /// The devices that sit on a device, as deep as they do; itself if it is no rig.
    pub(super) fn parts_of(&self, device: &str) -> Vec<String> {
        let is_on = |rigs: &BTreeMap<String, Option<Pose>>| rigs.contains_key(device);
        let parts: Vec<&String> =
            self.rigs_of.iter().filter(|(_, rigs)| is_on(rigs)).map(|(part, _)| part).collect();
        if parts.is_empty() {
            return vec![device.to_owned()];
        }
        parts.into_iter().flat_map(|part| self.parts_of(part)).collect()
    }

    /// Refuses rigs that carry themselves, and more ways up than a person would build.
    fn check_above(&self, device: &str) -> Result<(), &'static str> {
        let mut ways = BTreeMap::from([(device, 1_usize)]);
        let mut n_ways = 0_usize;
        for _ in 0..DEEPEST {
            let mut further: BTreeMap<&str, usize> = BTreeMap::new();
            for (device, n) in ways {
                for rig in self.rigs_of.get(device).into_iter().flatten().map(|(rig, _)| rig) {
                    let ways = further.entry(rig).or_default();
                    *ways = ways.saturating_add(n);
                }
            }
            n_ways = further.values().fold(n_ways, |sum, n| sum.saturating_add(*n));
            ways = further;
        }
        match (ways.is_empty(), n_ways) {
            (false, _) => Err("is on itself, or on more than ten rigs in each other"),
            (true, ..=MOST_WAYS) => Ok(()),
            (true, _) => Err("is on more than a hundred rigs"),
        }
    }
}
