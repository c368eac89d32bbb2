//! kapture 1.1: `sensors/trajectories.txt` (device from world, wxyz) and `records_camera.txt`.

use std::{
    collections::{HashMap, HashSet},
    fmt::Write as _,
    fs,
    path::Path,
};

use super::{
    convention::PoseConvention,
    parts::Parts,
    report::{Read, Report, content_lines, joined, numbers, read_text},
};
use vpr_core::{Error, Poses, Result, map::Names};
use vpr_files::replace;

const TRAJECTORIES: &str = "sensors/trajectories.txt";
const RECORDS: &str = "sensors/records_camera.txt";
const SENSORS: &str = "sensors/sensors.txt";
const VERSION: &str = "# kapture format: 1.1\n";

/// One image per line of the trajectory; its name is that of the record with the same time and
/// device, or `time/device` if there is none.
pub(super) fn read(folder: &Path) -> Read<Parts> {
    let path = folder.join(TRAJECTORIES);
    let text = read_text(&path)?;
    let images = match folder.join(RECORDS) {
        records if records.exists() => read_records(&records)?,
        _ => HashMap::new(),
    };
    let mut report = Report::new(&path);
    let mut seen = HashSet::new();
    let (mut names, mut poses) = (Names::default(), Vec::new());
    for (line, content) in content_lines(&text) {
        let fields: Vec<&str> = content.split(',').map(str::trim).collect();
        let [time, device, numbers_of @ ..] = fields.as_slice() else {
            report.line(line, "expected timestamp, device, qw, qx, qy, qz, tx, ty, tz");
            continue;
        };
        let pose = numbers::<7>(numbers_of.iter().copied()).and_then(|[w, i, j, k, x, y, z]| {
            PoseConvention::KAPTURE.pose([x, y, z], [w, i, j, k])
        });
        let key = (time.to_string(), device.to_string());
        let Some(pose) = report.keep(line, pose) else { continue };
        match images.get(&key) {
            Some(image) => names.push(image),
            None => names.push(&format!("{time}/{device}")),
        }
        poses.push(pose);
        if !seen.insert(key) {
            report.line(line, format!("a second pose of device {device} at time {time}"));
        }
    }
    let poses = Some(Poses::SixDof(poses));
    report.finish(Parts { names: Some(names), poses, ..Parts::default() })
}

/// Image by time and device.
fn read_records(path: &Path) -> Read<HashMap<(String, String), String>> {
    let text = read_text(path)?;
    let mut report = Report::new(path);
    let mut images = HashMap::new();
    for (line, content) in content_lines(&text) {
        let mut fields = content.splitn(3, ',').map(|field| field.trim().to_owned());
        match (fields.next(), fields.next(), fields.next()) {
            (Some(time), Some(device), Some(image)) => {
                images.insert((time, device), image);
            }
            _ => report.line(line, "expected timestamp, device, image"),
        }
    }
    report.finish(images)
}

/// Times are row numbers, the device is `camera`.
pub(super) fn write(folder: &Path, parts: &Parts) -> Result<()> {
    let poses = parts.six_dof()?;
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
    replace(&folder.join(SENSORS), sensors.as_bytes())?;
    replace(&folder.join(RECORDS), records.as_bytes())?;
    Ok(replace(&folder.join(TRAJECTORIES), trajectories.as_bytes())?)
}
