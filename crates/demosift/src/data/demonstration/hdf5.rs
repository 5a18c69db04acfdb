//! Reading tables of numbers from HDF5 files that may be damaged, or made to harm.

mod unpacked;

use std::path::Path;

use hdf5_pure::{DType, Dataset, Datatype, DatatypeByteOrder, File, FormatError, Group, Layout};

use crate::basics::error::{Error, Result};
use crate::data::demonstration::episode::{Columns, side_by_side, trailing_number};
use crate::data::demonstration::listing::{ColumnSeen, Used};
use crate::data::demonstration::named::{Named, half, listed, option_for};
use crate::data::demonstration::pointer;
use crate::math::rows::Rows;

/// Deflate cannot shrink bytes further than this (its longest match costs at least two bits).
pub(super) const MOST_COMPRESSION: u64 = 1032;

/// What recordings shrink by at most; only constants and what is made to harm shrink further.
const USUAL_COMPRESSION: u64 = 100;
/// Up to so many bytes the memory does not matter, however small the file.
const FREE_BYTES: u64 = 1 << 28;

/// Bytes that a file of this length may unpack to.
pub(super) fn most_unpacked(file_len: u64) -> u64 {
    let usual = file_len.saturating_mul(USUAL_COMPRESSION).max(FREE_BYTES);
    file_len.saturating_mul(MOST_COMPRESSION).min(usual)
}

/// Larger files, such as those with pictures in them, are read piece by piece.
const MOST_IN_MEMORY: u64 = 1 << 28;

/// An open file, and how many bytes it has.
pub(super) struct Opened {
    pub(super) file: File,
    pub(super) file_len: u64,
}

/// Opens a file after the checks that need no parsing.
///
/// # Errors
/// `is_bad_input` if this is no HDF5 file; `is_io` if it may not be read.
pub(super) fn open(path: &Path) -> Result<Opened> {
    let file_len = length_of(path)?;
    // A streamed file is asked for as many bytes as a damaged header claims before its end is seen; a file in memory is not.
    let file = if file_len <= MOST_IN_MEMORY { File::open(path) } else { File::open_streaming(path) };
    let file = file.map_err(damaged)?;
    let unpacked = unpacked::unpacked(&file, path, file_len)?;
    Ok(Opened { file: unpacked.unwrap_or(file), file_len })
}

/// The file's length in bytes.
fn length_of(path: &Path) -> Result<u64> {
    let metadata = std::fs::metadata(path).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => {
            Error::bad_input("the demonstration file does not exist").with_hint("check the path")
        }
        _ => Error::io("cannot read the demonstrations", path, &source),
    })?;
    if !metadata.is_file() {
        return Err(Error::bad_input("not a file; wanted an HDF5 file"));
    }
    if metadata.len() == 0 {
        return Err(Error::bad_input("the file is empty; wanted an HDF5 file")
            .with_hint("was it copied or downloaded completely?"));
    }
    pointer::refuse(path)?;
    match hdf5_pure::is_hdf5(path) {
        Ok(true) => Ok(metadata.len()),
        Ok(false) => Err(Error::bad_input("not an HDF5 file: its signature is missing")
            .with_hint("was it copied or downloaded completely?")),
        Err(source) => Err(Error::io("cannot read the demonstrations", path, &source)),
    }
}

/// Writes a file again (h5py stops visiting where a visit returns something, hence the print) without filters and in the layout that every version reads.
const WRITE_ANEW: &str = r#"write it again: h5repack -f GZIP=4 OLD NEW; or in Python: import h5py, hdf5plugin; old, new = h5py.File("OLD"), h5py.File("NEW", "w", libver=("earliest", "v114")); old.visititems(lambda name, item: print((new.create_dataset(name, data=item[()]) if hasattr(item, "dtype") else new.require_group(name)).attrs.update(item.attrs))); new.close()"#;

/// Copies a file with what its links lead to in place of them.
const COPY_WITHOUT_LINKS: &str = r#"copy it, in Python: import h5py; old, new = h5py.File("OLD"), h5py.File("NEW", "w"); [old.copy(name, new, expand_soft=True, expand_external=True) for name in old]; new.attrs.update(old.attrs); new.close()"#;

/// Names the groups of a file as its format has them.
fn rename(prefix: &str) -> String {
    format!(
        "name them so, in Python for those in the group DATA: import h5py; g = h5py.File(\"FILE\", \"r+\")[\"DATA\"]; \
         [g.move(name, f\"{prefix}{{i}}\") for i, name in enumerate(list(g))]"
    )
}

/// The names of registered filters, which files store as numbers.
fn filter_name(id: u16) -> String {
    let name = match id {
        2 => "shuffle",
        4 => "szip",
        305 => "lzo",
        307 => "bzip2",
        32000 => "lzf",
        32001 => "blosc",
        32004 => "lz4",
        32008 => "bitshuffle",
        32013 => "zfp",
        32015 => "zstd",
        32026 => "blosc2",
        32017 | 32024 => "sz",
        32019 => "jpeg",
        other => return format!("the filter of number {other}"),
    };
    name.to_owned()
}

/// What the HDF5 reader found wrong, or cannot read.
pub(super) fn damaged(source: hdf5_pure::Error) -> Error {
    if is_link(&source) {
        return Error::bad_input(
            "the HDF5 file holds a soft link, which is not followed; wanted everything in its own place",
        )
        .with_hint(COPY_WITHOUT_LINKS);
    }
    let unread = match &source {
        hdf5_pure::Error::Format(FormatError::UnsupportedFilter(id)) => {
            Some(format!("compressed by {}, which is not read; wanted gzip, lzf, szip, zstd, lz4 or none", filter_name(*id)))
        }
        hdf5_pure::Error::Format(FormatError::UnsupportedZfp(_)) => {
            Some("compressed by zfp in a form that is not read; wanted gzip, lzf, szip or none".to_owned())
        }
        // Version 5 came with HDF5 2.0; more is what damage looks like.
        hdf5_pure::Error::Format(FormatError::InvalidLayoutVersion(5)) => Some(
            "written in the newest layout of HDF5 2.0, which is not read; wanted that of 1.14 or before (libver=\"v114\")"
                .to_owned(),
        ),
        hdf5_pure::Error::Format(FormatError::UnsupportedVirtualLayout) => {
            Some("a virtual dataset, whose numbers lie in other files; wanted them in one".to_owned())
        }
        hdf5_pure::Error::Format(FormatError::UnsupportedExternalStorage) => {
            Some("a dataset whose numbers lie outside the file; wanted them inside".to_owned())
        }
        _ => None,
    };
    if let Some(unread) = unread {
        return Error::bad_input(format!("the HDF5 file is {unread}")).with_hint(WRITE_ANEW);
    }
    Error::bad_input(format!("the HDF5 file is damaged or truncated: {source}"))
        .with_hint("was it copied or downloaded completely?")
}

/// Groups in the old layout list a soft link without an address, all bits of which are set, and the reader looks there.
fn is_link(source: &hdf5_pure::Error) -> bool {
    matches!(source, hdf5_pure::Error::Format(FormatError::UnexpectedEof { expected: usize::MAX, .. }))
}

/// A dataset of numbers, `[steps]` or `[steps, numbers a step]`, called `shown` in errors.
pub(super) fn read_table(dataset: &Dataset, shown: &str, file_len: u64) -> Result<Rows> {
    let (_, width) = check_table(dataset, shown, file_len)?;
    let values = numbers(dataset, shown)?;
    Rows::from_flat(values, width).map_err(|error| error.during(shown))
}

/// All elements as numbers: truth is 1.
fn numbers(dataset: &Dataset, shown: &str) -> Result<Vec<f32>> {
    match dataset.dtype().map_err(damaged)? {
        DType::Enum(_) => {
            Ok(flags(dataset, shown)?.into_iter().map(|flag| f32::from(u8::from(flag))).collect())
        }
        DType::Other(other) => {
            let Datatype::FloatingPoint { byte_order, .. } = *other else {
                return Err(no_numbers(shown, &DType::Other(other)));
            };
            let number = |raw: &[u8; 2]| match byte_order {
                DatatypeByteOrder::BigEndian => half(u16::from_be_bytes(*raw)),
                _ => half(u16::from_le_bytes(*raw)),
            };
            let bytes = dataset.read_raw().map_err(damaged)?;
            Ok(bytes.as_chunks::<2>().0.iter().map(number).collect())
        }
        _ => dataset.read_f32().map_err(damaged),
    }
}

/// Whether elements of this type are numbers; those of h5py's bool are, as 0 and 1.
pub(super) fn is_number(element: &DType) -> bool {
    match element {
        DType::F32 | DType::F64 | DType::I8 | DType::I16 | DType::I32 | DType::I64 => true,
        DType::U8 | DType::U16 | DType::U32 | DType::U64 => true,
        DType::Enum(names) => names.len() == 2 && names.iter().any(|name| name.eq_ignore_ascii_case("true")),
        DType::Other(other) => matches!(**other, Datatype::FloatingPoint { size: 2, .. }),
        _ => false,
    }
}

fn no_numbers(name: &str, element: &DType) -> Error {
    let what = match element {
        DType::String | DType::VariableLengthString => "text".to_owned(),
        other => format!("elements of type {other}"),
    };
    Error::bad_input(format!("'{name}' holds {what}; wanted numbers: floats, integers or bool"))
}

/// The datasets at these paths below the group as one table, side by side.
///
/// # Errors
/// `is_bad_input` if one is not there or no two-dimensional table of floats, or they differ in length.
pub(super) fn read_columns(group: &Group, names: &[String], file_len: u64) -> Result<Rows> {
    let parts = names.iter().map(|name| {
        let named = Named::new(name);
        let column = named.column;
        let dataset = find_below(group, column)?.map_or_else(|| Err(missing_below(group, column)?), Ok)?;
        Ok((name.as_str(), named.part_of(read_table(&dataset, column, file_len)?)?))
    });
    side_by_side(parts.collect::<Result<Vec<_>>>()?)
}

/// The same with all the bits that are stored, `[steps][numbers a step]`.
///
/// # Errors
/// As [`read_columns`].
pub(super) fn read_columns_in_full(group: &Group, names: &[String], file_len: u64) -> Result<Vec<Vec<f64>>> {
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for name in names {
        let named = Named::new(name);
        let column = named.column;
        let dataset = find_below(group, column)?.map_or_else(|| Err(missing_below(group, column)?), Ok)?;
        let table = rows_in_full(&dataset, column, file_len)?;
        let (first, end) = named.part().unwrap_or((0, None));
        rows.resize(table.len(), Vec::new());
        for (row, whole) in rows.iter_mut().zip(&table) {
            let part = whole.get(first..end.unwrap_or(whole.len()));
            row.extend(part.ok_or_else(|| Error::bad_input(format!("'{name}' is no part of '{column}'")))?);
        }
    }
    Ok(rows)
}

/// The rows of a dataset of numbers, with all the bits that are stored.
pub(super) fn rows_in_full(dataset: &Dataset, name: &str, file_len: u64) -> Result<Vec<Vec<f64>>> {
    let (_, width) = check_table(dataset, name, file_len)?;
    let numbers = match dataset.dtype().map_err(damaged)? {
        DType::Enum(_) | DType::Other(_) => numbers(dataset, name)?.into_iter().map(f64::from).collect(),
        _ => dataset.read_f64().map_err(damaged)?,
    };
    Ok(numbers.chunks_exact(width).map(<[f64]>::to_vec).collect())
}

/// Steps and numbers a step of a dataset of numbers that the file can hold.
pub(super) fn check_table(dataset: &Dataset, name: &str, file_len: u64) -> Result<(usize, usize)> {
    let shape = dataset.shape().map_err(damaged)?;
    let (steps, width) = match *shape.as_slice() {
        [steps] => (steps, 1),
        [steps, width @ 1..=u64::MAX] => (steps, width),
        _ => {
            return Err(Error::bad_input(format!(
                "'{name}' has shape {shape:?}; wanted two dimensions, [steps, numbers a step], of at least one number, or \
                 [steps]; images and tables in more dimensions are not read"
            )));
        }
    };
    let element = dataset.dtype().map_err(damaged)?;
    if !is_number(&element) {
        return Err(no_numbers(name, &element));
    }
    check_size(dataset, name, &shape, file_len)?;
    // A table without rows stores nothing, so its width is a claim that nothing else bounds.
    if steps == 0 && width > file_len {
        return Err(claims_too_much(name, &shape, file_len));
    }
    match (usize::try_from(steps), usize::try_from(width)) {
        (Ok(steps), Ok(width)) => Ok((steps, width)),
        _ => Err(Error::bad_input(format!("'{name}' of shape {shape:?} is too large for this machine"))),
    }
}

/// The elements as flags: everything but zero is true.
pub(super) fn flags(dataset: &Dataset, name: &str) -> Result<Vec<bool>> {
    match dataset.dtype().map_err(damaged)? {
        DType::F32 | DType::F64 => {
            Ok(dataset.read_f64().map_err(damaged)?.iter().map(|&value| value != 0.0).collect())
        }
        DType::Enum(_)
        | DType::I8
        | DType::I16
        | DType::I32
        | DType::I64
        | DType::U8
        | DType::U16
        | DType::U32
        | DType::U64 => {
            let size = usize::try_from(dataset.element_size().map_err(damaged)?.max(1))
                .map_err(|_| Error::bad_input(format!("'{name}' has elements that are too large")))?;
            let bytes = dataset.read_raw().map_err(damaged)?;
            Ok(bytes.chunks_exact(size).map(|element| element.iter().any(|&byte| byte != 0)).collect())
        }
        other => {
            Err(Error::bad_input(format!("'{name}' holds elements of type {other}; wanted bool or a number")))
        }
    }
}

/// Refuses a dataset that claims more bytes than the file can hold, before memory is asked for.
pub(super) fn check_size(dataset: &Dataset, name: &str, shape: &[u64], file_len: u64) -> Result<()> {
    let element = dataset.element_size().map_err(damaged)?;
    let bytes_of = |extents: &[u64]| extents.iter().try_fold(element, |bytes, &len| bytes.checked_mul(len));
    let filtered = !dataset.filters().is_empty();
    let most = if filtered { most_unpacked(file_len) } else { file_len };
    let chunk = match dataset.layout().map_err(damaged)? {
        Layout::Chunked { chunk_shape, .. } => bytes_of(&chunk_shape),
        _ => Some(0),
    };
    // A chunk may hang over the edge of its dataset, but not by more than the file could hold either.
    match (bytes_of(shape), chunk) {
        (Some(bytes), Some(chunk)) if bytes <= most && (chunk <= most || filtered && chunk <= 1 << 26) => {
            Ok(())
        }
        _ => Err(claims_too_much(name, shape, file_len)),
    }
}

fn claims_too_much(name: &str, shape: &[u64], file_len: u64) -> Error {
    Error::bad_input(format!(
        "'{name}' claims shape {shape:?}, more than a recording in a file of {file_len} bytes holds"
    ))
    .with_hint(
        "the file is damaged or was not copied completely; if it is right, store it without compression",
    )
}

/// Groups in groups that are followed; nobody nests deeper.
const DEEPEST: usize = 8;
/// More columns are a flood that nobody reads.
const MOST_COLUMNS: usize = 1000;

/// All datasets below a group, in alphabetical order.
///
/// # Errors
/// `is_bad_input` if the file is damaged.
pub(super) fn list(group: &Group, read: &Columns) -> Result<Vec<ColumnSeen>> {
    let mut seen = Vec::new();
    list_below(group, "", DEEPEST, read, &mut seen)?;
    Ok(seen)
}

fn list_below(
    group: &Group,
    path: &str,
    deepest: usize,
    read: &Columns,
    seen: &mut Vec<ColumnSeen>,
) -> Result<()> {
    let mut names = group.datasets().map_err(damaged)?;
    names.sort();
    for name in names {
        if seen.len() >= MOST_COLUMNS {
            return Ok(());
        }
        let dataset = group.dataset(&name).map_err(damaged)?;
        let (shape, element) = (dataset.shape().map_err(damaged)?, dataset.dtype().map_err(damaged)?);
        let kind = match &element {
            DType::Enum(_) if is_number(&element) => "bool".to_owned(),
            DType::Other(_) if is_number(&element) => "f16".to_owned(),
            DType::String | DType::VariableLengthString => "text".to_owned(),
            other => other.to_string(),
        };
        seen.push(ColumnSeen::new(format!("{path}{name}"), Some(shape), kind, is_number(&element), read));
    }
    let mut groups = group.groups().map_err(damaged)?;
    groups.sort();
    for name in groups {
        if deepest > 0 && seen.len() < MOST_COLUMNS {
            let inner = group.group(&name).map_err(damaged)?;
            list_below(&inner, &format!("{path}{name}/"), deepest - 1, read, seen)?;
        }
    }
    Ok(())
}

/// The dataset of this name, directly in the group, if it is there.
pub(super) fn find(root: &Group, name: &str) -> Result<Option<Dataset>> {
    if !root.datasets().map_err(damaged)?.iter().any(|known| known == name) {
        return Ok(None);
    }
    root.dataset(name).map(Some).map_err(damaged)
}

/// The group of this name, directly in the group, if it is there.
pub(super) fn find_group(root: &Group, name: &str) -> Result<Option<Group>> {
    if !root.groups().map_err(damaged)?.iter().any(|known| known == name) {
        return Ok(None);
    }
    root.group(name).map(Some).map_err(damaged)
}

/// The dataset at a path such as `obs/gripper` below the group, if it is there.
pub(super) fn find_below(root: &Group, path: &str) -> Result<Option<Dataset>> {
    match path.split_once('/') {
        Some((group, rest)) => match find_group(root, group)? {
            Some(group) => find_below(&group, rest),
            None => Ok(None),
        },
        None => find(root, path),
    }
}

/// The groups of a file that hold an episode each.
pub(super) struct NumberedGroups {
    /// By their numbers, at least one.
    pub(super) names: Vec<String>,
    /// What is said of the other groups, if there are any.
    pub(super) not_read: Vec<String>,
}

/// The groups below `holder` that are called `prefix` and a number.
///
/// # Errors
/// If there are none; says which groups there are.
pub(super) fn numbered_groups(root: &Group, holder: &str, prefix: &str) -> Result<NumberedGroups> {
    let number = |name: &String| name.strip_prefix(prefix).and_then(trailing_number);
    let (mut names, mut others): (Vec<String>, Vec<String>) =
        root.groups().map_err(damaged)?.into_iter().partition(|name| number(name).is_some());
    names.sort_by_key(number);
    others.sort();
    if names.is_empty() && others.is_empty() && root.datasets().map_err(damaged)?.is_empty() {
        // Groups in the new layout seem to hold none of their links.
        return Err(Error::bad_input(format!(
            "{holder} holds no episode; wanted groups {prefix}0, {prefix}1, …, and links are not followed"
        ))
        .with_hint(format!("if h5py shows the episodes there, they are links: {COPY_WITHOUT_LINKS}")));
    }
    if names.is_empty() {
        return Err(Error::bad_input(format!(
            "{holder} holds no episode; wanted groups {prefix}0, {prefix}1, …, and there are: {}",
            listed(others)
        ))
        .with_hint(rename(prefix)));
    }
    let said = format!(
        "{} that {} not called {prefix}<number>, so not read: {}",
        if others.len() == 1 { "1 group".to_owned() } else { format!("{} groups", others.len()) },
        if others.len() == 1 { "is" } else { "are" },
        listed(&others)
    );
    let not_read = if others.is_empty() { Vec::new() } else { vec![said] };
    Ok(NumberedGroups { names, not_read })
}

/// There is no such dataset; says what there is.
pub(super) fn missing(root: &Group, name: &str) -> Result<Error> {
    let mut known = root.datasets().map_err(damaged)?;
    known.extend(root.groups().map_err(damaged)?.into_iter().map(|group| group + "/"));
    known.sort();
    Ok(Error::bad_input(format!("there is no dataset '{name}'; there is: {}", listed(&known))))
}

/// The option that names columns of the group.
pub(super) fn option_below(root: &Group) -> String {
    let seen = list(root, &Columns::default()).unwrap_or_default();
    let could_be = seen.iter().filter(|column| column.used == Used::Not);
    option_for(could_be.map(|column| column.name.as_str()))
}

/// As [`missing`], for a path of groups: says what there is where the path ends.
pub(super) fn missing_below(root: &Group, path: &str) -> Result<Error> {
    if let Some((group, rest)) = path.split_once('/')
        && let Some(inner) = find_group(root, group)?
    {
        return missing_below(&inner, rest).map(|error| error.during(group));
    }
    missing(root, path)
}
