//! Writing a file whole or not at all, and telling whether a file is still the same.

use std::fs;
use std::io::{ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use crate::basics::error::{Error, Result};

/// Writes `bytes` beside `path` first and renames, so that `path` never holds half a file.
///
/// # Errors
/// `is_io` if a byte could not be written, such as on a full disk; what stood at `path` before stands there still.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    let partial = partial_path(path)?;
    let written = create_anew(&partial)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| fs::rename(&partial, path));
    written.map_err(|source| {
        // The first error is the one to tell; a leftover that cannot be removed is replaced by the next attempt.
        let _ = fs::remove_file(&partial);
        cannot_write(path, &source)
    })?;
    sync_folder_of(path)
}

/// That a file could not be written, with what helps.
pub fn cannot_write(path: &Path, source: &std::io::Error) -> Error {
    let error = Error::io("cannot write", path, source);
    match source.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => error.with_hint("free some space on that disk"),
        ErrorKind::FileTooLarge => error.with_hint("raise the limit of the size of files (ulimit -f)"),
        _ => error,
    }
}

/// A new file, whatever an attempt before left in its place: a link that somebody laid there is removed and not followed.
fn create_anew(path: &Path) -> std::io::Result<fs::File> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => fs::OpenOptions::new().write(true).create_new(true).open(path),
    }
}

/// A rename is on the disk when the folder is; not every file system can say so.
///
/// # Errors
/// `is_io` if the disk failed.
pub fn sync_folder_of(path: &Path) -> Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match fs::File::open(folder).and_then(|folder| folder.sync_all()) {
        Err(source) if source.kind() == ErrorKind::StorageFull || source.raw_os_error() == Some(EIO) => {
            Err(cannot_write(path, &source))
        }
        _ => Ok(()),
    }
}

/// An error of the disk itself, for which std has no name.
const EIO: i32 = 5;

/// The bytes of a file.
///
/// # Errors
/// `is_bad_input` if it is no plain file, such as a pipe, which would be waited for without end; `is_io` if it cannot be read.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    read_or_say("cannot read", path)
}

fn read_or_say(action: &str, path: &Path) -> Result<Vec<u8>> {
    check_or_say(action, path)?;
    fs::read(path).map_err(|source| Error::io(action, path, &source))
}

/// The text of a file that somebody wrote, without the mark that some editors put before it; `what` names it in errors.
///
/// # Errors
/// As [`read`], and `is_bad_input` if it is not UTF-8.
pub fn read_text(path: &Path, what: &str) -> Result<String> {
    let bytes = read_or_say(&format!("cannot read {what}"), path)?;
    let is_wide = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
    let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).map(<[u8]>::to_vec).unwrap_or(bytes);
    String::from_utf8(bytes).map_err(|_| {
        let found = if is_wide { "text in UTF-16" } else { "not text in UTF-8" };
        Error::bad_input(format!("{what} is {found}"))
            .at(path)
            .with_hint("save it as UTF-8, which editors offer as its encoding")
    })
}

/// Whether something is a file that ends: no pipe, device or socket.
///
/// # Errors
/// `is_bad_input` if it is one of those; `is_io` if it cannot be looked at.
pub fn check_is_plain(path: &Path) -> Result<()> {
    check_or_say("cannot read", path)
}

fn check_or_say(action: &str, path: &Path) -> Result<()> {
    let kind = fs::metadata(path).map_err(|source| Error::io(action, path, &source))?.file_type();
    match kind.is_file() || kind.is_dir() {
        true => Ok(()),
        false => Err(Error::bad_input("this is a pipe, a device or a socket; wanted a plain file")
            .at(path)
            .with_hint("write what comes out of it into a file first")),
    }
}

/// Writes files, each with its path below the folder, into a new folder, which appears whole or not at all.
///
/// # Errors
/// `is_bad_input` if there is something at `folder` already; `is_io` if a byte could not be written.
pub fn write_folder(folder: &Path, contents: &[(&str, Vec<u8>)]) -> Result<()> {
    write_folder_with(folder, contents, &[])
}

/// The same with copies of other files, each with its path below the folder and where it is.
///
/// # Errors
/// As [`write_folder`].
pub fn write_folder_with(
    folder: &Path,
    contents: &[(&str, Vec<u8>)],
    copies: &[(String, PathBuf)],
) -> Result<()> {
    if folder.exists() {
        return Err(Error::bad_input(
            "there is something of this name already; wanted the name of a new folder",
        )
        .at(folder));
    }
    let partial = partial_path(folder)?;
    if partial.exists() {
        fs::remove_dir_all(&partial)
            .map_err(|source| Error::io("cannot remove what is left of a write", &partial, &source))?;
    }
    let written = fill(&partial, contents)
        .and_then(|()| copy_into(&partial, copies))
        .and_then(|()| fs::rename(&partial, folder).map_err(|source| cannot_write(folder, &source)));
    if written.is_err() {
        // The first error is the one to tell.
        let _ = fs::remove_dir_all(&partial);
    }
    written.and_then(|()| sync_folder_of(folder))
}

fn fill(folder: &Path, contents: &[(&str, Vec<u8>)]) -> Result<()> {
    contents.iter().try_for_each(|(name, bytes)| write_atomically(&place(folder, name)?, bytes))
}

fn copy_into(folder: &Path, copies: &[(String, PathBuf)]) -> Result<()> {
    copies.iter().try_for_each(|(name, from)| {
        let copied = fs::copy(from, place(folder, name)?);
        copied.map(drop).map_err(|source| Error::io("cannot copy", from, &source))
    })
}

/// The path of a file below a folder, in folders that are there.
fn place(folder: &Path, name: &str) -> Result<PathBuf> {
    let path = folder.join(name);
    let parent = path.parent().unwrap_or(folder);
    fs::create_dir_all(parent).map_err(|source| Error::io("cannot make the folder", parent, &source))?;
    Ok(path)
}

/// SHA-256 of the files, one after the other, as hexadecimal digits.
///
/// # Errors
/// `is_io` if one cannot be read.
pub fn sha256(paths: &[PathBuf]) -> Result<String> {
    let mut hash = Sha256::new();
    for path in paths {
        let failed = |source: std::io::Error| Error::io("cannot read", path, &source);
        let mut file = fs::File::open(path).map_err(failed)?;
        let mut block = vec![0; 1 << 16];
        loop {
            let len = file.read(&mut block).map_err(failed)?;
            if len == 0 {
                break;
            }
            hash.update(&block[..len]);
        }
    }
    Ok(hexadecimal(&hash.finalize()))
}

/// SHA-256 of bytes, as hexadecimal digits.
pub fn sha256_of(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

pub(crate) fn hexadecimal(digest: &[u8]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Where the bytes wait until they are complete: the same folder, since a rename does not cross file systems.
fn partial_path(path: &Path) -> Result<PathBuf> {
    let name =
        path.file_name().ok_or_else(|| Error::bad_input("cannot write a file without a name").at(path))?;
    let mut partial = std::ffi::OsString::from(".");
    partial.push(name);
    partial.push(".partial");
    Ok(path.with_file_name(partial))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The digest of "abc" in FIPS 180-2, appendix B.1.
    #[test]
    fn sha256_agrees_with_its_standard() {
        let folder = std::env::temp_dir().join(format!("demosift-sha256-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let paths = [folder.join("1"), folder.join("2")];
        fs::write(&paths[0], b"a").unwrap();
        fs::write(&paths[1], b"bc").unwrap();
        let wanted = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256(&paths).unwrap(), wanted);
        assert!(sha256(&[folder.join("3")]).unwrap_err().is_io());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = std::env::temp_dir().join(format!("demosift-files-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("noun.json");
        write_atomically(&path, b"old").unwrap();
        write_atomically(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");

        // A folder in the way of the rename stands for every failure after the first byte.
        let blocked = folder.join("blocked");
        fs::create_dir_all(blocked.join("inside")).unwrap();
        assert!(write_atomically(&blocked, b"new").unwrap_err().is_io());
        let left: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(left.len(), 2, "{left:?}");
        fs::remove_dir_all(&folder).unwrap();
    }
}
