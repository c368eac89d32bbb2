//! Small JPEG files of images, for reports.

use std::path::{Path, PathBuf};

use image::{RgbImage, codecs::jpeg::JpegEncoder, imageops};
use rayon::prelude::*;
use vpr_report::report::Side;

/// Quality of a thumbnail, of 100.
const QUALITY: u8 = 62;

/// What a report asks for its pictures: thumbnails of queries and references, in parallel.
#[expect(clippy::type_complexity, reason = "the type that a report names `Thumbnails`")]
pub fn thumbnails<'a>(
    queries: &'a [PathBuf],
    references: &'a [PathBuf],
) -> impl Fn(&[(Side, usize)], u32) -> Vec<Result<Vec<u8>, String>> + 'a {
    move |asked, longest| {
        let one = |&(side, index): &(Side, usize)| {
            let paths = if side == Side::Query { queries } else { references };
            let path = paths.get(index).ok_or_else(|| format!("there is no image {index}"))?;
            thumbnail(path, longest)
        };
        asked.par_iter().map(one).collect()
    }
}

fn thumbnail(path: &Path, longest: u32) -> Result<Vec<u8>, String> {
    let image = vpr_vision::image::decode(path).map_err(|err| err.to_string())?;
    let side = |it: usize| u32::try_from(it).unwrap_or(u32::MAX);
    let (width, height) = (side(image.width()), side(image.height()));
    let pixels = image.as_slice().to_vec();
    let image = RgbImage::from_raw(width, height, pixels).ok_or("not three bytes a pixel")?;
    let scale = f64::from(longest) / f64::from(width.max(height).max(1));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels")]
    let scaled = |it: u32| ((f64::from(it) * scale).round() as u32).max(1);
    // Small images stay as they are.
    let small = if scale < 1.0 {
        imageops::thumbnail(&image, scaled(width), scaled(height))
    } else {
        image
    };
    let mut file = Vec::new();
    JpegEncoder::new_with_quality(&mut file, QUALITY)
        .encode_image(&small)
        .map_err(|err| err.to_string())?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    #[test]
    fn thumbnails_fit_and_what_cannot_be_read_says_so() {
        let folder = tempfile::tempdir().unwrap();
        let (good, bad) = (folder.path().join("good.png"), folder.path().join("bad.png"));
        RgbImage::from_pixel(64, 32, Rgb([9, 120, 200])).save(&good).unwrap();
        std::fs::write(&bad, "no image").unwrap();
        let (queries, references) = (vec![good], vec![bad]);
        let made = thumbnails(&queries, &references)(
            &[(Side::Query, 0), (Side::Reference, 0), (Side::Query, 5)],
            20,
        );
        let small = image::load_from_memory(made[0].as_ref().unwrap()).unwrap().to_rgb8();
        assert_eq!(small.dimensions(), (20, 10));
        assert!(
            small.get_pixel(10, 5).0.iter().zip([9_u8, 120, 200]).all(|(a, b)| a.abs_diff(b) < 8)
        );
        assert!(made[1].as_ref().unwrap_err().contains("bad.png"));
        assert!(made[2].as_ref().unwrap_err().contains("no image 5"));
    }
}
