//! The one in-memory image of this workspace: 8-bit, row-major, colours in the order **red, green, blue**.
//!
//! [`RgbImage`] and [`GrayImage`] are kornia's own type, so everything in kornia-imgproc works on them. Decoding,
//! the gray value and resizing are the ones OpenCV's `imread`, `cvtColor` and `resize` define, because the
//! descriptors of the field were published through them.

mod cubic;
mod equalize;
mod jpeg;
mod resize;

use std::{fs, io::Cursor, path::Path};

use image::{DynamicImage, ImageDecoder, ImageReader, Limits};
use kornia_image::Image;
pub use kornia_image::ImageSize;
use vpr_core::{Error, Result};

pub use self::{cubic::resize_bicubic, equalize::equalize_luma, resize::resize_bilinear};

/// A colour image: height × width × 3 bytes, red first.
pub type RgbImage = Image<u8, 3>;

/// A gray image: height × width bytes.
pub type GrayImage = Image<u8, 1>;

/// No image with more pixels than this is decoded: 64 Mi, three times the largest phone photograph of a place.
pub const MAX_PIXELS: usize = 1 << 26;

/// No file of `n` bytes is believed to hold more than `n` times this many pixels.
///
/// Deflate expands at most 1032-fold and a byte of a 1-bit PNG is 8 pixels; a baseline or progressive JPEG spends
/// at least a bit on a block of 64 pixels. A header that claims more is damaged or hostile.
pub const MAX_PIXELS_PER_BYTE: usize = 8 * 1032;

/// Reads a JPEG or PNG file, told apart by content and turned upright by its EXIF orientation.
///
/// Alpha is dropped, 16-bit samples are rounded to 8, gray is repeated in all three channels.
///
/// # Errors
///
/// [`Error::Io`] if the file cannot be read, and those of [`decode_bytes`].
pub fn decode(path: &Path) -> Result<RgbImage> {
    decode_bytes(&read(path)?, path)
}

/// [`decode`] for a file that is already in memory; `path` only names it in errors.
///
/// # Errors
///
/// [`Error::Format`] if it is neither JPEG nor PNG, if the header claims more than [`MAX_PIXELS`] or
/// [`MAX_PIXELS_PER_BYTE`], or if the pixels are damaged or end early. A JPEG that is cut inside its coded data is
/// refused, although its first rows could be shown; what follows its end (the film of a motion photo, a camera's own
/// block, also where the end marker itself is missing) does not count.
pub fn decode_bytes(bytes: &[u8], path: &Path) -> Result<RgbImage> {
    let mut decoder = decoder(bytes, path)?;
    let damaged = |reason: image::ImageError| Error::format(path, "pixels", reason.to_string());
    if is_jpeg(bytes) && !jpeg::is_complete(bytes) {
        return Err(Error::format(path, "pixels", "the file ends before the image does"));
    }
    let orientation = decoder.orientation().map_err(damaged)?;
    let mut image = DynamicImage::from_decoder(decoder).map_err(damaged)?;
    image.apply_orientation(orientation);
    let image = image.into_rgb8();
    let size = ImageSize { width: image.width() as usize, height: image.height() as usize };
    Ok(from_pixels(size, image.into_raw()))
}

/// Size of an image file as [`decode`] would return it, from its header alone.
///
/// # Errors
///
/// As [`decode`], except for damage behind the header.
pub fn probe(path: &Path) -> Result<ImageSize> {
    let bytes = read(path)?;
    let mut decoder = decoder(&bytes, path)?;
    let (width, height) = decoder.dimensions();
    let orientation = decoder
        .orientation()
        .map_err(|reason| Error::format(path, "header", reason.to_string()))?;
    let (width, height) =
        if turns_sideways(orientation) { (height, width) } else { (width, height) };
    Ok(ImageSize { width: width as usize, height: height as usize })
}

/// Writes a PNG file; an existing file is replaced only when the new one is complete.
///
/// # Errors
///
/// [`Error::Io`] if the file cannot be written, [`Error::Format`] if the image has no pixels.
pub fn write_png(image: &RgbImage, path: &Path) -> Result<()> {
    let refuse = |reason: image::ImageError| Error::format(path, "pixels", reason.to_string());
    let side = |len: usize| u32::try_from(len).unwrap_or(u32::MAX);
    let (width, height) = (side(image.width()), side(image.height()));
    let mut bytes = Cursor::new(Vec::new());
    let (pixels, color) = (image.as_slice(), image::ExtendedColorType::Rgb8);
    image::write_buffer_with_format(
        &mut bytes,
        pixels,
        width,
        height,
        color,
        image::ImageFormat::Png,
    )
    .map_err(refuse)?;
    let mut partial = path.as_os_str().to_owned();
    partial.push(".partial");
    let written = fs::write(&partial, bytes.into_inner()).and_then(|()| fs::rename(&partial, path));
    written.map_err(|reason| {
        let _ = fs::remove_file(&partial);
        Error::io(path)(reason)
    })
}

/// Luma by ITU-R BT.601 in OpenCV's 15-bit fixed point: `(9798 R + 19235 G + 3735 B + 16384) >> 15`.
#[must_use]
pub fn gray(image: &RgbImage) -> GrayImage {
    let (pixels, _) = image.as_slice().as_chunks();
    from_pixels(image.size(), pixels.iter().copied().map(luma).collect())
}

/// An image of these pixels.
///
/// # Panics
///
/// If there are not height × width × `C` of them.
#[must_use]
pub fn from_pixels<const C: usize>(size: ImageSize, pixels: Vec<u8>) -> Image<u8, C> {
    Image::new(size, pixels).expect("height × width × channels bytes")
}

fn luma(pixel: [u8; 3]) -> u8 {
    let [r, g, b] = pixel.map(u32::from);
    u8::try_from((9798 * r + 19_235 * g + 3735 * b + 16_384) >> 15).expect("the weights sum to one")
}

fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).map_err(Error::io(path))
}

/// A decoder whose header is read and believed.
fn decoder<'a>(bytes: &'a [u8], path: &Path) -> Result<impl ImageDecoder + use<'a>> {
    let refuse = |reason: String| Error::format(path, "header", reason);
    let mut reader =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(Error::io(path))?;
    if reader.format().is_none() {
        return Err(refuse("neither JPEG nor PNG".to_owned()));
    }
    let believable = bytes.len().saturating_mul(MAX_PIXELS_PER_BYTE).min(MAX_PIXELS);
    let mut limits = Limits::default();
    limits.max_alloc = Some(8 * believable as u64); // at most four 16-bit samples a pixel
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|reason| refuse(reason.to_string()))?;
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 || pixels > believable as u64 {
        return Err(refuse(format!(
            "{width}x{height} pixels, but a file of {} bytes may hold from 1 to {believable}",
            bytes.len()
        )));
    }
    Ok(decoder)
}

fn is_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0xFF, 0xD8])
}

fn turns_sideways(orientation: image::metadata::Orientation) -> bool {
    use image::metadata::Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    matches!(orientation, Rotate90 | Rotate90FlipH | Rotate270 | Rotate270FlipH)
}

#[cfg(test)]
mod tests {
    use image::ImageFormat;

    use super::*;

    /// Pseudo-random bytes, the same ones that OpenCV was given.
    pub(super) fn noise(width: usize, height: usize) -> RgbImage {
        let byte = |at: usize| u8::try_from(((at * 2_654_435_761) >> 7) % 256).unwrap();
        from_pixels(ImageSize { width, height }, (0..width * height * 3).map(byte).collect())
    }

    /// A smooth image, encoded.
    fn encoded(format: ImageFormat) -> Vec<u8> {
        let image = image::RgbImage::from_fn(48, 32, |x, y| {
            image::Rgb([x * 5, y * 7, x + y].map(|it| u8::try_from(it).unwrap()))
        });
        let mut file = Cursor::new(Vec::new());
        image.write_to(&mut file, format).unwrap();
        file.into_inner()
    }

    fn decode_here(bytes: &[u8]) -> Result<RgbImage> {
        decode_bytes(bytes, Path::new("street.jpg"))
    }

    /// FNV-1a, so that OpenCV's answer fits in a line.
    pub(super) fn digest(bytes: &[u8]) -> u64 {
        bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
    }

    #[test]
    fn png_is_decoded_exactly_red_first() {
        let image = decode_here(&encoded(ImageFormat::Png)).unwrap();
        assert_eq!(image.size(), ImageSize { width: 48, height: 32 });
        assert_eq!(&image.as_slice()[(3 * 48 + 2) * 3..][..3], [10, 21, 5]);
    }

    #[test]
    fn jpeg_is_decoded_closely() {
        let [png, jpeg] = [ImageFormat::Png, ImageFormat::Jpeg].map(encoded);
        let [exact, close] = [png, jpeg].map(|it| decode_here(&it).unwrap());
        let off =
            exact.as_slice().iter().zip(close.as_slice()).map(|(a, b)| f64::from(a.abs_diff(*b)));
        let mean = off.sum::<f64>() / exact.as_slice().len() as f64;
        assert!(mean < 3.0, "{mean}");
    }

    #[test]
    fn truncated_files_are_refused_at_every_length() {
        for format in [ImageFormat::Jpeg, ImageFormat::Png] {
            let bytes = encoded(format);
            // of a PNG, only the checksum of the empty last chunk may be missing
            for length in 0..bytes.len() - 12 {
                let error = decode_here(&bytes[..length]).err();
                let error =
                    error.unwrap_or_else(|| panic!("{format:?} of {length} bytes")).to_string();
                assert!(error.starts_with("street.jpg: "), "{error}");
            }
        }
    }

    #[test]
    fn trailers_change_no_pixel() {
        let whole = encoded(ImageFormat::Jpeg);
        let plain = decode_here(&whole).unwrap();
        let film = b"\0\0\0\x18ftypmp42\x01\x02\x03\xFF\xDA\x09\x09\xFF\xD9";
        let block = b"\0\0\x01\x0ASEFH\0\0\0\0\0\0";
        let without_end = &whole[..whole.len() - 2];
        for file in [[&whole, &film[..]], [&whole, &block[..]], [without_end, &block[..]]] {
            let image = decode_here(&file.concat()).unwrap();
            assert_eq!(image.as_slice(), plain.as_slice());
        }
        let cut = [&whole[..whole.len() / 2], &film[..]].concat();
        let error = decode_here(&cut).err().unwrap().to_string();
        assert!(error.starts_with("street.jpg: "), "{error}");
    }

    #[test]
    fn flipped_bits_never_panic() {
        for format in [ImageFormat::Jpeg, ImageFormat::Png] {
            let bytes = encoded(format);
            for bit in 0..8 * bytes.len() {
                let mut damaged = bytes.clone();
                damaged[bit / 8] ^= 1 << (bit % 8);
                match decode_here(&damaged) {
                    Ok(image) => assert!(image.width() * image.height() <= MAX_PIXELS),
                    Err(error) => assert!(error.to_string().starts_with("street.jpg: "), "{error}"),
                }
            }
        }
    }

    #[test]
    fn headers_that_claim_too_much_are_refused() {
        let mut bytes = encoded(ImageFormat::Jpeg);
        let frame = bytes.windows(2).position(|it| it == [0xFF, 0xC0]).unwrap();
        bytes[frame + 5..frame + 9].fill(0xFF); // 65535 × 65535
        let error = decode_here(&bytes).err().unwrap().to_string();
        assert!(error.starts_with("street.jpg: header: 65535x65535 pixels"), "{error}");
    }

    #[test]
    fn other_files_are_refused() {
        for bytes in [&b""[..], b"GIF89a", b"\x89PNG", b"\xFF\xD8\xFF\xD9"] {
            assert!(decode_here(bytes).is_err());
        }
        let missing = decode(Path::new("no/such.jpg")).err().unwrap();
        assert!(matches!(missing, Error::Io { .. }), "{missing}");
    }

    #[test]
    fn probe_agrees_with_decode() -> std::io::Result<()> {
        let folder = tempfile::tempdir()?;
        for format in [ImageFormat::Jpeg, ImageFormat::Png] {
            let path = folder.path().join("image");
            fs::write(&path, encoded(format))?;
            assert_eq!(probe(&path).unwrap(), decode(&path).unwrap().size());
        }
        Ok(())
    }

    #[test]
    fn what_is_written_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("noise.png");
        write_png(&noise(53, 37), &path).unwrap();
        assert_eq!(decode(&path).unwrap().as_slice(), noise(53, 37).as_slice());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        let nowhere = folder.path().join("no/such/folder.png");
        assert!(matches!(write_png(&noise(2, 2), &nowhere), Err(Error::Io { .. })));
    }

    #[test]
    fn orientation_of_the_camera_is_applied() -> std::io::Result<()> {
        // an EXIF segment with one entry, orientation 6: turn clockwise by a quarter
        let exif = b"\xFF\xE1\x00\x22Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
        let upright = encoded(ImageFormat::Jpeg);
        let turned = [&upright[..2], exif, &upright[2..]].concat();
        let [upright, turned_image] = [&upright, &turned].map(|it| decode_here(it).unwrap());
        let size = ImageSize { width: 32, height: 48 };
        assert_eq!(turned_image.size(), size);
        assert_eq!(turned_image.as_slice()[31 * 3..][..3], upright.as_slice()[..3]);
        let file = tempfile::NamedTempFile::new()?;
        fs::write(file.path(), turned)?;
        assert_eq!(probe(file.path()).unwrap(), size);
        Ok(())
    }

    /// Digest of `cv2.cvtColor(noise, cv2.COLOR_RGB2GRAY)`, OpenCV 4.14.0.
    #[test]
    fn gray_is_that_of_opencv() {
        assert_eq!(digest(gray(&noise(53, 37)).as_slice()), 0xbb52_8b66_683d_90f1);
    }
}
