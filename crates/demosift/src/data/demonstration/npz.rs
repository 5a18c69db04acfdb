//! Arrays of numbers in npz files: a zip archive of npy files.
//!
//! An array of Python objects is a pickle, which could run anything, so it is never read.

use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::Path;

use zip::ZipArchive;
use zip::result::ZipError;

use crate::basics::error::{Error, Result};
use crate::data::demonstration::episode::Columns;
use crate::data::demonstration::hdf5::most_unpacked;
use crate::data::demonstration::listing::ColumnSeen;
use crate::data::demonstration::named::{Named, half, listed, option_for};
use crate::data::demonstration::pointer;
use crate::math::rows::Rows;

/// A header of numpy holds three entries; nothing reasonable is longer.
const LONGEST_HEADER: usize = 1 << 16;

/// Episodes of several lengths as D4RL stores them.
const OBJECTS: &str = "in Python, for obs and acs of such a file: import h5py, numpy as np; f = h5py.File(\"set.hdf5\", \"w\"); \
                       f[\"observations\"], f[\"actions\"] = np.concatenate(list(obs)), np.concatenate(list(acs)); \
                       f[\"timeouts\"] = np.concatenate([np.arange(len(a)) == len(a) - 1 for a in acs])";

/// Steps that begin an episode, as stable-baselines stores them of environments that play side by side.
const STARTS: &str = "in Python: import numpy as np; d = dict(np.load(\"IN.npz\", allow_pickle=True)); \
                      d[\"episode_starts\"] = np.array([bool(np.ravel(x)[0]) for x in d[\"episode_starts\"]]); \
                      np.savez(\"OUT.npz\", **d)";

/// An array with its shape, row-major.
pub(super) struct Array<T> {
    pub(super) values: Vec<T>,
    pub(super) shape: Vec<usize>,
}

/// An open file.
pub(super) struct Npz {
    archive: ZipArchive<BufReader<File>>,
    file_len: u64,
}

/// Names of the arrays, in file order.
pub(super) fn names(path: &Path) -> Result<Vec<String>> {
    Ok(open(path)?.names())
}

/// Opens the archive.
///
/// # Errors
/// `is_bad_input` if it is none; `is_io` if it may not be read.
pub(super) fn open(path: &Path) -> Result<Npz> {
    let failed = |source: std::io::Error| Error::io("cannot read the demonstrations", path, &source);
    pointer::refuse(path)?;
    let file = File::open(path).map_err(failed)?;
    let file_len = file.metadata().map_err(failed)?.len();
    let archive = ZipArchive::new(BufReader::new(file)).map_err(damaged)?;
    Ok(Npz { archive, file_len })
}

impl Npz {
    /// Names of the arrays, in file order.
    pub(super) fn names(&self) -> Vec<String> {
        let entries = self.archive.file_names().filter_map(std::result::Result::ok);
        entries.map(|name| name.strip_suffix(".npy").unwrap_or(&name).to_owned()).collect()
    }

    /// An array of numbers.
    pub(super) fn floats(&mut self, name: &str) -> Result<Array<f32>> {
        let (header, bytes) = self.read(name)?;
        let values = match header.element.as_str() {
            "<f4" => each(&bytes, f32::from_le_bytes),
            "<f8" => each(&bytes, |raw| f64::from_le_bytes(raw) as f32),
            "<f2" => each(&bytes, |raw| half(u16::from_le_bytes(raw))),
            "|b1" => each(&bytes, |[raw]: [u8; 1]| f32::from(u8::from(raw != 0))),
            "|u1" => each(&bytes, |[raw]: [u8; 1]| f32::from(raw)),
            "|i1" => each(&bytes, |raw| f32::from(i8::from_le_bytes(raw))),
            "<u2" => each(&bytes, |raw| f32::from(u16::from_le_bytes(raw))),
            "<i2" => each(&bytes, |raw| f32::from(i16::from_le_bytes(raw))),
            "<u4" => each(&bytes, |raw| u32::from_le_bytes(raw) as f32),
            "<i4" => each(&bytes, |raw| i32::from_le_bytes(raw) as f32),
            "<u8" => each(&bytes, |raw| u64::from_le_bytes(raw) as f32),
            "<i8" => each(&bytes, |raw| i64::from_le_bytes(raw) as f32),
            other => {
                return Err(Error::bad_input(format!(
                    "'{name}' holds elements that numpy calls {other}; wanted numbers: floats, integers or bool"
                ))
                .with_hint(format!("in Python: {name} = {name}.astype(\"float32\")")));
            }
        };
        Ok(Array { values, shape: header.shape })
    }

    /// An array of integers.
    pub(super) fn integers(&mut self, name: &str) -> Result<Array<i64>> {
        let (header, bytes) = self.read(name)?;
        let values = match header.element.as_str() {
            "<i8" => each(&bytes, i64::from_le_bytes),
            "<i4" => each(&bytes, |raw| i64::from(i32::from_le_bytes(raw))),
            // What numpy makes of an empty list.
            "<f8" if bytes.is_empty() => Vec::new(),
            other => {
                return Err(Error::bad_input(format!(
                    "'{name}' holds elements of type {other}; wanted <i4 or <i8"
                )));
            }
        };
        Ok(Array { values, shape: header.shape })
    }

    /// All arrays with what their headers say; one without a header that can be read is left out.
    pub(super) fn list(&mut self, read: &Columns) -> Vec<ColumnSeen> {
        let mut seen = Vec::new();
        for name in self.names() {
            let mut start = Vec::new();
            let Ok(entry) = self.archive.by_name(&format!("{name}.npy")) else { continue };
            if entry.take(LONGEST_HEADER as u64 + 12).read_to_end(&mut start).is_err() {
                continue;
            }
            let (shape, kind) = match Header::parse(&name, &start) {
                Ok(header) => (Some(header.shape.iter().map(|&len| len as u64).collect()), header.element),
                Err(_) => (None, "Python objects".to_owned()),
            };
            let of_numbers =
                matches!(kind.get(1..2), Some("f" | "i" | "u" | "b")) && kind != "Python objects";
            seen.push(ColumnSeen::new(name, shape, kind, of_numbers, read));
        }
        seen
    }

    /// Header and elements of an array, after checking that both fit each other and the file.
    fn read(&mut self, name: &str) -> Result<(Header, Vec<u8>)> {
        let known = self.names();
        if !known.iter().any(|known| known == name) {
            return Err(Error::bad_input(format!(
                "there is no array '{name}'; the file holds: {}",
                listed(&known)
            ))
            .with_hint(option_for(known.iter().map(String::as_str))));
        }
        let mut entry = self.archive.by_name(&format!("{name}.npy")).map_err(damaged)?;
        let most = most_unpacked(self.file_len);
        if entry.size() > most {
            return Err(claims_too_much(name, &format!("{} bytes", entry.size()), self.file_len));
        }
        let mut bytes = Vec::new();
        // The size is a claim too; reading stops where it would be exceeded.
        entry.by_ref().take(most).read_to_end(&mut bytes).map_err(|source| damaged(ZipError::Io(source)))?;
        let mut header = Header::parse(name, &bytes)?;
        let elements = bytes.split_off(header.len);
        let size = header.shape.iter().try_fold(header.element_size(), |size, &len| size.checked_mul(len));
        match size {
            Some(size) if size == elements.len() => {
                let elements = header.as_usual(elements);
                Ok((header, elements))
            }
            _ => Err(Error::bad_input(format!(
                "'{name}' claims shape {:?} of {}, but holds {} bytes",
                header.shape,
                header.element,
                elements.len()
            ))
            .with_hint("the file is damaged or was not copied completely")),
        }
    }
}

/// An array of numbers, `[steps]` or `[steps, numbers a step]`, as a table; `name` may ask for a part of it.
pub(super) fn table(file: &mut Npz, name: &str) -> Result<Rows> {
    let named = Named::new(name);
    let array = file.floats(named.column)?;
    let width = match *array.shape.as_slice() {
        [1..=usize::MAX] => 1,
        [1..=usize::MAX, width @ 1..=usize::MAX] => width,
        _ => {
            return Err(Error::bad_input(format!(
                "'{name}' has shape {:?}; wanted [steps, numbers a step], at least one of each, or [steps]; images are not read",
                array.shape
            )));
        }
    };
    named.part_of(Rows::from_flat(array.values, width)?)
}

/// What stands before the elements of an array.
struct Header {
    /// Numpy's code of the element type, such as `<f4`.
    element: String,
    shape: Vec<usize>,
    /// Whether its columns are stored one after the other, and not its rows.
    by_columns: bool,
    /// Bytes before the elements.
    len: usize,
}

impl Header {
    fn parse(name: &str, bytes: &[u8]) -> Result<Self> {
        let wrong = |what: &str| Error::bad_input(format!("'{name}' is no npy array: {what}"));
        let version = match bytes {
            [0x93, b'N', b'U', b'M', b'P', b'Y', version, _, ..] => *version,
            _ => return Err(wrong("its signature is missing")),
        };
        let (start, text_len) = match (version, bytes) {
            (1, [_, _, _, _, _, _, _, _, a, b, ..]) => (10, usize::from(u16::from_le_bytes([*a, *b]))),
            (2 | 3, [_, _, _, _, _, _, _, _, a, b, c, d, ..]) => {
                (12, u32::from_le_bytes([*a, *b, *c, *d]) as usize)
            }
            _ => return Err(wrong("its header is of an unknown version or cut off")),
        };
        if text_len > LONGEST_HEADER {
            return Err(wrong(&format!(
                "its header claims {text_len} bytes; wanted at most {LONGEST_HEADER}"
            )));
        }
        let len = start + text_len;
        let text = bytes.get(start..len).and_then(|text| std::str::from_utf8(text).ok());
        let text = text.ok_or_else(|| wrong("its header is cut off"))?;
        let after = |key: &str| text.split_once(key).map(|(_, rest)| rest.trim_start());
        let element = after("'descr':")
            .and_then(|rest| rest.strip_prefix('\'')?.split_once('\''))
            .ok_or_else(|| wrong("its header names no simple element type"))?;
        let by_columns = after("'fortran_order':").is_some_and(|rest| rest.starts_with("True"));
        let shape = after("'shape':")
            .and_then(|rest| rest.strip_prefix('(')?.split_once(')'))
            .ok_or_else(|| wrong("its header has no shape"))?;
        let shape = shape.0.split(',').map(str::trim).filter(|extent| !extent.is_empty()).map(str::parse);
        let shape: Vec<usize> =
            shape.collect::<std::result::Result<_, _>>().map_err(|_| wrong("its shape is no shape"))?;
        if element.0.contains('O') {
            return Err(Error::bad_input(format!(
                "'{name}' is an array of Python objects, which is never read; wanted numbers of one shape"
            ))
            .with_hint(if name == "episode_starts" { STARTS } else { OBJECTS }));
        }
        if by_columns && shape.len() > 2 {
            return Err(wrong("it is stored from its last extent on; wanted rows (numpy.ascontiguousarray)"));
        }
        Ok(Self { element: element.0.to_owned(), shape, by_columns, len })
    }

    /// Elements row by row, and each with its lowest byte first.
    fn as_usual(&mut self, mut elements: Vec<u8>) -> Vec<u8> {
        let size = self.element_size().max(1);
        if self.element.starts_with('>') {
            elements.chunks_exact_mut(size).for_each(<[u8]>::reverse);
            self.element.replace_range(..1, "<");
        }
        match *self.shape.as_slice() {
            [rows, columns] if self.by_columns => {
                let at = |row: usize, column: usize| (column * rows + row) * size;
                let places = (0..rows).flat_map(|row| (0..columns).map(move |column| at(row, column)));
                places.flat_map(|at| elements[at..at + size].iter().copied()).collect()
            }
            _ => elements,
        }
    }

    /// Bytes of an element, as numpy's code says.
    fn element_size(&self) -> usize {
        self.element.get(2..).and_then(|digits| digits.parse().ok()).unwrap_or(0)
    }
}

fn each<T, const SIZE: usize>(bytes: &[u8], value: impl Fn([u8; SIZE]) -> T) -> Vec<T> {
    let (elements, _) = bytes.as_chunks::<SIZE>();
    elements.iter().map(|raw| value(*raw)).collect()
}

fn claims_too_much(name: &str, claim: &str, file_len: u64) -> Error {
    Error::bad_input(format!(
        "'{name}' claims {claim}, more than a recording in a file of {file_len} bytes holds"
    ))
    .with_hint(
        "the file is damaged or was not copied completely; if it is right, store it without compression",
    )
}

fn damaged(source: ZipError) -> Error {
    Error::bad_input(format!("the npz file is damaged or truncated: {source}"))
        .with_hint("was it copied or downloaded completely?")
}
