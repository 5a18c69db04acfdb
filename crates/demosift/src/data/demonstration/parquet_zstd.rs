//! The pages of a parquet column that is compressed by zstd, which LeRobot's recordings are: decompressed in Rust, as the
//! decoder of the parquet crate wants a C library.
//!
//! Only what [`parquet_pages`] has held against the size of the file gets here, so sizes are believed.

use parquet::basic::Encoding;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};

use crate::data::demonstration::parquet_pages::{self, Kind};
use crate::data::demonstration::zstd;

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

fn decompressed(bytes: &[u8], len: u64) -> Result<Vec<u8>> {
    zstd::decompressed(bytes, len).map_err(|why| broken(&format!("a page {why}")))
}

fn broken(what: &str) -> ParquetError {
    ParquetError::General(what.to_owned())
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
