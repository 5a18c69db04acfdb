//! Columns of numbers and words as the bytes of a parquet file, in the schema in which Arrow's users write theirs.

use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};

use crate::basics::error::{Error, Result};

/// What a column holds, row after row.
#[derive(Clone)]
pub(super) enum Values {
    /// A number a row.
    Integers(Vec<i64>),
    /// A number a row.
    Floats(Vec<f32>),
    /// A number a row.
    Doubles(Vec<f64>),
    /// A list of this many numbers a row.
    FloatLists(Vec<f32>, usize),
    /// A list of this many numbers a row.
    DoubleLists(Vec<f64>, usize),
    /// A word a row.
    Words(Vec<String>),
    /// A list of one word a row.
    WordLists(Vec<String>),
}

/// A named column.
pub(super) type Column<'a> = (&'a str, Values);

/// Encodes columns of one length; `notes` are key and value of what the file says of itself.
pub(super) fn encode(columns: &[Column<'_>], notes: Vec<(&str, String)>) -> Result<Vec<u8>> {
    write(columns, notes)
        .map_err(|source| Error::bad_input(format!("the tables cannot be stored as parquet: {source}")))
}

fn write(columns: &[Column<'_>], notes: Vec<(&str, String)>) -> std::result::Result<Vec<u8>, ParquetError> {
    let fields = columns.iter().map(field).collect::<std::result::Result<_, _>>()?;
    let schema = Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?);
    let notes = notes.into_iter().map(|(key, value)| KeyValue::new(key.to_owned(), value)).collect();
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_key_value_metadata(Some(notes))
        .build();
    let mut file = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties))?;
    let mut group = file.next_row_group()?;
    for (_, values) in columns {
        write_column(&mut group, values)?;
    }
    group.close()?;
    file.into_inner()
}

fn field((name, values): &Column<'_>) -> std::result::Result<TypePtr, ParquetError> {
    let (physical, is_list) = match values {
        Values::Integers(_) => (Physical::INT64, false),
        Values::Floats(_) => (Physical::FLOAT, false),
        Values::Doubles(_) => (Physical::DOUBLE, false),
        Values::FloatLists(..) => (Physical::FLOAT, true),
        Values::DoubleLists(..) => (Physical::DOUBLE, true),
        Values::Words(_) => (Physical::BYTE_ARRAY, false),
        Values::WordLists(_) => (Physical::BYTE_ARRAY, true),
    };
    let leaf = |name: &str| {
        let mut leaf = Type::primitive_type_builder(name, physical).with_repetition(Repetition::OPTIONAL);
        if physical == Physical::BYTE_ARRAY {
            leaf = leaf.with_logical_type(Some(LogicalType::String)).with_converted_type(ConvertedType::UTF8);
        }
        leaf.build().map(Arc::new)
    };
    if !is_list {
        return leaf(name);
    }
    let repeated = Type::group_type_builder("list")
        .with_repetition(Repetition::REPEATED)
        .with_fields(vec![leaf("element")?])
        .build()?;
    Type::group_type_builder(name)
        .with_repetition(Repetition::OPTIONAL)
        .with_logical_type(Some(LogicalType::List))
        .with_converted_type(ConvertedType::LIST)
        .with_fields(vec![Arc::new(repeated)])
        .build()
        .map(Arc::new)
}

fn write_column(
    group: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    values: &Values,
) -> std::result::Result<(), ParquetError> {
    let words =
        |words: &[String]| words.iter().map(|word| ByteArray::from(word.as_str())).collect::<Vec<_>>();
    match values {
        Values::Integers(values) => write_values::<Int64Type>(group, values, None),
        Values::Floats(values) => write_values::<FloatType>(group, values, None),
        Values::Doubles(values) => write_values::<DoubleType>(group, values, None),
        Values::FloatLists(values, width) => write_values::<FloatType>(group, values, Some(*width)),
        Values::DoubleLists(values, width) => write_values::<DoubleType>(group, values, Some(*width)),
        Values::Words(values) => write_values::<ByteArrayType>(group, &words(values), None),
        Values::WordLists(values) => write_values::<ByteArrayType>(group, &words(values), Some(1)),
    }
}

/// Writes a column in which nothing is missing: a value a row, or `width` values a row.
fn write_values<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, Vec<u8>>,
    values: &[T::T],
    width: Option<usize>,
) -> std::result::Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("the schema has fewer columns".to_owned()));
    };
    // Present, as a value; or as a list, its repetition and its element.
    let full = if width.is_some() { 3 } else { 1 };
    let definitions = vec![full; values.len()];
    let repetitions = width
        .map(|width| (0..values.len()).map(|at| i16::from(!at.is_multiple_of(width))).collect::<Vec<_>>());
    column.typed::<T>().write_batch(values, Some(&definitions), repetitions.as_deref())?;
    column.close()
}
