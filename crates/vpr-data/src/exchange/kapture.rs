//! kapture 1.1: `sensors/trajectories.txt` (device from world, wxyz), `rigs.txt` (sensor from rig)
//! and `records_camera.txt`.

mod rigs;

use std::{
    collections::{HashMap, HashSet},
    fmt::Write as _,
    fs,
    path::Path,
};

use super::{
    convention::PoseConvention,
    held,
    parts::Parts,
    report::{Read, Report, content_lines, joined, numbers, read_text},
};
use rigs::{Link, Rigs};
use vpr_core::{Error, Pose, Poses, Result, map::Names};
use vpr_files::{replace, shorten};

const TRAJECTORIES: &str = "sensors/trajectories.txt";
const RECORDS: &str = "sensors/records_camera.txt";
const RIGS: &str = "sensors/rigs.txt";
const SENSORS: &str = "sensors/sensors.txt";
const VERSION: &str = "# kapture format: 1.1\n";

/// A moment and a device, as text; times are whole numbers, compared as such.
type Key = (String, String);

/// The images of `records_camera.txt` in its order, as far as they have a pose: their device's, or
/// that of the rig it is part of. Without that file, every device with a pose, called `time/device`.
pub(super) fn read(folder: &Path) -> Read<Parts> {
    let trajectories = folder.join(TRAJECTORIES);
    let text = read_text(&trajectories)?;
    let rigs = match folder.join(RIGS) {
        path if path.exists() => rigs::read(&path)?,
        _ => Rigs::default(),
    };
    let records = match folder.join(RECORDS) {
        path if path.exists() => Some(read_records(&path)?),
        _ => None,
    };
    let mut report = Report::new(&trajectories);
    let moments = read_moments(&text, &mut report);
    let mut found = Found::new(folder);
    if let Some(records) = &records {
        for (key, image) in records {
            found.add(image, key, &moments, &rigs, &mut report);
        }
        found.say_rest(&moments, &rigs);
    } else {
        let note = format!("{}: no {RECORDS}: images are called time/device", folder.display());
        found.notes.push(note);
        for (time, device) in moments.devices(&rigs) {
            let image = format!("{time}/{device}");
            found.add(&image, &(time, device), &moments, &rigs, &mut report);
        }
    }
    let Found { names, poses, notes, .. } = found.finished();
    let poses = Some(Poses::SixDof(poses));
    report.finish(Parts { names: Some(names), poses, notes, ..Parts::default() })
}

/// The trajectories: a pose, or none where numbers are left out, by time and device.
struct Moments {
    poses: HashMap<Key, (usize, Option<Pose>)>,
    order: Vec<Key>,
}

impl Moments {
    /// Time and device of everything that has a pose of its own or by a rig, rigs apart.
    fn devices(&self, rigs: &Rigs) -> Vec<Key> {
        let mut seen = HashSet::new();
        let of_key = |(time, device): &Key| {
            rigs.parts_of(device).into_iter().map(|part| (time.clone(), part)).collect::<Vec<_>>()
        };
        self.order.iter().flat_map(of_key).filter(|key| seen.insert(key.clone())).collect()
    }
}

fn read_moments(text: &str, report: &mut Report<'_>) -> Moments {
    let mut moments = Moments { poses: HashMap::new(), order: Vec::new() };
    for (line, content) in content_lines(text) {
        let fields: Vec<&str> = content.split(',').map(str::trim).collect();
        let [time, device, transform @ ..] = fields.as_slice() else {
            report.line(line, "expected timestamp, device, qw, qx, qy, qz, tx, ty, tz");
            continue;
        };
        let Some(pose) = report.keep(line, transform_of(transform)) else { continue };
        let key = (moment(time), (*device).to_owned());
        if let Some((first, _)) = moments.poses.insert(key.clone(), (line, pose)) {
            let device = shorten(device);
            report.line(
                line,
                format!("a second pose of `{device}` at time {time}, as on line {first}"),
            );
        }
        moments.order.push(key);
    }
    moments
}

/// A time without what does not count: `007` is `7`.
fn moment(time: &str) -> String {
    time.parse::<i128>().map_or_else(|_| time.to_owned(), |time| time.to_string())
}

/// The inverse of `qw, qx, qy, qz, tx, ty, tz`; `None` where either part is left out or not a number,
/// as kapture writes what it does not know.
fn transform_of(fields: &[&str]) -> Result<Option<Pose>, String> {
    let is_unknown = |field: &&str| field.is_empty() || field.eq_ignore_ascii_case("nan");
    if fields.len() == 7
        && (fields[..4].iter().all(is_unknown) || fields[4..].iter().all(is_unknown))
    {
        return Ok(None);
    }
    let [wxyz @ .., x, y, z] = numbers::<7>(fields.iter().copied())?;
    PoseConvention::KAPTURE.pose([x, y, z], wxyz).map(Some)
}

/// Images in the order of the file, with time and device.
fn read_records(path: &Path) -> Read<Vec<(Key, String)>> {
    let text = read_text(path)?;
    let mut report = Report::new(path);
    let mut records = Vec::new();
    let (mut line_of_key, mut line_of_image) = (HashMap::new(), HashMap::new());
    for (line, content) in content_lines(&text) {
        let mut fields = content.splitn(3, ',').map(str::trim);
        let (Some(time), Some(device), Some(image)) = (fields.next(), fields.next(), fields.next())
        else {
            report.line(line, "expected timestamp, device, image");
            continue;
        };
        let key = (moment(time), device.to_owned());
        if let Some(first) = line_of_key.insert(key.clone(), line) {
            let device = shorten(device);
            report.line(
                line,
                format!("a second image of `{device}` at time {time}, as on line {first}"),
            );
        }
        if let Some(first) = line_of_image.insert(image.to_owned(), line) {
            let image = shorten(image);
            report.line(line, format!("`{image}` is the image on line {first}, too"));
        }
        records.push((key, image.to_owned()));
    }
    report.finish(records)
}

/// Images with poses, and those without.
struct Found<'a> {
    folder: &'a Path,
    names: Names,
    poses: Vec<Pose>,
    /// Images without a pose.
    lost: Vec<String>,
    /// Devices whose pose at that time was used.
    used: HashSet<Key>,
    notes: Vec<String>,
}

/// How far poses of one image may be apart: files are written with six digits or more.
const SAME_M: f64 = 1e-3;
const SAME_RAD: f64 = 1e-3;

impl<'a> Found<'a> {
    fn new(folder: &'a Path) -> Self {
        let (names, poses, lost, notes) = (Names::default(), Vec::new(), Vec::new(), Vec::new());
        Self { folder, names, poses, lost, used: HashSet::new(), notes }
    }

    /// Adds an image with the pose of its device, or of a rig it is part of.
    fn add(
        &mut self,
        image: &str,
        (time, device): &Key,
        moments: &Moments,
        rigs: &Rigs,
        report: &mut Report<'_>,
    ) {
        let mut all: Vec<(usize, Pose)> = Vec::new();
        let own = Link { device: device.clone(), from_device: Some(Pose::identity()) };
        for Link { device, from_device } in std::iter::once(own).chain(rigs.above(device)) {
            let key = (time.clone(), device);
            let Some((line, pose)) = moments.poses.get(&key) else { continue };
            self.used.insert(key);
            // World from rig, times rig from sensor.
            if let (Some(pose), Some(from_device)) = (pose, from_device) {
                all.push((*line, pose * from_device));
            }
        }
        let Some((line, pose)) = all.first() else {
            self.lost.push(image.to_owned());
            return;
        };
        let apart = |other: &Pose| {
            let metres = (pose.translation.vector - other.translation.vector).norm();
            metres > SAME_M || pose.rotation.angle_to(&other.rotation) > SAME_RAD
        };
        if let Some((other, _)) = all.iter().find(|(_, other)| apart(other)) {
            let image = shorten(image);
            report.line(*other, format!("places `{image}` elsewhere than line {line} does"));
        }
        self.names.push(image);
        self.poses.push(*pose);
    }

    /// Says which poses are of no image: those of other sensors than cameras.
    fn say_rest(&mut self, moments: &Moments, rigs: &Rigs) {
        let is_unused = |key: &&Key| !self.used.contains(*key) && !rigs.is_rig(&key.1);
        let unused = moments.order.iter().filter(is_unused).count();
        if unused > 0 {
            let folder = self.folder.display();
            self.notes.push(format!("{folder}: {unused} poses are of no image and not used"));
        }
    }

    fn finished(mut self) -> Self {
        if let Some(first) = self.lost.first() {
            self.notes.push(format!(
                "{}: {} images have no pose, such as `{}`",
                self.folder.display(),
                self.lost.len(),
                shorten(first)
            ));
        }
        self
    }
}

/// Times are row numbers, the device is `camera`.
pub(super) fn write(folder: &Path, parts: &Parts) -> Result<()> {
    let poses = parts.six_dof()?;
    held::Names::BetweenCommas.check_all(folder, parts)?;
    let sensors = folder.join("sensors");
    fs::create_dir_all(&sensors).map_err(Error::io(&sensors))?;
    let mut trajectories = format!("{VERSION}# timestamp, device_id, qw, qx, qy, qz, tx, ty, tz\n");
    let mut records = format!("{VERSION}# timestamp, device_id, image_path\n");
    for (row, pose) in poses.iter().enumerate() {
        let (translation, wxyz) = PoseConvention::KAPTURE.parts(pose);
        let (translation, wxyz) = (joined(&translation, ", "), joined(&wxyz, ", "));
        let _ = writeln!(trajectories, "{row}, camera, {wxyz}, {translation}");
        let _ = writeln!(records, "{row}, camera, {}", parts.name(row));
    }
    let size = parts.about.image_size.map_or((0, 0), |size| (size.width, size.height));
    let sensors = format!(
        "{VERSION}# sensor_id, name, sensor_type, [sensor_params]+\n\
         camera, camera, camera, UNKNOWN_CAMERA, {}, {}\n",
        size.0, size.1
    );
    let rigs = folder.join(RIGS);
    if rigs.exists() {
        let reason = "is there already, and would be read with what is written";
        return Err(Error::format(rigs, "file", reason));
    }
    replace(&folder.join(SENSORS), sensors.as_bytes())?;
    replace(&folder.join(RECORDS), records.as_bytes())?;
    Ok(replace(&folder.join(TRAJECTORIES), trajectories.as_bytes())?)
}

#[cfg(test)]
mod tests;
