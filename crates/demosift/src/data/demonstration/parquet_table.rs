//! Columns of numbers from parquet files that may be damaged, or made to harm.
//!
//! Read column by column without Arrow: a scalar column is one number a row, a list column as many a row as the first row has.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use parquet::basic::{Compression, LogicalType, Type as Physical};
use parquet::column::reader::{ColumnReaderImpl, get_typed_column_reader};
use parquet::data_type::{
    BoolType, ByteArrayType, DataType, DoubleType, FixedLenByteArrayType, FloatType, Int32Type, Int64Type,
};
use parquet::errors::ParquetError;
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::reader::{ChunkReader as _, FileReader as _, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use crate::basics::error::{Error, Result};
use crate::data::demonstration::episode::{Columns, side_by_side, trailing_number};
use crate::data::demonstration::listing::ColumnSeen;
use crate::data::demonstration::named::{Named, half, listed, option_for};
use crate::data::demonstration::parquet_pages;
use crate::data::demonstration::parquet_ragged::{self, Held, Levels, Ragged, differing};
use crate::data::demonstration::parquet_zstd::Pages;
use crate::data::demonstration::pointer;
use crate::math::rows::Rows;

/// A run of equal numbers takes a few bytes however long it is, so even a small file may hold this many.
const FEW_NUMBERS: u64 = 1 << 22;
/// More numbers a byte are a claim that no data set makes.
const MOST_NUMBERS_A_BYTE: u64 = 64;
/// A page of zstd may hold this many bytes, however few it was compressed to; writers make pages of 1 MiB.
const MOST_BYTES_OF_A_FEW: u64 = 1 << 24;
/// Rows that are decoded at a time.
const BATCH: usize = 4096;

/// An open file.
pub(super) struct Table {
    file: File,
    reader: SerializedFileReader<File>,
    most_numbers: u64,
}

/// The numbers of a column, row after row.
struct Column<T> {
    values: Vec<T>,
    width: usize,
}

/// All parquet files below a folder, by the numbers at the end of their names, then by their names.
///
/// # Errors
/// `is_io` if a folder cannot be listed.
pub(super) fn files_below(folder: &Path) -> Result<Vec<PathBuf>> {
    let failed = |source: std::io::Error| Error::io("cannot look into the data set", folder, &source);
    let mut entries = fs::read_dir(folder)
        .and_then(|entries| {
            entries.map(|entry| entry.map(|entry| entry.path())).collect::<std::io::Result<Vec<_>>>()
        })
        .map_err(failed)?;
    // Parts of one table may be numbered without leading zeros: part-10 comes after part-2.
    entries.sort_by_cached_key(|path| {
        (path.file_stem().and_then(|stem| trailing_number(&stem.to_string_lossy())), path.clone())
    });
    // What macOS leaves beside a file on a disk that is not its own.
    entries.retain(|path| path.file_name().is_some_and(|name| !name.to_string_lossy().starts_with("._")));
    let mut files = Vec::new();
    for path in entries {
        // A link could lead in a circle.
        if path.is_dir() && !path.is_symlink() {
            files.extend(files_below(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "parquet") {
            files.push(path);
        }
    }
    Ok(files)
}

impl Table {
    /// Opens a file and reads what it says of itself.
    ///
    /// # Errors
    /// `is_bad_input` if this is no parquet file or it claims more than it can hold; `is_io` if it may not be read.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let failed = |source: std::io::Error| Error::io("cannot read the demonstrations", path, &source);
        pointer::refuse(path)?;
        let file = File::open(path).map_err(failed)?;
        let file_len = file.metadata().map_err(failed)?.len();
        let most_numbers = file_len.saturating_mul(MOST_NUMBERS_A_BYTE).max(FEW_NUMBERS);
        let same = file.try_clone().map_err(failed)?;
        let reader = SerializedFileReader::new(same).map_err(|source| damaged(source).at(path))?;
        for group in reader.metadata().row_groups() {
            for column in group.columns() {
                let (start, len) = (
                    column.dictionary_page_offset().unwrap_or(column.data_page_offset()),
                    column.compressed_size(),
                );
                let inside = start >= 4
                    && len >= 0
                    && start.checked_add(len).is_some_and(|end| end as u64 <= file_len);
                if !inside || u64::try_from(column.num_values()).is_ok_and(|values| values > most_numbers) {
                    return Err(Error::bad_input(format!(
                        "the parquet file is damaged: column '{}' claims {} numbers in {len} bytes at {start} of a file of {file_len}",
                        column.column_path().string(),
                        column.num_values()
                    ))
                    .with_hint("was it copied or downloaded completely?")
                    .at(path));
                }
            }
        }
        Ok(Self { file, reader, most_numbers })
    }

    /// Whether there is such a column.
    pub(super) fn has(&self, name: &str) -> bool {
        self.find(name).len() == 1
    }

    /// All columns; how many numbers a row has stands nowhere.
    pub(super) fn list(&self, read: &Columns) -> Vec<ColumnSeen> {
        let columns = self.reader.metadata().file_metadata().schema_descr().columns();
        let seen = columns.iter().map(|column| {
            let (kind, of_numbers) = match column.physical_type() {
                Physical::FLOAT => ("f32", true),
                Physical::DOUBLE => ("f64", true),
                Physical::INT32 => ("i32", true),
                Physical::INT64 => ("i64", true),
                Physical::BOOLEAN => ("bool", true),
                Physical::FIXED_LEN_BYTE_ARRAY
                    if column.logical_type_ref() == Some(&LogicalType::Float16) =>
                {
                    ("f16", true)
                }
                Physical::BYTE_ARRAY => ("text or image", false),
                _ => ("other", false),
            };
            let list = if column.max_rep_level() > 0 { "list of " } else { "" };
            ColumnSeen::new(shown(column), None, format!("{list}{kind}"), of_numbers, read)
        });
        seen.collect()
    }

    /// Each name with the columns below it, in alphabetical order where it is a dictionary, in place of itself.
    pub(super) fn leaves(&self, names: &[String]) -> Vec<String> {
        let mut all = Vec::new();
        for name in names {
            let mut below: Vec<String> = self.find(name).iter().map(|column| shown(column)).collect();
            below.sort_by_cached_key(|path| path.split('/').map(in_order).collect::<Vec<_>>());
            if below.is_empty() { all.push(name.clone()) } else { all.append(&mut below) }
        }
        all
    }

    /// Several columns of floating-point numbers as one table.
    ///
    /// # Errors
    /// `is_bad_input` if there is no such column, it holds something else, or the columns differ in length.
    pub(super) fn floats_side_by_side(&self, names: &[String]) -> Result<Rows> {
        let tables = names.iter().map(|name| {
            let named = if self.find(name).is_empty() { Named::new(name) } else { Named::new_whole(name) };
            Ok((name.as_str(), named.part_of(self.floats(named.column)?)?))
        });
        side_by_side(tables.collect::<Result<Vec<_>>>()?)
    }

    /// The same where some rows may lack numbers or have others than most.
    ///
    /// # Errors
    /// As [`floats_side_by_side`](Self::floats_side_by_side), and `is_bad_input` if that is so of more than half of the rows.
    pub(super) fn ragged_side_by_side(&self, names: &[String]) -> Result<Ragged> {
        let mut faults = BTreeMap::new();
        let tables = names.iter().map(|name| {
            let named = if self.find(name).is_empty() { Named::new(name) } else { Named::new_whole(name) };
            let mut held = Vec::new();
            let column = self.numbers(named.column, Some(&mut held))?;
            let Ragged { rows, faults: found } = parquet_ragged::evened(&column.values, &held, named.column)?;
            faults.extend(found);
            Ok((name.as_str(), named.part_of(rows)?))
        });
        let rows = side_by_side(tables.collect::<Result<Vec<_>>>()?)?;
        Ok(Ragged { rows, faults })
    }

    fn floats(&self, name: &str) -> Result<Rows> {
        let Column { values, width } = self.numbers(name, None)?;
        Rows::from_flat(values, width).map_err(|error| error.during(name))
    }

    fn numbers(&self, name: &str, held: Option<&mut Vec<Held>>) -> Result<Column<f32>> {
        match self.physical(name)? {
            Physical::FLOAT => self.column::<FloatType, f32>(name, held, |value| value),
            Physical::DOUBLE => self.column::<DoubleType, f32>(name, held, |value| value as f32),
            Physical::INT32 => self.column::<Int32Type, f32>(name, held, |value| value as f32),
            Physical::INT64 => self.column::<Int64Type, f32>(name, held, |value| value as f32),
            Physical::BOOLEAN => self.column::<BoolType, f32>(name, held, |value| f32::from(u8::from(value))),
            Physical::FIXED_LEN_BYTE_ARRAY if self.is_half(name)? => self
                .column::<FixedLenByteArrayType, f32>(name, held, |value| match *value.data() {
                    [low, high] => half(u16::from_le_bytes([low, high])),
                    _ => f32::NAN,
                }),
            Physical::BYTE_ARRAY => {
                Err(Error::bad_input(format!("'{name}' holds text or images; wanted numbers")))
            }
            other => Err(wrong_type(name, other, "numbers")),
        }
    }

    /// A column in full precision, with the numbers a row.
    ///
    /// # Errors
    /// As [`floats_side_by_side`](Self::floats_side_by_side).
    pub(super) fn doubles(&self, name: &str) -> Result<(Vec<f64>, usize)> {
        let Column { values, width } = match self.physical(name)? {
            Physical::FLOAT => self.column::<FloatType, f64>(name, None, f64::from)?,
            Physical::DOUBLE => self.column::<DoubleType, f64>(name, None, |value| value)?,
            other => return Err(wrong_type(name, other, "FLOAT or DOUBLE")),
        };
        Ok((values, width))
    }

    /// A column of one integer a row.
    ///
    /// # Errors
    /// As [`floats_side_by_side`](Self::floats_side_by_side).
    pub(super) fn integers(&self, name: &str) -> Result<Vec<i64>> {
        let Column { values, width } = match self.physical(name)? {
            Physical::INT32 => self.column::<Int32Type, i64>(name, None, i64::from)?,
            Physical::INT64 => self.column::<Int64Type, i64>(name, None, |value| value)?,
            Physical::BOOLEAN => self.column::<BoolType, i64>(name, None, i64::from)?,
            other => return Err(wrong_type(name, other, "INT32 or INT64")),
        };
        if width != 1 {
            return Err(Error::bad_input(format!("'{name}' holds {width} numbers a row; wanted 1")));
        }
        Ok(values)
    }

    /// The first word of each row of a column of text, or of lists of text; `None` of a row that holds none.
    ///
    /// # Errors
    /// `is_bad_input` if there is no such column, or it holds something else.
    pub(super) fn words(&self, name: &str) -> Result<Vec<Option<String>>> {
        let mut held = Vec::new();
        let column = match self.physical(name)? {
            Physical::BYTE_ARRAY => self.column::<ByteArrayType, String>(name, Some(&mut held), |value| {
                String::from_utf8_lossy(value.data()).into_owned()
            })?,
            other => return Err(wrong_type(name, other, "text")),
        };
        let mut words = column.values.into_iter();
        let first = |row: &Held| {
            let mut of_row = words.by_ref().take(row.numbers);
            let first = of_row.next();
            of_row.for_each(drop);
            first
        };
        Ok(held.iter().map(first).collect())
    }

    fn physical(&self, name: &str) -> Result<Physical> {
        Ok(self.reader.metadata().file_metadata().schema_descr().column(self.index(name)?).physical_type())
    }

    fn is_half(&self, name: &str) -> Result<bool> {
        let schema = self.reader.metadata().file_metadata().schema_descr();
        let column = schema.column(self.index(name)?);
        Ok(column.type_length() == 2 && column.logical_type_ref() == Some(&LogicalType::Float16))
    }

    /// Position of a column among those that hold numbers.
    fn index(&self, name: &str) -> Result<usize> {
        let columns = self.reader.metadata().file_metadata().schema_descr().columns();
        let found: Vec<usize> = (0..columns.len()).filter(|&index| is_below(&columns[index], name)).collect();
        match found[..] {
            [index] => Ok(index),
            [] => {
                let mut known: Vec<String> = columns.iter().map(|column| shown(column)).collect();
                known.dedup();
                let hint = option_for(known.iter().map(String::as_str));
                let message = format!("there is no column '{name}'; there are: {}", listed(&known));
                Err(Error::bad_input(message).with_hint(hint))
            }
            _ => Err(Error::bad_input(format!(
                "'{name}' has several parts ({}); name those that are wanted",
                self.leaves(&[name.to_owned()]).join(", ")
            ))),
        }
    }

    fn find(&self, name: &str) -> Vec<&ColumnDescriptor> {
        let columns = self.reader.metadata().file_metadata().schema_descr().columns();
        columns.iter().map(AsRef::as_ref).filter(|column| is_below(column, name)).collect()
    }

    /// The numbers of a column in all row groups; rows must be alike, or are told in `held`.
    fn column<T: DataType, N>(
        &self,
        name: &str,
        mut held: Option<&mut Vec<Held>>,
        number: impl Fn(T::T) -> N,
    ) -> Result<Column<N>> {
        let index = self.index(name)?;
        let mut column = Column { values: Vec::new(), width: 0 };
        for group in 0..self.reader.num_row_groups() {
            let group = self.reader.get_row_group(group).map_err(damaged)?;
            self.check_pages(group.metadata().column(index), name)?;
            let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            let descriptor = group.metadata().column(index).column_descr_ptr();
            let column_chunk = group.metadata().column(index);
            let reader = if matches!(column_chunk.compression(), Compression::ZSTD(_)) {
                let pages = Pages::new(self.chunk(column_chunk)?.to_vec());
                ColumnReaderImpl::<T>::new(descriptor.clone(), Box::new(pages))
            } else {
                get_typed_column_reader::<T>(group.get_column_reader(index).map_err(damaged)?)
            };
            let mut found = Found { name, width: &mut column.width, held: held.as_deref_mut() };
            read_rows(reader, &descriptor, rows, &mut found, |value| column.values.push(number(value)))?;
        }
        Ok(column)
    }

    fn chunk(&self, column: &ColumnChunkMetaData) -> Result<impl std::ops::Deref<Target = [u8]> + use<>> {
        let (start, len) = column.byte_range();
        self.file.get_bytes(start, usize::try_from(len).unwrap_or(0)).map_err(damaged)
    }

    /// Refuses pages that claim more than they can hold, before the decoder believes them.
    fn check_pages(&self, column: &ColumnChunkMetaData, name: &str) -> Result<()> {
        let compression = column.compression();
        if matches!(compression, Compression::BROTLI(_) | Compression::LZO) {
            return Err(Error::bad_input(format!(
                "column '{name}' is compressed by {compression}; wanted SNAPPY, GZIP, LZ4, ZSTD or no compression"
            ))
            .with_hint("pyarrow.parquet.write_table(..., compression=\"snappy\") writes the table again"));
        }
        let free = if matches!(compression, Compression::ZSTD(_)) { MOST_BYTES_OF_A_FEW } else { 0 };
        let chunk = self.chunk(column)?;
        let claimed = u64::try_from(column.num_values()).unwrap_or(0);
        match parquet_pages::claims(&chunk, free) {
            Some(claims) if claims.values <= claimed && claims.most_values <= self.most_numbers => Ok(()),
            _ => Err(Error::bad_input(format!(
                "the parquet file is damaged: the pages of column '{name}' claim more than they can hold"
            ))
            .with_hint("was it copied or downloaded completely?")),
        }
    }
}

/// What is known of the rows of a column.
struct Found<'a> {
    name: &'a str,
    /// Numbers a row, 0 before the first.
    width: &'a mut usize,
    /// How many each row holds, where they need not be alike.
    held: Option<&'a mut Vec<Held>>,
}

/// Hands on the numbers of `rows` rows, and checks that each row has as many as the others.
fn read_rows<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    column: &ColumnDescriptor,
    rows: usize,
    found: &mut Found<'_>,
    mut push: impl FnMut(T::T),
) -> Result<()> {
    let name = found.name;
    let (full, nested) = (column.max_def_level(), column.max_rep_level() > 0);
    if column.max_rep_level() > 1 {
        return Err(Error::bad_input(format!(
            "'{name}' holds lists of lists; wanted one list of numbers a row"
        )));
    }
    let mut read = 0;
    let (mut values, mut definitions, mut repetitions) = (Vec::new(), Vec::new(), Vec::new());
    while read < rows {
        values.clear();
        definitions.clear();
        repetitions.clear();
        let (records, _, levels) = reader
            .read_records(BATCH.min(rows - read), Some(&mut definitions), Some(&mut repetitions), &mut values)
            .map_err(damaged)?;
        if records == 0 {
            return Err(Error::bad_input(format!("'{name}' ends after {read} rows; its file claims {rows}"))
                .with_hint("the file is damaged or was not copied completely"));
        }
        read += records;
        if let Some(held) = found.held.as_deref_mut() {
            let before = held.len();
            parquet_ragged::hold(held, &definitions, &repetitions, Levels { full, records });
            if held.len() - before != records {
                return Err(differing(name));
            }
            values.drain(..).for_each(&mut push);
            continue;
        }
        if full > 0 && definitions.iter().any(|&level| level != full) || full == 0 && values.len() != levels {
            return Err(Error::bad_input(format!(
                "'{name}' holds nothing in a row; wanted numbers in every row"
            )));
        }
        let starts = repetitions.iter().filter(|&&level| level == 0).count();
        if nested && starts != records || !values.len().is_multiple_of(records) {
            return Err(differing(name));
        }
        let each = values.len() / records;
        if *found.width == 0 {
            *found.width = each;
        }
        let even = !nested
            || repetitions.iter().enumerate().all(|(at, &level)| (level == 0) == at.is_multiple_of(each));
        if each != *found.width || !even {
            return Err(differing(name));
        }
        values.drain(..).for_each(&mut push);
    }
    Ok(())
}

/// Parts of a tuple go by their numbers, and those of a dictionary by their names.
fn in_order(part: &str) -> (Option<u64>, String) {
    (part.strip_prefix("_index_").and_then(trailing_number), part.to_owned())
}

/// The column's path without what parquet puts between a list and its elements.
fn shown(column: &ColumnDescriptor) -> String {
    let parts = column.path().parts();
    let nested = usize::from(column.max_rep_level() > 0) * 2;
    parts[..parts.len().saturating_sub(nested).max(1)].join("/")
}

/// Whether the column is the named one, or a part of it.
fn is_below(column: &ColumnDescriptor, name: &str) -> bool {
    let shown = shown(column);
    shown.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

fn wrong_type(name: &str, found: Physical, wanted: &str) -> Error {
    Error::bad_input(format!("'{name}' holds elements of type {found}; wanted {wanted}"))
}

fn damaged(source: ParquetError) -> Error {
    Error::bad_input(format!("the parquet file is damaged or truncated: {source}"))
        .with_hint("was it copied or downloaded completely?")
}
