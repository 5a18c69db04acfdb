//! One writer at a time: a folder is locked while a command writes into it.
//!
//! The lock is a folder `.lock` that holds one empty file, whose name says who writes: host, process, and since when.
//! It is made beside and renamed into place, which fails where there is a folder with something in it, so it appears with its
//! holder inside or not at all.
//! A lock whose holder is gone is taken over by renaming that file: its name is nobody else's, so of two that try, one finds
//! it gone.
//! Nothing but a rename has to be atomic, so network disks will do, on which the locks of the system are not to be trusted.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use demosift::{Error, Result};
use rustix::io::Errno;
use rustix::process::{Pid, test_kill_process};

use crate::files::writing::undisturbed;

/// How often it is tried to take a lock that changes hands meanwhile.
const TRIES: usize = 200;
const BETWEEN_TRIES: Duration = Duration::from_millis(5);

/// Between the parts of a holder's name; no host is called so.
const BETWEEN: char = '+';

/// Locks that this process holds, for an interruption to give back.
static HELD: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A folder is locked for as long as this lives.
#[derive(Debug)]
pub(crate) struct Lock {
    /// The holder's file; none where another part of this process holds the lock.
    file: Option<PathBuf>,
}

impl Drop for Lock {
    fn drop(&mut self) {
        if let Some(file) = &self.file {
            give_back(file);
            held().retain(|other| other != file);
        }
    }
}

fn held() -> std::sync::MutexGuard<'static, Vec<PathBuf>> {
    HELD.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Gives all locks back, as the process ends without another step.
pub(crate) fn give_all_back() {
    held().iter().for_each(|file| give_back(file));
}

fn give_back(file: &Path) {
    // Whoever finds it taken over, or the disk gone, has nothing to give back.
    let _ = fs::remove_file(file);
    if let Some(lock) = file.parent() {
        let _ = fs::remove_dir(lock);
    }
}

/// Locks a folder; `name` tells locks of parts of it apart, which are written side by side, and is empty for the whole.
///
/// # Errors
/// `is_bad_input` if another command writes there; `is_io` if the lock cannot be made.
pub(crate) fn take(folder: &Path, name: &str) -> Result<Lock> {
    undisturbed(|| take_now(folder, name))
}

fn take_now(folder: &Path, name: &str) -> Result<Lock> {
    let me = Holder::me();
    let lock = folder.join(format!(".lock{name}"));
    let failed = |error: std::io::Error| Error::io("cannot lock the folder", folder, &error);
    let file = lock.join(me.name());
    for _ in 0..TRIES {
        if put(folder, &lock, &me).map_err(failed)? {
            return Ok(taken(file));
        }
        let Some(name) = name_in(&lock).map_err(failed)? else {
            // It is being given back.
            std::thread::sleep(BETWEEN_TRIES);
            continue;
        };
        let Some(holder) = Holder::of(&name) else { return Err(unknown(folder, &lock)) };
        if holder == me {
            return Ok(Lock { file: None });
        }
        if !holder.is_gone(&me) {
            return Err(busy(&holder, folder, &lock));
        }
        match fs::rename(lock.join(&name), &file) {
            Ok(()) => return Ok(taken(file)),
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(failed(error)),
        }
    }
    Err(unknown(folder, &lock))
}

fn taken(file: PathBuf) -> Lock {
    held().push(file.clone());
    Lock { file: Some(file) }
}

/// Puts a lock with its holder inside into place, unless there is one.
fn put(folder: &Path, lock: &Path, me: &Holder) -> std::io::Result<bool> {
    let made = folder.join(format!(".lock.{}.partial", me.name()));
    fs::create_dir(&made).or_else(|error| match error.kind() {
        ErrorKind::AlreadyExists => Ok(()),
        _ => Err(error),
    })?;
    let is_put = fs::write(made.join(me.name()), "").and_then(|()| fs::rename(&made, lock));
    if is_put.is_err() {
        let _ = fs::remove_dir_all(&made);
    }
    match is_put {
        Ok(()) => Ok(true),
        // The lock is there; or somebody tidied up, or another disk does not rename onto an empty folder.
        Err(error)
            if [ErrorKind::DirectoryNotEmpty, ErrorKind::AlreadyExists, ErrorKind::NotFound]
                .contains(&error.kind()) =>
        {
            let _ = fs::remove_dir(lock);
            Ok(false)
        }
        Err(error) => Err(error),
    }
}

/// The name in a lock, if it is there and not being given back.
fn name_in(lock: &Path) -> std::io::Result<Option<String>> {
    match fs::read_dir(lock) {
        Ok(mut entries) => {
            let entry = entries.next().transpose()?;
            Ok(entry.map(|entry| entry.file_name().to_string_lossy().into_owned()))
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

fn busy(holder: &Holder, folder: &Path, lock: &Path) -> Error {
    Error::bad_input(format!("another command writes into this folder: {holder}"))
    .at(folder)
    .with_hint(format!(
        "wait until it is done, or give another folder to --out; where there is no such process any more, delete {}",
        lock.display()
    ))
}

fn unknown(folder: &Path, lock: &Path) -> Error {
    Error::bad_input("it cannot be told who writes into this folder")
        .at(folder)
        .with_hint(format!("where nobody does, delete {}", lock.display()))
}

/// Who holds the lock of a folder and runs where it cannot be told from here whether it is still there: on another machine, or
/// in another container of this one.
pub(crate) fn held_elsewhere(folder: &Path, name: &str) -> Option<Holder> {
    let held = name_in(&folder.join(format!(".lock{name}"))).ok().flatten()?;
    Holder::of(&held).filter(|holder| !holder.can_be_told(&Holder::me()))
}

/// Names that others hold, and the first that they do not.
pub(crate) struct Beside {
    pub(crate) name: String,
    pub(crate) held: Vec<String>,
}

impl Beside {
    /// The name, or `NAME.2` and so on: where somebody of another machine holds the first, nobody here can know whether that
    /// machine was lost.
    pub(crate) fn of(first: &str, held_by: impl Fn(&str) -> Option<Holder>, tell: impl Fn(&Holder)) -> Self {
        let mut place = Self { name: first.to_owned(), held: Vec::new() };
        while let Some(holder) = held_by(&place.name) {
            tell(&holder);
            let next = format!("{first}.{}", place.held.len() + 2);
            place.held.push(std::mem::replace(&mut place.name, next));
        }
        place
    }
}

/// Whether a folder holds the lock of a process, be it alive or gone.
pub(crate) fn is_there(folder: &Path) -> bool {
    fs::symlink_metadata(folder.join(".lock")).is_ok()
}

/// Whether a name in a folder is what a killed command left on its way to a lock.
pub(crate) fn is_left_over(name: &str) -> bool {
    name.starts_with(".lock.") && name.ends_with(".partial")
}

/// Whether a name in a folder is that of a lock.
pub(crate) fn is_one(name: &str) -> bool {
    name.starts_with(".lock")
}

/// Who holds a lock.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Holder {
    host: String,
    /// Distinguishes machines of the same name, and whether it is the same that was started again; empty where nothing tells.
    machine: String,
    /// Since when the machine runs.
    boot: String,
    /// Where processes are counted; containers have places of their own.
    namespace: String,
    process: u32,
    /// When the process began, as numbers of processes are used again.
    began: u64,
}

impl Holder {
    fn me() -> Self {
        let line = |path: &str| fs::read_to_string(path).unwrap_or_default().trim().to_owned();
        let namespace = fs::read_link("/proc/self/ns/pid").unwrap_or_default();
        let process = std::process::id();
        let plain = |text: String| text.replace(['/', BETWEEN, '\0'], "_");
        Self {
            host: plain(line("/proc/sys/kernel/hostname")),
            machine: plain(line("/etc/machine-id")),
            boot: plain(line("/proc/sys/kernel/random/boot_id")),
            namespace: namespace.to_string_lossy().chars().filter(char::is_ascii_digit).collect(),
            process,
            began: began(process).unwrap_or_default(),
        }
    }

    fn name(&self) -> String {
        let Self { host, machine, boot, namespace, process, began } = self;
        [host, &process.to_string(), &began.to_string(), namespace, boot, machine]
            .map(String::as_str)
            .join(&BETWEEN.to_string())
    }

    fn of(name: &str) -> Option<Self> {
        let parts: Vec<&str> = name.split(BETWEEN).collect();
        let [host, process, began, namespace, boot, machine] = parts[..] else { return None };
        Some(Self {
            host: host.to_owned(),
            machine: machine.to_owned(),
            boot: boot.to_owned(),
            namespace: namespace.to_owned(),
            process: process.parse().ok()?,
            began: began.parse().ok()?,
        })
    }

    /// Whether there is no such process any more, as far as this one can tell.
    fn is_gone(&self, me: &Self) -> bool {
        self.can_be_told(me) && (self.boot != me.boot || !is_alive(self.process, self.began))
    }

    /// Whether this process can tell if that one is there; of another machine it can tell nothing.
    fn can_be_told(&self, me: &Self) -> bool {
        if (&self.host, &self.machine) != (&me.host, &me.machine) {
            return false;
        }
        match self.boot == me.boot {
            true => self.namespace == me.namespace,
            // The machine was started again, if it is the same one.
            false => !me.machine.is_empty(),
        }
    }
}

impl std::fmt::Display for Holder {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "process {} of the host {}", self.process, self.host)
    }
}

fn is_alive(process: u32, since: u64) -> bool {
    let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) else { return false };
    match test_kill_process(pid) {
        Err(Errno::SRCH) => false,
        // It may be somebody else's, of whom nothing else can be seen.
        _ => began(process).is_none_or(|began| began == since) && !is_dead(process),
    }
}

/// Whether a process only waits for its parent to read how it ended.
fn is_dead(process: u32) -> bool {
    stat(process).and_then(|stat| stat.chars().next()).is_some_and(|state| "ZX".contains(state))
}

/// When a process began, in the clock's own unit since the machine did.
fn began(process: u32) -> Option<u64> {
    // Field 22 of proc(5), the state being field 3.
    stat(process)?.split(' ').nth(22 - 3)?.parse().ok()
}

/// What the system says of a process, from its state on; its name before that may hold anything.
fn stat(process: u32) -> Option<String> {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    stat.rsplit_once(") ").map(|(_, rest)| rest.to_owned())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn scratch(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("demosift-lock-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn put_by(folder: &Path, holder: &Holder) {
        fs::create_dir_all(folder.join(".lock")).unwrap();
        fs::write(folder.join(".lock").join(holder.name()), "").unwrap();
    }

    /// A process that has ended and was waited for.
    fn gone() -> Holder {
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        Holder { process: child.id(), began: 1, ..Holder::me() }
    }

    #[test]
    fn a_holder_is_its_name() {
        let me = Holder::me();
        assert_eq!(Holder::of(&me.name()), Some(me.clone()));
        assert!(!me.is_gone(&me), "{me:?}");
        assert!(me.began > 0 && !me.host.is_empty(), "{me:?}");
    }

    #[test]
    fn it_is_there_while_it_is_held_and_leaves_nothing() {
        let folder = scratch("held");
        let lock = take(&folder, "").unwrap();
        assert!(folder.join(".lock").join(Holder::me().name()).exists());
        // Another part of the same process shares it, and part of the folder has a lock of its own.
        drop(take(&folder, "").unwrap());
        drop(take(&folder, "_1_of_2").unwrap());
        assert!(folder.join(".lock").exists());
        drop(lock);
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 0);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn that_of_a_process_which_lives_or_of_another_host_is_told_with_both() {
        let folder = scratch("busy");
        let mut child = std::process::Command::new("sleep").arg("60").spawn().unwrap();
        let alive = Holder { process: child.id(), began: began(child.id()).unwrap(), ..Holder::me() };
        let elsewhere = Holder { host: "lab7".to_owned(), ..gone() };
        for holder in [alive, elsewhere] {
            put_by(&folder, &holder);
            let error = take(&folder, "").unwrap_err();
            let wanted = format!("process {} of the host {}", holder.process, holder.host);
            assert!(error.is_bad_input() && error.to_string().contains(&wanted), "{error}");
            assert!(error.hint().unwrap().contains(".lock"));
            let is_elsewhere = holder.host == "lab7";
            assert_eq!(held_elsewhere(&folder, ""), is_elsewhere.then_some(holder));
            fs::remove_dir_all(folder.join(".lock")).unwrap();
        }
        child.kill().unwrap();
        child.wait().unwrap();
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 0);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn that_of_a_process_which_is_gone_is_taken_over() {
        let folder = scratch("gone");
        let me = Holder::me();
        let reused = Holder { began: me.began + 1, ..me.clone() };
        let mut holders = vec![gone(), reused];
        if !me.machine.is_empty() {
            holders.push(Holder { boot: "before".to_owned(), ..me });
        }
        for holder in holders {
            put_by(&folder, &holder);
            drop(take(&folder, "").unwrap());
            assert_eq!(fs::read_dir(&folder).unwrap().count(), 0, "{holder:?}");
        }
        fs::create_dir(folder.join(".lock")).unwrap();
        drop(take(&folder, "").unwrap());
        fs::remove_dir_all(&folder).unwrap();
    }

    /// The two steps of a take-over, in every order in which two that saw the same dead holder can do them.
    #[test]
    fn of_two_that_take_over_one_wins() {
        let folder = scratch("two");
        let dead = gone();
        put_by(&folder, &dead);
        let lock = folder.join(".lock");
        let rename = |to: &str| fs::rename(lock.join(dead.name()), lock.join(to)).is_ok();
        assert!(rename("first"));
        assert!(!rename("second"));
        fs::remove_dir_all(&folder).unwrap();
    }
}
