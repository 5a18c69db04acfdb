//! Frames of zstd, as pages of parquet and chunks of HDF5 are, decompressed in Rust.
//!
//! Sizes are believed, so the caller must have compared them with the size of the file.

use ruzstd::decoding::FrameDecoder;

/// What compressors of pages look back; larger windows are for archives.
const LARGEST_WINDOW: u64 = 1 << 23;

/// What a frame holds, which must be `len` bytes; the error says what is wrong with it, to follow what it is.
pub(super) fn decompressed(bytes: &[u8], len: u64) -> Result<Vec<u8>, String> {
    let window = window(bytes).ok_or("is no frame of zstd")?;
    if window > LARGEST_WINDOW.max(len) {
        return Err("wants more memory than it has bytes".to_owned());
    }
    let mut whole = vec![0; usize::try_from(len).map_err(|_| "is too large")?];
    let found = FrameDecoder::new()
        .decode_all(bytes, &mut whole)
        .map_err(|source| format!("cannot be decompressed: {source}"))?;
    if found != whole.len() {
        return Err("has fewer bytes than it claims".to_owned());
    }
    Ok(whole)
}

/// How far back a frame looks, for which the decoder asks for memory at once (RFC 8878, 3.1.1.1).
fn window(frame: &[u8]) -> Option<u64> {
    let rest = frame.strip_prefix(&[0x28, 0xb5, 0x2f, 0xfd])?;
    let (&descriptor, rest) = rest.split_first()?;
    let is_single = descriptor & 0x20 != 0;
    if !is_single {
        let (exponent, mantissa) = (rest.first()? >> 3, u64::from(rest.first()? & 7));
        let base = 1_u64 << (10 + exponent);
        return Some(base + base / 8 * mantissa);
    }
    let dictionary = [0, 1, 2, 4][usize::from(descriptor & 3)];
    let size = [1, 2, 4, 8][usize::from(descriptor >> 6)];
    let field = rest.get(dictionary..dictionary + size)?;
    let number = field.iter().rev().fold(0, |number: u64, byte| number << 8 | u64::from(*byte));
    Some(if size == 2 { number + 256 } else { number })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;

    /// Written by `pyarrow.Codec("zstd").compress(bytes(200000))` of pyarrow 26.0.1: a frame that says its size.
    const ZEROS: [u8; 26] = [
        0x28, 0xb5, 0x2f, 0xfd, 0xa0, 0x40, 0x0d, 0x03, 0x00, 0x54, 0x00, 0x00, 0x10, 0x00, 0x00, 0x01, 0x00,
        0xfb, 0xff, 0x39, 0xc0, 0x02, 0x03, 0x6a, 0x08, 0x00,
    ];

    #[test]
    fn a_window_is_read_before_memory_is_asked_for() {
        assert_eq!(window(&ZEROS), Some(200_000));
        assert_eq!(decompressed(&ZEROS, 200_000).unwrap(), vec![0; 200_000]);
        assert!(decompressed(&ZEROS, 199_999).is_err() && decompressed(&ZEROS, 200_001).is_err());
        assert!((0..ZEROS.len()).all(|len| decompressed(&ZEROS[..len], 200_000).is_err()), "cut off");
        // No single segment: exponent 31 is four terabytes.
        let mut frame = ZEROS;
        (frame[4], frame[5]) = (0x00, 0xf8);
        assert_eq!(window(&frame), Some(1 << 41));
        assert!(decompressed(&frame, 200_000).unwrap_err().contains("more memory"));
        assert_eq!(window(&ZEROS[..6]), None);
        assert_eq!(window(b"no frame"), None);
    }
}
