//! Writing a file whole or not at all, and telling whether a file is still the same.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::io::{ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use sha2::{Digest as _, Sha256};

use crate::basics::error::{Error, Result};

/// Writes `bytes` beside `path` first and renames, so that `path` never holds half a file, whoever else writes it.
///
/// # Errors
/// `is_io` if a byte could not be written, such as on a full disk; what stood at `path` before stands there still.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    let partial = path.with_file_name(hidden(path, &format!("{}.", Writer::next().in_words()))?);
    let written = create_anew(&partial)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| fs::rename(&partial, path));
    written.map_err(|source| {
        // The first error is the one to tell.
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

/// The bytes of a file that another process may delete or replace meanwhile; none if it is not there.
///
/// # Errors
/// As [`read`].
pub fn read_if_there(path: &Path) -> Result<Option<Vec<u8>>> {
    read_if_found(path, |path| fs::read(path))
}

fn read_if_found(
    path: &Path,
    mut read: impl FnMut(&Path) -> std::io::Result<Vec<u8>>,
) -> Result<Option<Vec<u8>>> {
    for left in (0..TRIES).rev() {
        // A link that leads nowhere is there, and cannot be read.
        match fs::symlink_metadata(path) {
            Err(source) if source.kind() == ErrorKind::NotFound => return Ok(None),
            _ => {}
        }
        match is_plain(path).and_then(|is_plain| is_plain.then(|| read(path)).transpose()) {
            Ok(Some(bytes)) => return Ok(Some(bytes)),
            Ok(None) => return Err(not_plain(path)),
            Err(source) if left > 0 && is_passing(&source) => std::thread::sleep(BETWEEN_TRIES),
            Err(source) => return Err(Error::io("cannot read", path, &source)),
        }
    }
    unreachable!("the last try returns")
}

/// How often a file is looked for that was there a moment before.
const TRIES: usize = 20;
const BETWEEN_TRIES: Duration = Duration::from_millis(10);

/// Whether it may be otherwise a moment later: the file was deleted or replaced since it was found, on a network disk perhaps
/// by another machine.
fn is_passing(source: &std::io::Error) -> bool {
    [ErrorKind::NotFound, ErrorKind::StaleNetworkFileHandle].contains(&source.kind())
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
    match is_plain(path).map_err(|source| Error::io(action, path, &source))? {
        true => Ok(()),
        false => Err(not_plain(path)),
    }
}

fn is_plain(path: &Path) -> std::io::Result<bool> {
    fs::metadata(path).map(|found| found.is_file() || found.is_dir())
}

fn not_plain(path: &Path) -> Error {
    Error::bad_input("this is a pipe, a device or a socket; wanted a plain file")
        .at(path)
        .with_hint("write what comes out of it into a file first")
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
    // The name of nobody's else: a folder is made once, and what is left of an attempt goes away with the next.
    let partial = folder.with_file_name(hidden(folder, "")?);
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

/// Under which name something waits until it is complete: in the same folder, since a rename does not cross file systems.
fn hidden(path: &Path, writer: &str) -> Result<OsString> {
    let name =
        path.file_name().ok_or_else(|| Error::bad_input("cannot write a file without a name").at(path))?;
    Ok([OsStr::new("."), name, OsStr::new("."), OsStr::new(writer), OsStr::new("partial")]
        .into_iter()
        .collect())
}

/// Who writes a file: several processes, of several machines, may write the same one, each under a name of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Writer {
    process: u32,
    /// Which write of the process.
    write: u64,
    /// Hash of what tells machines and containers apart.
    machine: String,
}

impl Writer {
    fn next() -> Self {
        static WRITES: AtomicU64 = AtomicU64::new(0);
        static MACHINE: LazyLock<String> = LazyLock::new(|| {
            let line = |path: &str| fs::read_to_string(path).unwrap_or_default();
            let namespace = fs::read_link("/proc/self/ns/pid").unwrap_or_default();
            let known =
                [line("/proc/sys/kernel/hostname"), line("/etc/machine-id"), namespace.display().to_string()];
            sha256_of(known.concat().as_bytes())[..MACHINE_DIGITS].to_owned()
        });
        let write = WRITES.fetch_add(1, Ordering::Relaxed);
        Self { process: std::process::id(), write, machine: MACHINE.clone() }
    }

    fn in_words(&self) -> String {
        format!("{}-{}-{}", self.process, self.write, self.machine)
    }

    fn of(words: &str) -> Option<Self> {
        let parts: Vec<&str> = words.split('-').collect();
        let [process, write, machine] = parts[..] else { return None };
        let is_machine =
            machine.len() == MACHINE_DIGITS && machine.chars().all(|digit| digit.is_ascii_hexdigit());
        let writer =
            Self { process: process.parse().ok()?, write: write.parse().ok()?, machine: machine.to_owned() };
        is_machine.then_some(writer)
    }
}

const MACHINE_DIGITS: usize = 8;

/// A write that has not come to its end, known by its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unfinished<'a> {
    /// The file that was to be.
    pub name: &'a str,
    /// Those of before there could be several do not say.
    writer: Option<Writer>,
}

impl<'a> Unfinished<'a> {
    /// Whether this is the name of one.
    pub fn of(name: &'a str) -> Option<Self> {
        let name = name.strip_prefix('.')?.strip_suffix(".partial")?;
        let by = name.rsplit_once('.').and_then(|(name, words)| Some((name, Writer::of(words)?)));
        let (name, writer) = by.map_or((name, None), |(name, writer)| (name, Some(writer)));
        Some(Self { name, writer })
    }

    /// Whether its process is no more, as far as this one can tell: of other machines it can tell nothing.
    pub fn is_left_over(&self) -> bool {
        let Some(writer) = &self.writer else { return false };
        let processes = Path::new("/proc");
        writer.machine == Writer::next().machine
            && processes.join("self").exists()
            && !processes.join(writer.process.to_string()).exists()
    }
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

    /// Of a file that another process deletes or replaces between looking and reading, here at each of the first tries.
    #[test]
    fn what_goes_away_while_it_is_read_is_not_there_and_what_comes_back_is_read() {
        let folder = std::env::temp_dir().join(format!("demosift-going-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("checkpoint.bin");
        assert_eq!(read_if_there(&path).unwrap(), None);
        fs::write(&path, "old").unwrap();
        assert_eq!(read_if_there(&path).unwrap().as_deref(), Some(b"old".as_slice()));

        let deleted = read_if_found(&path, |path| {
            fs::remove_file(path)?;
            fs::read(path)
        });
        assert_eq!(deleted.unwrap(), None);
        let mut stale = 3;
        fs::write(&path, "new").unwrap();
        let replaced = read_if_found(&path, |path| match stale {
            0 => fs::read(path),
            _ => {
                stale -= 1;
                Err(ErrorKind::StaleNetworkFileHandle.into())
            }
        });
        assert_eq!(replaced.unwrap().as_deref(), Some(b"new".as_slice()));
        let never = read_if_found(&path, |_| Err(ErrorKind::StaleNetworkFileHandle.into()));
        assert!(never.unwrap_err().is_io());
        fs::remove_dir_all(&folder).unwrap();
    }

    /// Each write has another place to wait in, so that none takes what another one has written so far.
    #[test]
    fn a_file_that_several_write_at_once_holds_what_one_of_them_wrote() {
        let folder = std::env::temp_dir().join(format!("demosift-several-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("study.json");
        std::thread::scope(|scope| {
            for writer in 0..4_u8 {
                let path = &path;
                scope.spawn(move || {
                    (0..50).for_each(|_| write_atomically(path, &vec![writer; 10_000]).unwrap());
                });
            }
        });
        let held = fs::read(&path).unwrap();
        assert!(held.len() == 10_000 && held.iter().all(|byte| *byte == held[0]), "{}", held.len());
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_write_that_is_not_finished_says_of_what_and_by_whom() {
        let me = Writer::next();
        let name = format!(".scores_paper.json.{}.partial", me.in_words());
        let found = Unfinished::of(&name).unwrap();
        assert_eq!((found.name, found.writer.as_ref()), ("scores_paper.json", Some(&me)));
        assert!(!found.is_left_over(), "this process is there");
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        let gone = Writer { process: child.id(), ..me };
        let elsewhere = Writer { machine: "00000000".to_owned(), ..gone.clone() };
        for (writer, wanted) in [(gone, true), (elsewhere, false)] {
            let name = format!(".a.b.{}.partial", writer.in_words());
            assert_eq!(
                Unfinished::of(&name).map(|of| (of.name.to_owned(), of.is_left_over())),
                Some(("a.b".to_owned(), wanted))
            );
        }
        // Those of before said nothing of who writes.
        assert_eq!(Unfinished::of(".report.html.partial").map(|of| of.name), Some("report.html"));
        assert!(
            ["report.html", "half.partial", ".report.html"].iter().all(|name| Unfinished::of(name).is_none())
        );
    }
}
