//! COLMAP's `images.txt` and `images.bin`: camera from world, real part first.

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use super::{
    convention::PoseConvention,
    held,
    parts::Parts,
    report::{Read, Report, joined, number, numbers, read_text},
};
use vpr_core::{Error, Pose, Poses, Result, map::Names};
use vpr_files::replace;

const TEXT: &str = "images.txt";
const BINARY: &str = "images.bin";

/// Reads either file, or that of the folder of a reconstruction; as COLMAP does, the binary one
/// first.
pub(super) fn read(path: &Path) -> Read<Parts> {
    let path =
        if path.is_dir() { file_in(path).map_err(|err| vec![err])? } else { path.to_owned() };
    let is_binary = path.extension().is_some_and(|it| it.eq_ignore_ascii_case("bin"));
    let (names, poses) = if is_binary { read_binary(&path)? } else { read_lines(&path)? };
    Ok(Parts { names: Some(names), poses: Some(Poses::SixDof(poses)), ..Parts::default() })
}

/// Whether a folder has a reconstruction.
pub(super) fn is_in(folder: &Path) -> bool {
    [BINARY, TEXT].iter().any(|name| folder.join(name).is_file())
}

fn file_in(folder: &Path) -> Result<PathBuf> {
    let file = [BINARY, TEXT].map(|name| folder.join(name)).into_iter().find(|it| it.is_file());
    file.ok_or_else(|| Error::format(folder, "folder", format!("has neither {BINARY} nor {TEXT}")))
}

fn pose(numbers: [f64; 7]) -> Result<Pose, String> {
    let [wxyz @ .., x, y, z] = numbers;
    PoseConvention::HLOC.pose([x, y, z], wxyz)
}

/// `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`, and below each a line of points, perhaps empty.
fn read_lines(path: &Path) -> Read<(Names, Vec<Pose>)> {
    let text = read_text(path)?;
    let mut report = Report::new(path);
    let (mut names, mut poses) = (Names::default(), Vec::new());
    let mut lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    while let Some((line, content)) = lines.next() {
        if content.is_empty() || content.starts_with('#') {
            continue;
        }
        if let Some((name, pose)) = report.keep(line, image(content)) {
            names.push(name);
            poses.push(pose);
        }
        if let Some((line, points)) = lines.next()
            && let Err(reason) = check_points(points)
        {
            report.line(line, reason);
        }
    }
    report.finish((names, poses))
}

fn image(content: &str) -> Result<(&str, Pose), String> {
    let mut rest = content;
    let mut next = || {
        let (field, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        rest = after.trim_start();
        field
    };
    let fields: [&str; 9] = std::array::from_fn(|_| next());
    if rest.is_empty() {
        return Err("expected an id, seven numbers of a pose, a camera and a name".to_owned());
    }
    let pose = numbers::<7>(fields[1..8].iter().copied()).and_then(pose)?;
    fields[0]
        .parse::<u32>()
        .map_err(|_| format!("`{}` is no id", vpr_files::shorten(fields[0])))?;
    Ok((rest, pose))
}

/// Points are triples of numbers. Whoever leaves their lines out loses every other image elsewhere.
fn check_points(line: &str) -> Result<(), String> {
    let mut n = 0;
    for field in line.split_whitespace() {
        n += 1;
        if number(field).is_err() {
            let reason = "is no line of points, which stands below every image, if empty";
            return Err(reason.to_owned());
        }
    }
    if n % 3 == 0 { Ok(()) } else { Err(format!("has {n} numbers of points, not three each")) }
}

/// The bytes of a file that are left.
struct Bytes<'a> {
    rest: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(n)?;
        (self.rest, self.at) = (rest, self.at + n);
        Some(taken)
    }

    fn u64(&mut self) -> Option<u64> {
        self.take(8)?.try_into().ok().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.u64().map(f64::from_bits)
    }

    /// Text up to a byte of zero.
    fn text(&mut self) -> Option<&'a [u8]> {
        let length = self.rest.iter().position(|&byte| byte == 0)?;
        let text = self.take(length)?;
        self.take(1)?;
        Some(text)
    }
}

/// A number of images, and of each: id, pose, camera, name, points of 24 bytes.
fn read_binary(path: &Path) -> Read<(Names, Vec<Pose>)> {
    let bytes = fs::read(path).map_err(|source| vec![Error::io(path)(source)])?;
    let mut report = Report::new(path);
    let mut bytes = Bytes { rest: &bytes, at: 0 };
    let (mut names, mut poses) = (Names::default(), Vec::new());
    let cut = |bytes: &Bytes<'_>| format!("byte {}", bytes.at);
    let Some(n) = bytes.u64() else {
        report.at(cut(&bytes), "ends before the number of images");
        return report.finish((names, poses));
    };
    for index in 0..n {
        let Some((name, numbers)) = binary_image(&mut bytes) else {
            report.at(cut(&bytes), format!("ends inside image {index} of {n}"));
            return report.finish((names, poses));
        };
        let finite = numbers.iter().all(|value| value.is_finite());
        let pose = if finite { pose(numbers) } else { Err("is not finite".to_owned()) };
        match (std::str::from_utf8(name), pose) {
            (Ok(name), Ok(pose)) => {
                names.push(name);
                poses.push(pose);
            }
            (Err(_), _) => report.at(format!("image {index}"), "its name is not UTF-8"),
            (_, Err(reason)) => report.at(format!("image {index}"), reason),
        }
    }
    if !bytes.rest.is_empty() {
        let n = bytes.rest.len();
        report.at(cut(&bytes), format!("{n} bytes follow the last image"));
    }
    report.finish((names, poses))
}

fn binary_image<'a>(bytes: &mut Bytes<'a>) -> Option<(&'a [u8], [f64; 7])> {
    bytes.take(4)?;
    let mut numbers = [0.0; 7];
    for value in &mut numbers {
        *value = bytes.f64()?;
    }
    bytes.take(4)?;
    let name = bytes.text()?;
    let n_points = bytes.u64()?;
    bytes.take(usize::try_from(n_points).ok()?.checked_mul(24)?)?;
    Some((name, numbers))
}

/// Ids are row numbers from 1, there is one camera, and no points; binary if the file is called so.
pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    let poses = parts.six_dof()?;
    let is_binary = path.extension().is_some_and(|it| it.eq_ignore_ascii_case("bin"));
    if is_binary {
        return Ok(replace(path, &binary(path, parts, poses)?)?);
    }
    held::Names::Words.check_all(path, parts)?;
    let mut text = String::from(
        "# Image list with two lines of data per image:\n\
         #   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n\
         #   POINTS2D[] as (X, Y, POINT3D_ID)\n",
    );
    for (row, pose) in poses.iter().enumerate() {
        let (translation, wxyz) = PoseConvention::HLOC.parts(pose);
        let (translation, wxyz) = (joined(&translation, " "), joined(&wxyz, " "));
        let _ = writeln!(text, "{} {wxyz} {translation} 1 {}\n", row + 1, parts.name(row));
    }
    Ok(replace(path, text.as_bytes())?)
}

fn binary(path: &Path, parts: &Parts, poses: &[Pose]) -> Result<Vec<u8>> {
    held::Names::Quoted.check_all(path, parts)?;
    let mut bytes = (poses.len() as u64).to_le_bytes().to_vec();
    for (row, pose) in poses.iter().enumerate() {
        let name = parts.name(row);
        let id = u32::try_from(row + 1).ok().filter(|_| !name.contains('\0'));
        let Some(id) = id else {
            let name = format!("name `{}`", vpr_files::shorten(&name));
            return Err(Error::format(path, name, "does not fit: a zero ends a name, ids 32 bits"));
        };
        let (translation, wxyz) = PoseConvention::HLOC.parts(pose);
        bytes.extend(id.to_le_bytes());
        bytes.extend(wxyz.iter().chain(&translation).flat_map(|value| value.to_le_bytes()));
        bytes.extend(1_u32.to_le_bytes());
        bytes.extend(name.bytes().chain([0]));
        bytes.extend(0_u64.to_le_bytes());
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use vpr_core::Position;

    use super::*;

    fn reasons(name: &str, bytes: &[u8]) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let problems = read(&path).unwrap_err();
        let place = format!("{}: ", path.display());
        problems.iter().map(|err| err.to_string().replace(&place, "")).collect()
    }

    #[test]
    fn the_camera_stands_at_minus_r_transposed_t() {
        // Two images as COLMAP writes them: points below the first, none below the second.
        let text = "# Number of images: 2\n\
                    1 0.70710678 0 0 -0.70710678 -2 1 -3 1 a b.jpg\n\
                    10.5 20.5 -1 11 21 7\n\
                    2 1 0 0 0 1 0 0 1 b.jpg\n\n";
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(TEXT), text).unwrap();
        let read = read(folder.path()).unwrap();
        assert_eq!(read.names.unwrap().iter().collect::<Vec<_>>(), ["a b.jpg", "b.jpg"]);
        let poses = read.poses.unwrap();
        // World to camera turns by −90° about z, so the camera stands at (1, 2, 3).
        assert!((poses.position(0) - Position::new(1.0, 2.0, 3.0)).norm() < 1e-7);
        assert_eq!(poses.position(1), Position::new(-1.0, 0.0, 0.0));
    }

    #[test]
    fn lines_without_points_between_them_are_noticed() {
        let image = |id: usize, name: &str| format!("{id} 1 0 0 0 0 0 0 1 {name}\n");
        let text = image(1, "a.jpg") + &image(2, "b.jpg") + &image(3, "c.jpg");
        let found = reasons(TEXT, text.as_bytes());
        assert_eq!(
            found,
            ["line 2: is no line of points, which stands below every image, if empty"]
        );
        let two = reasons(TEXT, b"1 1 0 0 0 0 0 0 1\n\n2 1 0 0 0 0 0 0 1 a\n1 2\n");
        assert_eq!(two.len(), 2, "{two:?}");
    }

    #[test]
    fn binary_files_end_where_they_say() {
        let parts = Parts {
            names: Some(["a b", "c"].into_iter().collect()),
            poses: Some(Poses::SixDof(vec![Pose::translation(1.0, 2.0, 3.0); 2])),
            ..Parts::default()
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(BINARY);
        write(&path, &parts).unwrap();
        let back = read(folder.path()).unwrap();
        assert_eq!((&back.names, &back.poses), (&parts.names, &parts.poses));
        let bytes = fs::read(&path).unwrap();
        for length in 0..bytes.len() {
            assert!(!reasons(BINARY, &bytes[..length]).is_empty(), "{length} bytes");
        }
        let longer = [&bytes, b"x".as_slice()].concat();
        assert_eq!(reasons(BINARY, &longer).len(), 1);
        let err = write(&folder.path().join(TEXT), &parts).unwrap_err().to_string();
        assert!(err.contains("`a b`: has a blank"), "{err}");
    }
}
