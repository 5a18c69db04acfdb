//! Opening demonstrations of any format that is known: told apart by looking, once, and read by the format's own reader.
//!
//! Each format is a module with a function that reads episodes; [`open`] finds the right one.

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use crate::basics::error::{Error, Result};
use crate::basics::files;
use crate::data::demonstration::choice::{self, Choice};
use crate::data::demonstration::episode::{Columns, Format, MINARI_HDF5, RECORDED, Source};
use crate::data::demonstration::listing::ColumnSeen;
use crate::data::demonstration::named::listed;
use crate::data::demonstration::parquet_table::Table;
use crate::data::demonstration::{
    DemonstrationSet, aloha, baselines_npz, d4rl, hdf5, imitation_npz, lerobot, minari, npz, pointer,
    robomimic, stable_baselines_npz,
};
use crate::data::trajectory::StateLog;

/// Reads a file or folder of any format that is known; `format` skips the look.
///
/// # Errors
/// `is_bad_input` if it is of no known format, is not what its format wants, or is damaged; `is_io` if it may not be read.
///
/// ```
/// use std::path::Path;
///
/// use demosift::data::demonstration::episode::{Columns, Format};
/// use demosift::data::demonstration::inspection::inspect;
/// use demosift::data::demonstration::open::open;
///
/// // A file of robomimic, which keeps an observation in several columns.
/// let file = Path::new("tests/formats/robomimic.hdf5");
/// let source = open(file, None, &Columns::default())?;
/// assert_eq!(source.format, Format::Robomimic);
/// assert_eq!(source.columns.observations, ["obs/joint", "obs/wrist"]);
///
/// // What is in it, before anything is learned from it.
/// let seen = inspect(&source);
/// let steps: Vec<usize> = seen.episodes.iter().map(|episode| episode.steps).collect();
/// assert_eq!(steps, [4, 3, 5]);
/// assert!(seen.actions.iter().all(|action| action.outside == 0));
///
/// // The demonstrations, checked: they fit each other, and every number is finite.
/// let set = source.set()?;
/// assert_eq!((set.len(), set.observation_size(), set.action_size()), (3, 3, 2));
///
/// // Other columns, and an error that says what would have been right.
/// let wrong = Columns { observations: vec!["obs/elbow".to_owned()], ..Columns::default() };
/// let error = open(file, None, &wrong).unwrap_err();
/// assert!(error.is_bad_input() && error.to_string().contains("camera_image, joint, wrist"), "{error}");
/// # Ok::<(), demosift::Error>(())
/// ```
pub fn open(path: &Path, format: Option<Format>, columns: &Columns) -> Result<Source> {
    let found = located(path, format)?;
    read(&found, columns).map_err(|error| error.at(path))
}

/// The same, but only the episodes that are chosen.
///
/// # Errors
/// As [`open`], and `is_bad_input` if an episode or a filter key is named that is not there.
pub fn open_chosen(
    path: &Path,
    format: Option<Format>,
    columns: &Columns,
    choice: &Choice,
) -> Result<Source> {
    let found = located(path, format)?;
    let chosen = || {
        let source = read(&found, columns)?;
        let of_key = match &choice.filter_key {
            Some(name) if found.format == Format::Robomimic => {
                Some(robomimic::filter_key(&found.path, name)?)
            }
            Some(name) => {
                return Err(Error::bad_input(format!(
                    "--filter-key {name}: only a robomimic file has filter keys, and this is stored as {}",
                    found.format
                )));
            }
            None => None,
        };
        choice::choose(source, choice, of_key.as_deref())
    };
    chosen().map_err(|error| error.at(path))
}

fn read(Located { path, format }: &Located, columns: &Columns) -> Result<Source> {
    match format {
        Format::D4rl => d4rl::read_source(path, columns),
        Format::LeRobotV3 | Format::LeRobotV2 => lerobot::read_source(path, columns),
        Format::MinariHdf5 => minari::read_hdf5(path, columns),
        Format::MinariParquet => minari::read_parquet(path, columns),
        Format::Robomimic => robomimic::read_source(path, columns),
        Format::BaselinesNpz => baselines_npz::read_source(path, columns),
        Format::ImitationNpz => imitation_npz::read_source(path, columns),
        Format::StableBaselinesNpz => stable_baselines_npz::read_source(path, columns),
        Format::ManiSkill => minari::read_maniskill(path, columns),
        Format::Aloha => aloha::read_source(path, columns),
    }
}

/// Every column that the file or folder of a source holds, as far as it can be told; those of the first episode where each has
/// its own.
///
/// # Errors
/// As [`open`].
pub fn columns(path: &Path, source: &Source) -> Result<Vec<ColumnSeen>> {
    let (path, read) = (locate(path, Some(source.format))?.path, &source.columns);
    let first = source.episodes.first().map_or("0", |episode| &episode.label);
    let in_group = |path: &Path, group: &str| {
        let opened = hdf5::open(path)?;
        let root = opened.file.root();
        if group.is_empty() {
            return hdf5::list(&root, read);
        }
        hdf5::list(&root.group(group).map_err(hdf5::damaged)?, read)
    };
    match source.format {
        Format::D4rl => in_group(&path, ""),
        Format::LeRobotV3 | Format::LeRobotV2 => lerobot::list(&path, read),
        Format::MinariHdf5 => in_group(&path, &format!("episode_{first}")),
        Format::ManiSkill => in_group(&path, &format!("traj_{first}")),
        Format::Robomimic => robomimic::list(&path, first, read),
        Format::MinariParquet => match minari::parquet_files(&path)?.first() {
            Some(file) => Ok(Table::open(file)?.list(read)),
            None => Ok(Vec::new()),
        },
        Format::BaselinesNpz | Format::ImitationNpz | Format::StableBaselinesNpz => {
            Ok(npz::open(&path)?.list(read))
        }
        Format::Aloha => match aloha::files(&path)?.first() {
            Some(file) => in_group(file, ""),
            None => Ok(Vec::new()),
        },
    }
}

/// The demonstrations of a file or folder, checked.
///
/// # Errors
/// As [`open`] and [`Source::set`].
pub fn read_set(path: &Path, format: Option<Format>, columns: &Columns) -> Result<DemonstrationSet> {
    open(path, format, columns)?.set().map_err(|error| error.at(path))
}

/// The files that hold the demonstrations, in a fixed order: what a hash of the data is made of.
///
/// # Errors
/// As [`open`] where the format is not given, and `is_io` if a folder cannot be listed.
pub fn files(path: &Path, format: Option<Format>) -> Result<Vec<PathBuf>> {
    let Located { path: entry, format } = locate(path, format)?;
    match format {
        Format::LeRobotV3 | Format::LeRobotV2 => lerobot::files(&entry),
        Format::MinariParquet => minari::parquet_files(&entry),
        Format::Aloha => aloha::files(&entry),
        _ => Ok(vec![entry]),
    }
}

/// SHA-256 of the demonstrations, as hexadecimal digits: of the files that hold them, or of what was read where the file also
/// holds what is not of them, such as the filter keys of robomimic.
///
/// # Errors
/// `is_io` if a file cannot be read.
pub fn sha256(source: &Source, path: &Path) -> Result<String> {
    if source.format != Format::Robomimic {
        return files::sha256(&self::files(path, Some(source.format))?);
    }
    let mut bytes = Vec::new();
    for episode in &source.episodes {
        bytes.extend(format!("{} {}\n", episode.label, episode.actions.len()).into_bytes());
        for rows in [&episode.observations, &episode.actions] {
            bytes.extend(rows.flat().iter().flat_map(|value| value.to_le_bytes()));
        }
    }
    Ok(files::sha256_of(&bytes))
}

/// The simulator's states from which each demonstration's actions were taken, in file order; `None` if the set has none
/// that say which numbers are positions and which velocities. For replays, never for what judges.
///
/// # Errors
/// As the reader of the format; see [`d4rl::read_states`] and [`lerobot::read_states`].
pub fn read_states(path: &Path, format: Option<Format>) -> Result<Option<Vec<StateLog>>> {
    let Located { path: entry, format } = located(path, format)?;
    match format {
        Format::D4rl => d4rl::read_states(&entry),
        Format::LeRobotV3 | Format::LeRobotV2 => lerobot::read_states(&entry),
        _ => Ok(None),
    }
}

/// Where demonstrations lie, and how they are stored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Located {
    /// The file or folder that the reader of the format takes.
    pub path: PathBuf,
    /// The format.
    pub format: Format,
}

/// Finds the demonstrations, where `path` may be a folder around them; what is found opens without another look.
///
/// # Errors
/// As [`open`].
pub fn located(path: &Path, format: Option<Format>) -> Result<Located> {
    locate(path, format).map_err(|error| error.at(path))
}

fn locate(path: &Path, format: Option<Format>) -> Result<Located> {
    let format = format.map_or_else(|| detect(path), Ok)?;
    Ok(Located { path: entry(path, format)?, format })
}

const KNOWN: &str = "known are: HDF5 files of D4RL, robomimic, Minari and ManiSkill; npz files of baselines, stable-baselines \
                     and imitation; folders of LeRobot (meta/info.json), Minari (data/main_data.hdf5 or data/metadata.json), \
                     ALOHA (episode_0.hdf5) and demosift (demonstrations.hdf5); docs/formats.md shows how to write your own \
                     arrays";

/// The format of what lies there.
///
/// # Errors
/// `is_bad_input` if it is of none; says which are known.
fn detect(path: &Path) -> Result<Format> {
    let metadata = fs::metadata(path).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => {
            Error::bad_input("the demonstration file does not exist").with_hint("check the path")
        }
        _ => Error::io("cannot read the demonstrations", path, &source),
    })?;
    if !metadata.is_dir() {
        return of_file(path);
    }
    // Without the right to look into it, it would seem to hold nothing.
    fs::read_dir(path).map_err(|source| Error::io("cannot look into the folder", path, &source))?;
    of_folder(path)
}

/// The file or folder that the reader of a format takes.
fn entry(path: &Path, format: Format) -> Result<PathBuf> {
    let folder_of_data = |named: &str| {
        if path.join("data").join(named).exists() { path.join("data") } else { path.to_owned() }
    };
    Ok(match format {
        _ if !path.is_dir() => path.to_owned(),
        Format::D4rl => path.join(RECORDED),
        Format::MinariHdf5 => folder_of_data(MINARI_HDF5).join(MINARI_HDF5),
        Format::MinariParquet => folder_of_data("metadata.json"),
        Format::LeRobotV3 | Format::LeRobotV2 => path.to_owned(),
        Format::Aloha => path.to_owned(),
        Format::Robomimic
        | Format::BaselinesNpz
        | Format::ImitationNpz
        | Format::StableBaselinesNpz
        | Format::ManiSkill => {
            return Err(Error::bad_input(format!(
                "this is a folder; a demonstration set in {format} is a file"
            )));
        }
    })
}

fn of_folder(path: &Path) -> Result<Format> {
    let data = path.join("data");
    if path.join(lerobot::INFO).exists() {
        lerobot::version(path)
    } else if [path, data.as_path()].iter().any(|folder| folder.join(MINARI_HDF5).exists()) {
        Ok(Format::MinariHdf5)
    } else if [path, data.as_path()].iter().any(|folder| folder.join("metadata.json").exists()) {
        Ok(Format::MinariParquet)
    } else if path.join(RECORDED).exists() {
        Ok(Format::D4rl)
    } else if aloha::files(path).is_ok() {
        Ok(Format::Aloha)
    } else {
        Err(of_no_folder(path))
    }
}

/// A folder that is none of the known ones; says what it is, where another tool is known to write such.
fn of_no_folder(path: &Path) -> Error {
    if let Err(source) = fs::metadata(path.join(RECORDED))
        && source.kind() == std::io::ErrorKind::PermissionDenied
    {
        return Error::io("cannot look into the folder", path, &source);
    }
    let has = |name: &str| path.join(name).exists();
    if has("dataset_info.json") || has("dataset_dict.json") || has("state.json") {
        return Error::bad_input(
            "this is a folder of the `datasets` package (imitation 1.0 saves such), which is not read; wanted a file",
        )
        .with_hint(
            "in Python, with imitation: import numpy as np; from imitation.data import serialize; ts = serialize.load(FOLDER); \
             np.savez(\"set.npz\", obs=np.concatenate([t.obs for t in ts]), acts=np.concatenate([t.acts for t in ts]), \
             indices=np.cumsum([len(t.acts) for t in ts])[:-1])",
        );
    }
    if is_of_hub(path) || is_of_hub(&path.join("data")) {
        return Error::bad_input(
            "these are parquet files of the `datasets` package, as on a hub, which are not read; wanted a file",
        )
        .with_hint(OF_HUB);
    }
    if has(".zgroup") || has("zarr.json") {
        return Error::bad_input(
            "this is a zarr store, which is not read; wanted a file or folder of a known format",
        )
        .with_hint("docs/formats.md shows in ten lines how arrays become a file that is read");
    }
    Error::bad_input(format!("this folder holds no {RECORDED}, so it is no demonstration set"))
        .with_hint(KNOWN)
}

/// What `imitation` puts on a hub, one trajectory a row.
const OF_HUB: &str = "with the columns of imitation, in Python: import numpy as np, pandas as pd; t = pd.read_parquet(\"FOLDER/data\"); \
                      np.savez(\"set.npz\", obs=np.concatenate([np.stack(o) for o in t.obs]), \
                      acts=np.concatenate([np.stack(a) for a in t.acts]), indices=np.cumsum([len(a) for a in t.acts])[:-1])";

/// Whether a folder holds a split of the `datasets` package as parquet files.
fn is_of_hub(folder: &Path) -> bool {
    let is_split = |name: &std::ffi::OsStr| {
        let name = name.to_string_lossy();
        name.ends_with(".parquet") && (name.starts_with("train-") || name.starts_with("test-"))
    };
    fs::read_dir(folder).is_ok_and(|entries| entries.flatten().any(|entry| is_split(&entry.file_name())))
}

fn of_file(path: &Path) -> Result<Format> {
    pointer::refuse(path)?;
    let mut start = Vec::new();
    fs::File::open(path)
        .and_then(|file| file.take(8).read_to_end(&mut start))
        .map_err(|source| Error::io("cannot read the demonstrations", path, &source))?;
    if start.is_empty() {
        return Err(Error::bad_input("the file is empty; it should hold demonstrations")
            .with_hint("was it copied or downloaded completely?"));
    }
    if start.starts_with(b"PK") {
        return npz::names(path).and_then(|names| of_npz(&names));
    }
    if start.starts_with(b"PAR1") {
        let error =
            Error::bad_input("this is one parquet file of a data set; wanted the folder of the whole set");
        return Err(match path.parent().is_some_and(is_of_hub) {
            true => error.with_hint(OF_HUB),
            false => error,
        });
    }
    // An HDF5 file may have something else before it, so its own reader looks for the signature.
    if !hdf5_pure::is_hdf5(path)
        .map_err(|source| Error::io("cannot read the demonstrations", path, &source))?
    {
        return Err(Error::bad_input("not an HDF5 file, and not an npz file either").with_hint(KNOWN));
    }
    let opened = hdf5::open(path)?;
    let groups = opened.file.root().groups().map_err(hdf5::damaged)?;
    let is_numbered = |prefix: &str| groups.iter().any(|name| name.starts_with(prefix));
    if groups.iter().any(|name| name == "data") || is_numbered("demo_") {
        Ok(Format::Robomimic)
    } else if is_numbered("traj_") {
        Ok(Format::ManiSkill)
    } else if aloha::is_episode(path) && groups.iter().any(|name| name == "observations") {
        Err(Error::bad_input(
            "this is one episode of a data set like those of ALOHA; wanted the folder of all",
        ))
    } else if is_numbered("episode_") {
        Ok(Format::MinariHdf5)
    } else {
        // Its reader says what is missing.
        Ok(Format::D4rl)
    }
}

fn of_npz(names: &[String]) -> Result<Format> {
    let has = |wanted: &str| names.iter().any(|name| name == wanted);
    if has("acts") {
        Ok(Format::ImitationNpz)
    } else if has("acs") {
        Ok(Format::BaselinesNpz)
    } else if has("episode_starts") {
        Ok(Format::StableBaselinesNpz)
    } else {
        Err(Error::bad_input(format!(
            "this npz file holds neither 'acs' (baselines) nor 'acts' (imitation) nor 'episode_starts' (stable-baselines); it \
             holds: {}",
            listed(names)
        ))
        .with_hint(match [("observations", "terminals"), ("observations", "timeouts"), ("states", "dones")]
            .into_iter()
            .find(|(observed, ends)| has("actions") && has(observed) && has(ends))
        {
            Some((observed, ends)) => format!(
                "in Python: import h5py, numpy as np; d = np.load(\"IN.npz\"); f = h5py.File(\"OUT.hdf5\", \"w\"); \
                 f[\"observations\"], f[\"actions\"], f[\"timeouts\"] = d[\"{observed}\"], d[\"actions\"], \
                 d[\"{ends}\"].astype(bool); f.close()"
            ),
            None => "docs/formats.md shows in ten lines how arrays become a file that is read".to_owned(),
        }))
    }
}
