//! Files that are read whole, up to a limit, and the pieces of their texts.

use std::fs::File;
use std::io::{Error, ErrorKind, Read as _, Result};
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The number of files being read.
static OPEN: AtomicUsize = AtomicUsize::new(0);

/// Whether a thread of this program waits for a case, a mesh or a matrix. That may be a pipe that nobody fills, so
/// nothing else can be done before.
pub fn is_reading() -> bool {
    OPEN.load(Ordering::SeqCst) > 0
}

/// Counts a file that is being read.
struct Reading;

impl Reading {
    fn begin() -> Self {
        OPEN.fetch_add(1, Ordering::SeqCst);
        Self
    }
}

impl Drop for Reading {
    fn drop(&mut self) {
        OPEN.fetch_sub(1, Ordering::SeqCst);
    }
}

/// The most bytes of a mesh or a matrix file: a quarter of the memory. K and its factor take more than three times the
/// size of the file, so a larger one could not be solved either.
pub(crate) fn data_limit() -> usize {
    crate::memory::total_bytes().map_or(usize::MAX, |bytes| bytes / 4)
}

/// All bytes of a file or a pipe that has no more than `limit` of them.
///
/// # Errors
/// Those of the system; or if the file is larger, or `path` is a device, which may have no end.
pub(crate) fn whole(path: &Path, limit: usize) -> Result<Vec<u8>> {
    // A pipe makes its reader wait as soon as it is opened.
    let _reading = Reading::begin();
    let file = File::open(path)?;
    let there = file.metadata()?;
    if is_device(&there) {
        return Err(Error::new(
            ErrorKind::InvalidInput,
            "this is a device: name a file, or a pipe",
        ));
    }
    let too_large = || {
        let mib = limit.div_ceil(1 << 20);
        Error::new(
            ErrorKind::FileTooLarge,
            format!("it is larger than the limit of {mib} MiB: is this the right file?"),
        )
    };
    let length = usize::try_from(there.len()).unwrap_or(usize::MAX);
    if there.is_file() && length > limit {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    // The system does not know the length of a pipe.
    bytes.try_reserve_exact(length)?;
    file.take((limit as u64).saturating_add(1))
        .read_to_end(&mut bytes)?;
    if bytes.len() > limit {
        return Err(too_large());
    }
    Ok(bytes)
}

/// Ranges of about `piece` bytes that end after a byte that `ends` them.
pub(crate) fn pieces(text: &[u8], piece: usize, ends: impl Fn(u8) -> bool) -> Vec<Range<usize>> {
    let mut pieces = Vec::new();
    let mut start = 0;
    while start < text.len() {
        let least = (start + piece).min(text.len());
        // A piece that ends there does not need the next byte.
        let end = (text[least - 1..].iter().position(|&byte| ends(byte)))
            .map_or(text.len(), |more| least + more);
        pieces.push(start..end);
        start = end;
    }
    pieces
}

/// Ranges of about `piece` bytes that end where lines end.
pub(crate) fn line_pieces(text: &[u8], piece: usize) -> Vec<Range<usize>> {
    pieces(text, piece, |byte| byte == b'\n')
}

#[cfg(unix)]
fn is_device(there: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt as _;
    let kind = there.file_type();
    kind.is_char_device() || kind.is_block_device()
}

#[cfg(not(unix))]
fn is_device(_there: &std::fs::Metadata) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_up_to_the_limit() {
        let place = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
        let path = place.path().join("a");
        std::fs::write(&path, b"four").unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(whole(&path, 4).ok().as_deref(), Some(&b"four"[..]));
        let failure = whole(&path, 3).map_err(|error| error.kind());
        assert_eq!(failure, Err(ErrorKind::FileTooLarge));
        assert!(data_limit() > 1 << 26);
    }

    /// A pipe has no length, and its writer may never stop.
    #[cfg(unix)]
    #[test]
    fn pipes_without_an_end_are_refused() {
        let place = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
        let pipe = place.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.is_ok_and(|status| status.success()));
        let writer = std::thread::spawn({
            let pipe = pipe.clone();
            move || -> Result<()> {
                use std::io::Write as _;
                let mut pipe = std::fs::OpenOptions::new().write(true).open(pipe)?;
                loop {
                    pipe.write_all(&[b' '; 4096])?;
                }
            }
        });
        let failure = whole(&pipe, 100_000).map_err(|error| error.to_string());
        assert!(
            failure
                .as_ref()
                .is_err_and(|text| text.contains("larger than the limit of 1 MiB")),
            "{failure:?}"
        );
        assert!(writer.join().is_ok_and(|ended| ended.is_err()));
        let failure = whole(Path::new("/dev/zero"), 4).map_err(|error| error.to_string());
        assert!(failure.is_err_and(|text| text.contains("this is a device")));
    }
}
