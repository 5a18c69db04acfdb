//! HDF5 files whose tables zstd or lz4 compresses, which the HDF5 reader knows no way back from: their chunks are decompressed
//! here, and what is read is a copy of the file in memory without filters.
//!
//! Of such a file tables of one or two dimensions are copied, and what those hold that need no unpacking; images are not, and
//! nobody reads them.
//!
//! | filter | number | a chunk |
//! |---|---|---|
//! | shuffle | 2 | the first bytes of all elements, then the second ones |
//! | Fletcher's checksum | 3 | four bytes at the end, which are not checked |
//! | lz4 | 32004 | size (8 bytes) and size of a block (4), both big-endian; then each block behind its size, raw if that is the whole |
//! | zstd | 32015 | a frame |

use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

use hdf5_pure::{DType, Dataset, File, FileBuilder, FormatError, Group, GroupBuilder};

use super::{DEEPEST, MOST_COMPRESSION, check_size, damaged};
use crate::basics::error::{Error, Result};
use crate::data::demonstration::zstd;

const SHUFFLE: u16 = 2;
const FLETCHER: u16 = 3;
const LZ4: u16 = 32004;
const ZSTD: u16 = 32015;

/// Groups and datasets that are looked at; a file whose groups hold each other has no end.
const MOST_LOOKED_AT: usize = 200_000;

/// The file without its filters, in memory; `None` where the HDF5 reader needs no help.
///
/// # Errors
/// `is_bad_input` if a chunk is damaged, or other filters are mixed in; `is_io` if the file may not be read.
pub(super) fn unpacked(file: &File, path: &Path, file_len: u64) -> Result<Option<File>> {
    // What cannot be looked at is reported where it is read.
    let mut left = MOST_LOOKED_AT;
    if !is_packed(&file.root(), DEEPEST, &mut left).unwrap_or(false) {
        return Ok(None);
    }
    let bytes = std::fs::File::open(path)
        .map_err(|source| Error::io("cannot read the demonstrations", path, &source))?;
    let mut packed = Packed { bytes, path, file_len, left: file_len.saturating_mul(MOST_COMPRESSION) };
    let mut copy = FileBuilder::new();
    let root = file.root();
    for name in root.datasets().map_err(damaged)? {
        if let Some(table) = packed.table(&root.dataset(&name).map_err(damaged)?, &name)? {
            copy.create_dataset(&name)
                .with_raw_data(table.datatype, table.bytes, table.shape.iter().product())
                .with_shape(&table.shape);
        }
    }
    for name in root.groups().map_err(damaged)? {
        let mut group = copy.create_group(&name);
        packed.fill(&mut group, &root.group(&name).map_err(damaged)?, DEEPEST)?;
        copy.add_group(group.finish());
    }
    let copy = copy.finish().and_then(File::from_bytes).map_err(damaged)?;
    Ok(Some(copy))
}

fn is_packed(group: &Group, deepest: usize, left: &mut usize) -> std::result::Result<bool, hdf5_pure::Error> {
    for name in group.datasets()? {
        *left = left.saturating_sub(1);
        if *left == 0 || is_ours(&group.dataset(&name)?) {
            return Ok(*left > 0);
        }
    }
    for name in group.groups()? {
        *left = left.saturating_sub(1);
        if *left > 0 && deepest > 0 && is_packed(&group.group(&name)?, deepest - 1, left)? {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Whether a dataset has a filter that is taken back here.
fn is_ours(dataset: &Dataset) -> bool {
    dataset.filters().iter().any(|filter| [LZ4, ZSTD].contains(filter))
}

/// The file that the chunks lie in.
struct Packed<'a> {
    bytes: std::fs::File,
    path: &'a Path,
    file_len: u64,
    /// How many bytes more the copy may have: one table may have many names.
    left: u64,
}

/// A table without its filters.
struct Plain {
    datatype: hdf5_pure::Datatype,
    shape: Vec<u64>,
    bytes: Vec<u8>,
}

impl Packed<'_> {
    fn fill(&mut self, copy: &mut GroupBuilder, group: &Group, deepest: usize) -> Result<()> {
        let mut attributes: Vec<_> = group.attrs().map_err(damaged)?.into_iter().collect();
        attributes.sort_by(|one, other| one.0.cmp(&other.0));
        attributes.into_iter().for_each(|(name, value)| copy.set_attr(&name, value));
        for name in group.datasets().map_err(damaged)? {
            if let Some(table) = self.table(&group.dataset(&name).map_err(damaged)?, &name)? {
                copy.create_dataset(&name)
                    .with_raw_data(table.datatype, table.bytes, table.shape.iter().product())
                    .with_shape(&table.shape);
            }
        }
        for name in group.groups().map_err(damaged)? {
            let Some(deeper) = deepest.checked_sub(1) else { return Ok(()) };
            let mut inner = copy.create_group(&name);
            self.fill(&mut inner, &group.group(&name).map_err(damaged)?, deeper)?;
            copy.add_group(inner.finish());
        }
        Ok(())
    }

    /// `None` for what nobody reads: images, and elements that point to other places of the file.
    fn table(&mut self, dataset: &Dataset, name: &str) -> Result<Option<Plain>> {
        let shape = dataset.shape().map_err(damaged)?;
        let is_plain = !matches!(
            dataset.dtype().map_err(damaged)?,
            DType::VariableLengthString | DType::ObjectReference | DType::Compound(_) | DType::Array(..)
        );
        if !is_plain || !(1..=2).contains(&shape.len()) {
            return Ok(None);
        }
        check_size(dataset, name, &shape, self.file_len)?;
        let datatype = dataset.datatype().map_err(damaged)?;
        let bytes = match is_ours(dataset) {
            true => self.unpack(dataset, name, &shape).map_err(|error| error.during(name))?,
            false => dataset.read_raw().map_err(damaged)?,
        };
        self.left = self
            .left
            .checked_sub(bytes.len() as u64)
            .ok_or_else(|| broken("its tables claim more than the file can hold"))?;
        Ok(Some(Plain { datatype, shape, bytes }))
    }

    /// All elements of a table in their order.
    fn unpack(&mut self, dataset: &Dataset, name: &str, shape: &[u64]) -> Result<Vec<u8>> {
        let size = |number: u64| {
            usize::try_from(number)
                .map_err(|_| Error::bad_input(format!("'{name}' is too large for this machine")))
        };
        let element = size(dataset.element_size().map_err(damaged)?)?.max(1);
        let chunk = dataset.chunk_shape().map_err(damaged)?.unwrap_or_default();
        let (rows, columns) = (size(shape[0])?, size(shape.get(1).copied().unwrap_or(1))?);
        let (chunk_rows, chunk_columns) = match *chunk.as_slice() {
            [rows] => (size(rows)?, 1),
            [rows, columns] => (size(rows)?, size(columns)?),
            _ => return Err(broken("its chunks have another number of dimensions")),
        };
        if chunk_rows == 0 || chunk_columns == 0 {
            return Err(broken("its chunks are empty"));
        }
        // Held against the size of the file before, as the table is.
        let chunk_bytes = chunk_rows * chunk_columns * element;
        let mut whole = vec![0; rows * columns * element];
        let chunks = dataset.chunks().map_err(damaged)?;
        let wanted = rows.div_ceil(chunk_rows) * columns.div_ceil(chunk_columns);
        if chunks.len() != wanted {
            return Err(broken(&format!("{wanted} chunks are wanted, and {} are there", chunks.len())));
        }
        for part in chunks {
            let stored = self.stored(part.address, part.storage_size)?;
            let plain = taken_back(
                stored,
                &dataset.filters(),
                part.filter_mask,
                &Chunk { bytes: chunk_bytes, element },
            )?;
            let at = |place: usize| part.offset.get(place).copied().map_or(Ok(0), size);
            let (first_row, first_column) = (at(0)?, at(1)?);
            if first_row >= rows || first_column >= columns {
                return Err(broken("a chunk lies outside of its table"));
            }
            // A chunk may hang over the edge of its table.
            let width = chunk_columns.min(columns - first_column) * element;
            for row in 0..chunk_rows.min(rows - first_row) {
                let from = row * chunk_columns * element;
                let to = ((first_row + row) * columns + first_column) * element;
                whole[to..to + width].copy_from_slice(&plain[from..from + width]);
            }
        }
        Ok(whole)
    }

    fn stored(&mut self, address: u64, len: u64) -> Result<Vec<u8>> {
        if address.checked_add(len).is_none_or(|end| end > self.file_len) {
            return Err(broken("a chunk lies behind the end of the file"));
        }
        let mut bytes = Vec::new();
        let read = self
            .bytes
            .seek(SeekFrom::Start(address))
            .and_then(|_| (&mut self.bytes).take(len).read_to_end(&mut bytes));
        read.map_err(|source| Error::io("cannot read the demonstrations", self.path, &source))?;
        Ok(bytes)
    }
}

/// What a chunk holds without its filters.
struct Chunk {
    bytes: usize,
    /// Bytes of an element.
    element: usize,
}

/// A chunk without its filters, which are taken back in the opposite order; those in the mask were left out.
fn taken_back(stored: Vec<u8>, filters: &[u16], mask: u32, chunk: &Chunk) -> Result<Vec<u8>> {
    let applied: Vec<u16> = filters
        .iter()
        .enumerate()
        .filter(|(place, _)| *place >= 32 || (mask >> place) & 1 == 0)
        .map(|(_, filter)| *filter)
        .collect();
    let mut bytes = stored;
    for (place, filter) in applied.iter().enumerate().rev() {
        // Checksums of the filters before it are part of what it holds.
        let checksums = applied[..place].iter().filter(|before| **before == FLETCHER).count();
        let len = chunk.bytes + 4 * checksums;
        bytes = match *filter {
            SHUFFLE => unshuffled(&bytes, chunk.element),
            FLETCHER => bytes[..bytes.len().saturating_sub(4)].to_vec(),
            ZSTD => zstd::decompressed(&bytes, len as u64).map_err(|why| broken(&format!("it {why}")))?,
            LZ4 => of_lz4(&bytes, len)?,
            other => return Err(damaged(hdf5_pure::Error::Format(FormatError::UnsupportedFilter(other)))),
        };
    }
    if bytes.len() != chunk.bytes {
        return Err(broken(&format!("a chunk holds {} bytes, and must hold {}", bytes.len(), chunk.bytes)));
    }
    Ok(bytes)
}

fn unshuffled(bytes: &[u8], element: usize) -> Vec<u8> {
    let count = bytes.len() / element;
    let (planes, rest) = bytes.split_at(count * element);
    let mut plain: Vec<u8> =
        (0..count).flat_map(|index| (0..element).map(move |byte| planes[byte * count + index])).collect();
    plain.extend_from_slice(rest);
    plain
}

/// The blocks of a chunk by lz4, which must be `len` bytes in all.
fn of_lz4(bytes: &[u8], len: usize) -> Result<Vec<u8>> {
    let cut = || broken("a chunk by lz4 is cut off");
    let (total, rest) = bytes.split_first_chunk::<8>().ok_or_else(cut)?;
    let (block, mut rest) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
    let (total, block) = (u64::from_be_bytes(*total), u32::from_be_bytes(*block) as usize);
    if total != len as u64 || block == 0 {
        return Err(broken(&format!("a chunk by lz4 says {total} bytes, and must have {len}")));
    }
    let mut whole = vec![0; len];
    for part in whole.chunks_mut(block) {
        let (size, behind) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
        let (stored, behind) = behind.split_at_checked(u32::from_be_bytes(*size) as usize).ok_or_else(cut)?;
        rest = behind;
        if stored.len() == part.len() {
            part.copy_from_slice(stored);
            continue;
        }
        let found = lz4_flex::block::decompress_into(stored, part)
            .map_err(|error| broken(&format!("a chunk by lz4 cannot be decompressed: {error}")))?;
        if found != part.len() {
            return Err(broken("a block by lz4 is too short"));
        }
    }
    Ok(whole)
}

fn broken(what: &str) -> Error {
    Error::bad_input(format!("the HDF5 file is damaged or truncated: {what}"))
        .with_hint("was it copied or downloaded completely?")
}
