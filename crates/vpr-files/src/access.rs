//! The bytes of an open file: read into a buffer, or mapped into memory.

use std::{fs::File, io};

use memmap2::Mmap;

/// Fills `buffer` with the bytes of `file` from `offset` on, without moving its cursor.
///
/// # Errors
///
/// If there are not so many bytes, or they cannot be read.
#[cfg(unix)]
pub fn read_exact_at(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buffer, offset)
}

/// Fills `buffer` with the bytes of `file` from `offset` on.
///
/// # Errors
///
/// If there are not so many bytes, or they cannot be read.
#[cfg(windows)]
pub fn read_exact_at(file: &File, mut buffer: &mut [u8], mut offset: u64) -> io::Result<()> {
    while !buffer.is_empty() {
        let n_read = std::os::windows::fs::FileExt::seek_read(file, buffer, offset)?;
        if n_read == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        buffer = &mut buffer[n_read..];
        offset += n_read as u64;
    }
    Ok(())
}

/// Maps a whole file for reading.
///
/// A map is never changed after it has been renamed into place: writers make a new file. A process
/// that nevertheless truncates a mapped file makes its readers stop with a bus error, as with every
/// memory-mapped file; [`read_exact_at`] has no such risk.
///
/// # Errors
///
/// If the operating system refuses.
#[expect(unsafe_code, reason = "memory-mapping a file; see docs/decisions.md")]
pub fn map(file: &File) -> io::Result<Mmap> {
    // SAFETY: the mapping is read-only and only ever seen as `&[u8]`. The bytes could change under
    // it only if another process wrote into the file, which no writer of this workspace does (files
    // are written under another name and renamed). Every bit pattern is valid for the types that
    // these bytes are cast to (`bytemuck::AnyBitPattern`).
    unsafe { Mmap::map(file) }
}
