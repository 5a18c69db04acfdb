//! The pages of a parquet column that is compressed by zstd, which LeRobot's recordings are: decompressed in Rust, as the
//! decoder of the parquet crate wants a C library.
//!
//! Only what [`parquet_pages`] has held against the size of the file gets here, so sizes are believed.

use parquet::basic::Encoding;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use ruzstd::decoding::FrameDecoder;

use crate::data::demonstration::parquet_pages::{self, Kind};

/// What compressors of pages look back; larger windows are for archives.
const LARGEST_WINDOW: u64 = 1 << 23;

/// Pages that are still to be read.
pub(super) struct Pages {
    chunk: Vec<u8>,
    at: usize,
}

impl Pages {
    pub(super) fn new(chunk: Vec<u8>) -> Self {
        Self { chunk, at: 0 }
    }
}

impl Iterator for Pages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl PageReader for Pages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        while self.at < self.chunk.len() {
            let rest = &self.chunk[self.at..];
            let (header, bytes, len) =
                parquet_pages::page(rest).ok_or_else(|| broken("a page has no header"))?;
            self.at += len;
            let values = u32::try_from(header.values).map_err(|_| broken("a page is too large"))?;
            let encoding = encoding(header.encoding)?;
            return Ok(Some(match header.kind {
                Kind::Dictionary => Page::DictionaryPage {
                    buf: decompressed(bytes, header.uncompressed)?.into(),
                    num_values: values,
                    encoding,
                    is_sorted: false,
                },
                Kind::Data { definition, repetition } => Page::DataPage {
                    buf: decompressed(bytes, header.uncompressed)?.into(),
                    num_values: values,
                    encoding,
                    def_level_encoding: self::encoding(definition)?,
                    rep_level_encoding: self::encoding(repetition)?,
                    statistics: None,
                },
                Kind::DataV2 { gaps, rows, definition_len, repetition_len, is_compressed } => {
                    // The levels stand before the numbers and are never compressed.
                    let levels =
                        usize::try_from(definition_len.saturating_add(repetition_len)).unwrap_or(usize::MAX);
                    let (levels, numbers) =
                        bytes.split_at_checked(levels).ok_or_else(|| broken("levels are cut off"))?;
                    let left = header
                        .uncompressed
                        .checked_sub(levels.len() as u64)
                        .ok_or_else(|| broken("levels are longer than their page"))?;
                    let mut whole = levels.to_vec();
                    match is_compressed && left > 0 {
                        true => whole.extend(decompressed(numbers, left)?),
                        false => whole.extend_from_slice(numbers),
                    }
                    let short = |count: u64| u32::try_from(count).map_err(|_| broken("a page is too large"));
                    Page::DataPageV2 {
                        buf: whole.into(),
                        num_values: values,
                        encoding,
                        num_nulls: short(gaps)?,
                        num_rows: short(rows)?,
                        def_levels_byte_len: short(definition_len)?,
                        rep_levels_byte_len: short(repetition_len)?,
                        is_compressed: false,
                        statistics: None,
                    }
                }
                Kind::Other => continue,
            }));
        }
        Ok(None)
    }

    /// By which the reader sees whether a row may go on in the next page.
    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        let rest = &self.chunk[self.at..];
        if rest.is_empty() {
            return Ok(None);
        }
        let (header, ..) = parquet_pages::page(rest).ok_or_else(|| broken("a page has no header"))?;
        let count = |count: u64| usize::try_from(count).map_err(|_| broken("a page is too large"));
        Ok(Some(PageMetadata {
            num_rows: match header.kind {
                Kind::DataV2 { rows, .. } => Some(count(rows)?),
                _ => None,
            },
            num_levels: Some(count(header.values)?),
            is_dict: matches!(header.kind, Kind::Dictionary),
        }))
    }

    fn skip_next_page(&mut self) -> Result<()> {
        let rest = &self.chunk[self.at..];
        let (.., len) = parquet_pages::page(rest).ok_or_else(|| broken("a page has no header"))?;
        self.at += len;
        Ok(())
    }
}

fn broken(what: &str) -> ParquetError {
    ParquetError::General(what.to_owned())
}

/// What a page holds, which must be `len` bytes; or a chunk of HDF5.
pub(super) fn decompressed(bytes: &[u8], len: u64) -> Result<Vec<u8>> {
    let window = window(bytes).ok_or_else(|| broken("a page is no frame of zstd"))?;
    if window > LARGEST_WINDOW.max(len) {
        return Err(broken("a frame of zstd wants more memory than its page has bytes"));
    }
    let mut whole = vec![0; usize::try_from(len).map_err(|_| broken("a page is too large"))?];
    let found = FrameDecoder::new()
        .decode_all(bytes, &mut whole)
        .map_err(|source| broken(&format!("a page cannot be decompressed: {source}")))?;
    if found != whole.len() {
        return Err(broken("a page has fewer bytes than it claims"));
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

/// As `parquet.thrift` numbers them.
fn encoding(number: u64) -> Result<Encoding> {
    Ok(match number {
        0 => Encoding::PLAIN,
        2 => Encoding::PLAIN_DICTIONARY,
        3 => Encoding::RLE,
        5 => Encoding::DELTA_BINARY_PACKED,
        6 => Encoding::DELTA_LENGTH_BYTE_ARRAY,
        7 => Encoding::DELTA_BYTE_ARRAY,
        8 => Encoding::RLE_DICTIONARY,
        9 => Encoding::BYTE_STREAM_SPLIT,
        other => return Err(broken(&format!("an encoding of number {other} is not known"))),
    })
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
        assert!(decompressed(&frame, 200_000).unwrap_err().to_string().contains("more memory"));
        assert_eq!(window(&ZEROS[..6]), None);
        assert_eq!(window(b"no frame"), None);
    }
}
