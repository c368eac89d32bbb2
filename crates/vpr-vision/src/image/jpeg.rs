//! Whether a JPEG file has its whole image, found by walking its markers (ITU-T T.81, annex B).
//!
//! What follows the end marker is not part of the image: the film of a motion photo, a camera's own
//! block. Some phones leave the end marker out and go on with such a block. Where anything follows,
//! the coded units of the image are counted, so that bytes of the film are not taken for its end.

mod entropy;

use entropy::{Length, Scan};

const START_OF_SCAN: u8 = 0xDA;
const END_OF_IMAGE: u8 = 0xD9;
const HUFFMAN_TABLES: u8 = 0xC4;
const RESTART_INTERVAL: u8 = 0xDD;
/// Sequential frames with Huffman codes, baseline and extended.
const SEQUENTIAL: [u8; 2] = [0xC0, 0xC1];

/// Whether the file has all of its image: its scans and what ends them.
pub(super) fn is_complete(bytes: &[u8]) -> bool {
    let mut scan = Scan::default();
    let mut at = 2; // behind the start of the image
    loop {
        let Some((code, start)) = next_marker(bytes, at) else { return false };
        at = start;
        match code {
            END_OF_IMAGE => return scan.has_begun() && scan.is_last(),
            // Without content: restarts between scans, a second start.
            0x01 | 0xD0..=0xD8 => continue,
            _ => {}
        }
        let Some(segment) = segment(bytes, at) else { return false };
        at += 2 + segment.len();
        match code {
            HUFFMAN_TABLES => scan.tables(segment),
            RESTART_INTERVAL => scan.restart_interval(segment),
            // C8 is no frame, CC sets up another coding.
            0xC0..=0xCF if code != 0xC8 && code != 0xCC => {
                scan.frame(segment, SEQUENTIAL.contains(&code));
            }
            START_OF_SCAN => {
                scan.begin(segment);
                let coded = &bytes[at..];
                let end = end_of_coded(coded);
                if end.is_some_and(|end| coded[end..] == [0xFF, END_OF_IMAGE]) {
                    return true;
                }
                match (scan.length(segment, coded), end) {
                    (Length::Whole(length), _) => {
                        let rest = &coded[length..];
                        // Whatever else follows the last unit is not what ends an image.
                        if scan.is_last() && rest.first() != Some(&0xFF) {
                            return rest.is_empty() || is_appended(rest);
                        }
                        at += length;
                    }
                    (Length::Unknown, Some(end)) => at += end,
                    (Length::Short, _) | (Length::Unknown, None) => return false,
                }
            }
            _ => {}
        }
    }
}

/// The code of the next marker from `at` on, and where it ends. Bytes before it are skipped, as
/// decoders do.
fn next_marker(bytes: &[u8], at: usize) -> Option<(u8, usize)> {
    let rest = bytes.get(at..)?;
    let found = rest.windows(2).position(|pair| pair[0] == 0xFF && !matches!(pair[1], 0 | 0xFF))?;
    Some((rest[found + 1], at + found + 2))
}

/// The content of the segment whose length stands at `at`.
fn segment(bytes: &[u8], at: usize) -> Option<&[u8]> {
    let length = bytes.get(at..)?.first_chunk::<2>().map(|it| u16::from_be_bytes(*it))?;
    bytes.get(at + 2..at + usize::from(length))
}

/// Where coded data ends: at the next marker that is no restart.
fn end_of_coded(coded: &[u8]) -> Option<usize> {
    let is_end = |pair: &[u8]| pair[0] == 0xFF && !matches!(pair[1], 0 | 0xD0..=0xD7 | 0xFF);
    coded.windows(2).position(is_end)
}

/// Blocks of Samsung's cameras begin with two zeros and a type; its list of blocks with `SEFH`.
fn is_appended(rest: &[u8]) -> bool {
    matches!(rest, [0, 0, _, 0x0A, ..]) || rest.starts_with(b"SEFH")
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    /// A smooth picture with some noise, encoded.
    fn jpeg(width: u32, height: u32) -> Vec<u8> {
        let image = image::RgbImage::from_fn(width, height, |x, y| {
            let noise = (x * 7919 + y * 104_729) % 23;
            image::Rgb([x * 3 + noise, y * 5, x + y].map(|it| u8::try_from(it % 256).unwrap()))
        });
        let mut file = Cursor::new(Vec::new());
        image.write_to(&mut file, image::ImageFormat::Jpeg).unwrap();
        file.into_inner()
    }

    /// The film of a motion photo, with bytes that look like markers.
    const FILM: &[u8] = b"\0\0\0\x18ftypmp42\x01\xFF\xDA\x09\xFF\xD9\xFF\xC4\0";
    /// A block of a Samsung camera.
    const BLOCK: &[u8] = b"\0\0\x01\x0ASEFH\0\0\0\0\xFF\xD9\0\0";

    #[test]
    fn what_follows_the_end_does_not_count() {
        for size in [(48, 32), (33, 17), (8, 8), (1, 1)] {
            let whole = jpeg(size.0, size.1);
            let without_end = &whole[..whole.len() - 2];
            assert!(is_complete(&whole));
            for trailer in [FILM, BLOCK, &[0; 512], &whole] {
                assert!(is_complete(&[&whole, trailer].concat()), "{size:?}");
            }
            assert!(is_complete(without_end), "{size:?}: all units are there");
            assert!(is_complete(&[without_end, BLOCK].concat()), "{size:?}");
            assert!(is_complete(&[without_end, b"SEFH\x01\0"].concat()), "{size:?}");
        }
    }

    #[test]
    fn a_cut_scan_is_noticed_whatever_follows() {
        let whole = jpeg(48, 32);
        let scan = whole.windows(2).position(|it| it == [0xFF, START_OF_SCAN]).unwrap();
        for length in 0..whole.len() - 3 {
            assert!(!is_complete(&whole[..length]), "{length}");
        }
        for length in (scan + 14..whole.len() - 8).step_by(3) {
            for trailer in [FILM, BLOCK] {
                let cut = [&whole[..length], trailer].concat();
                assert!(!is_complete(&cut), "{length}");
            }
        }
    }

    #[test]
    fn restarts_and_separate_scans_are_walked() {
        // One block per component and scan: a code of one bit each for the mean (size 0) and for
        // the end of the block, filled up with ones.
        let tables = |class: u8| {
            let mut segment = vec![0xFF, HUFFMAN_TABLES, 0, 20, class << 4, 1];
            segment.extend([0; 16]);
            segment
        };
        let frame = |height: u8| {
            [0xFF, 0xC0, 0, 14, 8, 0, height, 0, 8, 2, 1, 0x11, 0, 2, 0x11, 0].as_slice().to_vec()
        };
        let scan = |id: u8| [0xFF, START_OF_SCAN, 0, 8, 1, id, 0, 0, 63, 0].as_slice().to_vec();
        let start = [vec![0xFF, 0xD8], tables(0), tables(1), frame(8)].concat();
        let unit = [0b0011_1111];
        let first = [start.clone(), scan(1), unit.to_vec()].concat();
        let both = [first.clone(), scan(2), unit.to_vec()].concat();
        assert!(!is_complete(&first) && !is_complete(&[&first, BLOCK].concat()));
        assert!(is_complete(&both) && is_complete(&[&both, BLOCK].concat()));
        // Two units, one restart between them.
        let start = [vec![0xFF, 0xD8], tables(0), tables(1), frame(16)].concat();
        let interval = [0xFF, RESTART_INTERVAL, 0, 4, 0, 1];
        let header = [0xFF, START_OF_SCAN, 0, 10, 2, 1, 0, 2, 0, 0, 63, 0];
        let unit = [0b0000_1111];
        let coded = [&unit[..], &[0xFF, 0xD0], &unit].concat();
        let whole = [&start, &interval[..], &header, &coded].concat();
        assert!(is_complete(&whole));
        assert!(!is_complete(&whole[..whole.len() - 1]));
        assert!(!is_complete(&whole[..whole.len() - 3]));
        assert!(is_complete(&[&whole, BLOCK].concat()));
    }
}
