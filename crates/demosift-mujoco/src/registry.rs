//! The tasks that come with demosift, and the way to a user's own.

use std::path::{Path, PathBuf};

use demosift::basics::files;
use demosift::{Error, Result};

use crate::mujoco_task::{MakeShaping, MujocoTask};
use crate::names::unknown;
use crate::{include, tasks};

/// A task that is part of the program, so that an installed binary needs no files beside it.
struct BuiltIn {
    name: &'static str,
    task_file: &'static str,
    /// File names and MJCF; an included file has the path by which the model includes it.
    models: &'static [(&'static str, &'static str)],
    shaping: Option<MakeShaping>,
}

/// A thrower, its ball and the hoop, whatever of it is observed.
const FREE_THROW: &[(&str, &str)] = &[
    ("free_throw.xml", include_str!("../tasks/free_throw/free_throw.xml")),
    ("court.xml", include_str!("../tasks/free_throw/court.xml")),
    ("thrower.xml", include_str!("../tasks/free_throw/thrower.xml")),
];

const BUILT_IN: &[BuiltIn] = &[
    BuiltIn {
        name: "free_throw",
        task_file: include_str!("../tasks/free_throw/task.toml"),
        models: FREE_THROW,
        shaping: Some(tasks::free_throw::shaping),
    },
    BuiltIn {
        name: "free_throw_taller",
        task_file: include_str!("../tasks/free_throw/taller.toml"),
        models: &[
            ("free_throw_taller.xml", include_str!("../tasks/free_throw/free_throw_taller.xml")),
            ("court.xml", include_str!("../tasks/free_throw/court.xml")),
            ("taller_thrower.xml", include_str!("../tasks/free_throw/taller_thrower.xml")),
        ],
        shaping: Some(tasks::free_throw::shaping),
    },
    BuiltIn {
        name: "free_throw_without_ball",
        task_file: include_str!("../tasks/free_throw/without_ball.toml"),
        models: FREE_THROW,
        shaping: Some(tasks::free_throw::shaping),
    },
    BuiltIn {
        name: "handstand",
        task_file: include_str!("../tasks/handstand/task.toml"),
        models: &[
            ("handstand.xml", include_str!("../tasks/handstand/handstand.xml")),
            ("../humanoid/humanoid.xml", include_str!("../tasks/humanoid/humanoid.xml")),
        ],
        shaping: None,
    },
    BuiltIn {
        name: "half_cheetah",
        task_file: include_str!("../tasks/half_cheetah/task.toml"),
        models: &[("half_cheetah.xml", include_str!("../tasks/half_cheetah/half_cheetah.xml"))],
        shaping: None,
    },
    BuiltIn {
        name: "walker2d",
        task_file: include_str!("../tasks/walker2d/task.toml"),
        models: &[("walker2d.xml", include_str!("../tasks/walker2d/walker2d.xml"))],
        shaping: None,
    },
    BuiltIn {
        name: "penalty_save",
        task_file: include_str!("../tasks/penalty_save/task.toml"),
        models: &[("penalty_save.xml", include_str!("../tasks/penalty_save/penalty_save.xml"))],
        shaping: Some(tasks::penalty_save::shaping),
    },
    BuiltIn {
        name: "martial_arts",
        task_file: include_str!("../tasks/martial_arts/task.toml"),
        models: &[
            ("martial_arts.xml", include_str!("../tasks/martial_arts/martial_arts.xml")),
            ("../humanoid/humanoid.xml", include_str!("../tasks/humanoid/humanoid.xml")),
        ],
        shaping: Some(tasks::martial_arts::shaping),
    },
];

/// Names of the tasks that come with demosift.
pub fn names() -> Vec<&'static str> {
    BUILT_IN.iter().map(|task| task.name).collect()
}

/// The task with this name, or the user's task at this path: a `task.toml`, or the folder that holds one.
///
/// # Errors
/// If it is neither (lists the names there are), or something in the task is wrong.
///
/// ```
/// use demosift::world::environment::Task;
/// use demosift_mujoco::registry;
///
/// let task = registry::load("half_cheetah")?;
/// assert_eq!((task.specification().observation_size, task.specification().action_size), (17, 6));
/// assert_eq!(task.heuristic().unit(), "m");
///
/// let error = registry::load("half_cheeta").err().expect("no such task, and no such folder");
/// assert!(error.is_bad_input() && error.to_string().contains("half_cheetah"), "{error}");
/// # Ok::<(), demosift::Error>(())
/// ```
pub fn load(name_or_path: &str) -> Result<MujocoTask> {
    if let Some(task) = BUILT_IN.iter().find(|task| task.name == name_or_path) {
        return MujocoTask::from_texts(task.task_file, task.models, task.shaping)
            .map_err(|error| error.during(task.name));
    }
    let path = Path::new(name_or_path);
    if path.exists() {
        files::check_is_plain(path)?;
        return MujocoTask::from_file(&task_file(path)?);
    }
    Err(Error::bad_input(format!(
        "{}; or give the path of a folder with a task.toml",
        unknown("task", name_or_path, &names())
    )))
}

/// The files that the user's task at this path is made of: the `task.toml`, its model, and what that includes, attaches and
/// takes meshes, height fields and textures from, in order of their absolute paths.
///
/// # Errors
/// As [`load`].
pub fn files(path: &Path) -> Result<Vec<PathBuf>> {
    let path = task_file(path)?;
    let mut files = include::files_of(&MujocoTask::model_file(&path)?)?;
    files.push(
        std::fs::canonicalize(&path).map_err(|error| Error::io("cannot find the task", &path, &error))?,
    );
    files.sort();
    Ok(files)
}

/// The `task.toml` that a path means.
fn task_file(path: &Path) -> Result<PathBuf> {
    if !path.is_dir() {
        return Ok(path.to_owned());
    }
    let file = path.join("task.toml");
    if !file.is_file() {
        return Err(Error::bad_input("this folder holds no task.toml, so it is not a task").at(path));
    }
    Ok(file)
}
