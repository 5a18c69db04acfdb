//! Which task is meant: one that comes with demosift, or a user's own.

use std::path::Path;

use demosift::environment::Task;
use demosift::point_mass::PointMass;
use demosift::{Error, Result, files};
use demosift_mujoco::registry;

use crate::configuration::Layer;

const POINT_MASS: &str = "point_mass";
/// Configuration values beside a user's task.toml.
const VALUES_FILE: &str = "config.toml";

/// Values that a task's name brings with it; see [`crate::configuration::preset`] for tables named after a preset.
const BUILT_IN_VALUES: [(&str, &str); 4] = [
    (POINT_MASS, include_str!("../../../configs/point_mass.toml")),
    ("half_cheetah", include_str!("../../../configs/half_cheetah.toml")),
    ("free_throw", include_str!("../../../configs/free_throw.toml")),
    ("free_throw_taller", include_str!("../../../configs/free_throw_taller.toml")),
];

/// A task with what a run needs to know about where it comes from.
pub(crate) struct Chosen {
    pub(crate) task: Box<dyn Task>,
    /// As `--task` takes it, from any working directory.
    pub(crate) name: String,
    /// Hash of the files of a user's own task.
    pub(crate) sha256: Option<String>,
    /// The task's own configuration values.
    pub(crate) values: Layer,
}

/// Names of the tasks that come with demosift.
pub(crate) fn names() -> Vec<&'static str> {
    std::iter::once(POINT_MASS).chain(registry::names()).collect()
}

/// The task that `--task` names.
pub(crate) fn choose(name_or_path: &str) -> Result<Chosen> {
    let task: Box<dyn Task> = match name_or_path {
        POINT_MASS => Box::new(PointMass::new()),
        known if registry::names().contains(&known) => Box::new(registry::load(known)?),
        path if Path::new(path).exists() => return users_own(Path::new(path)),
        other => return Err(unknown(other)),
    };
    let text = BUILT_IN_VALUES.iter().find(|(name, _)| *name == name_or_path).map_or("", |(_, text)| text);
    let values = Layer::from_text(&format!("configs/{name_or_path}.toml"), text)?;
    Ok(Chosen { task, name: name_or_path.to_owned(), sha256: None, values })
}

/// A task of the user's own: a `task.toml`, or the folder that holds one, and perhaps values of its own beside it.
fn users_own(path: &Path) -> Result<Chosen> {
    let absolute =
        std::fs::canonicalize(path).map_err(|error| Error::io("cannot find the task", path, &error))?;
    let name = absolute.to_str().ok_or_else(|| Error::bad_input("the path is not UTF-8").at(path))?;
    let task = registry::load(name)?;
    let folder = if absolute.is_dir() { absolute.as_path() } else { absolute.parent().unwrap_or(&absolute) };
    let values_file = folder.join(VALUES_FILE);
    let values = if values_file.exists() {
        Layer::from_file(&values_file)?
    } else {
        Layer::from_text(VALUES_FILE, "")?
    };
    Ok(Chosen { task: Box::new(task), name: name.to_owned(), sha256: Some(hash_of(folder)?), values })
}

/// Hash of the task file and the models beside it.
fn hash_of(folder: &Path) -> Result<String> {
    let failed = |error: std::io::Error| Error::io("cannot look into the task's folder", folder, &error);
    let mut paths = std::fs::read_dir(folder)
        .and_then(|entries| {
            entries.map(|entry| entry.map(|entry| entry.path())).collect::<std::io::Result<Vec<_>>>()
        })
        .map_err(failed)?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "xml" || extension == "toml"));
    paths.sort();
    files::sha256(&paths)
}

/// No task was named.
pub(crate) fn missing() -> Error {
    Error::bad_input("no task is given").with_hint(format!(
        "add --task NAME, where NAME is one of {}, or the path of a folder that holds a task.toml",
        names().join(", ")
    ))
}

fn unknown(name: &str) -> Error {
    Error::bad_input(format!("no task is called '{name}'; there are: {}", names().join(", ")))
        .with_hint("or give the path of a folder that holds a task.toml")
}
