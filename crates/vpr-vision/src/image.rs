//! The one in-memory image of this workspace: 8-bit, row-major, colours in the order **red, green, blue**.
//!
//! [`RgbImage`] and [`GrayImage`] are kornia's own type, so everything in kornia-imgproc works on them. Decoding,
//! the gray value and resizing are the ones OpenCV's `imread`, `cvtColor` and `resize` define, because the
//! descriptors of the field were published through them.

use std::{fs, io::Cursor, path::Path};

use image::{DynamicImage, ImageDecoder, ImageReader, Limits};
pub use kornia_image::ImageSize;
use kornia_image::{Image, InterpolationMode};
use kornia_imgproc::resize::resize_opencv_u8;
use vpr_core::{Error, Result};

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
/// [`MAX_PIXELS_PER_BYTE`], or if the pixels are damaged or end early. A JPEG without its end marker counts as
/// half-written and is refused, although its first rows could be shown.
pub fn decode_bytes(bytes: &[u8], path: &Path) -> Result<RgbImage> {
    let mut decoder = decoder(bytes, path)?;
    let damaged = |reason: image::ImageError| Error::format(path, "pixels", reason.to_string());
    if is_jpeg(bytes) && !is_complete_jpeg(bytes) {
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

/// Luma by ITU-R BT.601 in OpenCV's 14-bit fixed point: `(4899 R + 9617 G + 1868 B + 8192) >> 14`.
#[must_use]
pub fn gray(image: &RgbImage) -> GrayImage {
    let (pixels, _) = image.as_slice().as_chunks();
    from_pixels(image.size(), pixels.iter().copied().map(luma).collect())
}

/// Bilinear resize without anti-aliasing, byte for byte OpenCV's `resize` with `INTER_LINEAR`.
///
/// # Errors
///
/// [`Error::Parameter`] if either image has no pixels.
pub fn resize_bilinear<const C: usize>(
    image: &Image<u8, C>,
    size: ImageSize,
) -> Result<Image<u8, C>> {
    let refuse = |size: ImageSize| Error::Parameter {
        name: "size",
        value: format!("{}x{}", size.width, size.height),
        reason: "an image needs at least one pixel and at most 2^26",
    };
    for size in [image.size(), size] {
        let pixels = size.width.checked_mul(size.height).ok_or_else(|| refuse(size))?;
        if !(1..=MAX_PIXELS).contains(&pixels) {
            return Err(refuse(size));
        }
    }
    let mut resized = Image::from_size_val(size, 0).map_err(|_| refuse(size))?;
    resize_opencv_u8(image, &mut resized, InterpolationMode::Bilinear).map_err(|_| refuse(size))?;
    Ok(resized)
}

fn from_pixels<const C: usize>(size: ImageSize, pixels: Vec<u8>) -> Image<u8, C> {
    Image::new(size, pixels).expect("height × width × channels bytes")
}

fn luma(pixel: [u8; 3]) -> u8 {
    let [r, g, b] = pixel.map(u32::from);
    u8::try_from((4899 * r + 9617 * g + 1868 * b + 8192) >> 14).expect("the weights sum to one")
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

/// Whether an end marker follows the last start of a scan; neither occurs inside of coded pixels.
fn is_complete_jpeg(bytes: &[u8]) -> bool {
    let marker = |code: u8| move |pair: &[u8]| pair == [0xFF, code];
    let last_scan = bytes.windows(2).rposition(marker(0xDA)).unwrap_or(0);
    bytes[last_scan..].windows(2).any(marker(0xD9))
}

fn turns_sideways(orientation: image::metadata::Orientation) -> bool {
    use image::metadata::Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    matches!(orientation, Rotate90 | Rotate90FlipH | Rotate270 | Rotate270FlipH)
}
