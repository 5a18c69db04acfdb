//! Which task is meant: one that comes with demosift, or a user's own.

pub(crate) mod reels;
pub(crate) mod simulator;
pub(crate) mod trainer;

use std::path::Path;

use demosift::basics::files;
use demosift::math::rows::Rows;
use demosift::world::environment::{OneVariant, Task};
use demosift::world::point_mass::PointMass;
use demosift::world::rollout::Playground;
use demosift::{Error, Result};
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::{names, registry};

use crate::arguments::SimulatorArguments;
use crate::configuration::Layer;
use simulator::{Earlier, Simulated};

const POINT_MASS: &str = "point_mass";
/// Configuration values beside a user's task.toml.
const VALUES_FILE: &str = "config.toml";

/// Values that a task's name brings with it; see [`crate::configuration::preset`] for tables named after a preset.
const BUILT_IN_VALUES: [(&str, &str); 9] = [
    (POINT_MASS, include_str!("../../configs/point_mass.toml")),
    ("half_cheetah", include_str!("../../configs/half_cheetah.toml")),
    ("walker2d", include_str!("../../configs/walker2d.toml")),
    ("free_throw", include_str!("../../configs/free_throw.toml")),
    ("penalty_save", include_str!("../../configs/penalty_save.toml")),
    ("free_throw_without_ball", include_str!("../../configs/free_throw.toml")),
    ("free_throw_taller", include_str!("../../configs/free_throw_taller.toml")),
    ("handstand", include_str!("../../configs/handstand.toml")),
    ("martial_arts", include_str!("../../configs/martial_arts.toml")),
];

/// A task with what a run needs to know about where it comes from.
pub(crate) struct Chosen {
    pub(crate) task: Box<dyn Task>,
    /// The same, where it is one in MuJoCo: such a task can be replayed and looked at.
    pub(crate) mujoco: Option<MujocoTask>,
    /// As `--task` takes it, from any working directory.
    pub(crate) name: String,
    /// Hash of the files of a user's own task.
    pub(crate) sha256: Option<String>,
    /// Its one variant that is meant; without it all are.
    pub(crate) variant: Option<String>,
    /// The task's own configuration values.
    pub(crate) values: Layer,
    /// The same, where it is an environment in Python.
    pub(crate) simulated: Option<Simulated>,
}

/// Names of the tasks that come with demosift.
pub(crate) fn names() -> Vec<&'static str> {
    std::iter::once(POINT_MASS).chain(registry::names()).collect()
}

/// The task that `--task` names.
pub(crate) fn choose(name_or_path: &str) -> Result<Chosen> {
    let mujoco = match name_or_path {
        POINT_MASS => None,
        known if registry::names().contains(&known) => Some(registry::load(known)?),
        path if Path::new(path).exists() => return users_own(Path::new(path)),
        other => return Err(unknown(other)),
    };
    let text = BUILT_IN_VALUES.iter().find(|(name, _)| *name == name_or_path).map_or("", |(_, text)| text);
    let values = Layer::from_text(&format!("configs/{name_or_path}.toml"), text)?;
    Ok(Chosen {
        task: playable(mujoco.as_ref()),
        mujoco,
        name: name_or_path.to_owned(),
        sha256: None,
        variant: None,
        values,
        simulated: None,
    })
}

/// Whether a file holds MJCF in place of the words of a task.
fn is_model(path: &Path) -> bool {
    if !path.is_file() {
        return false;
    }
    let is_xml = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xml"));
    is_xml || std::fs::read(path).is_ok_and(|bytes| bytes.trim_ascii_start().starts_with(b"<"))
}

/// An environment in Python as a task.
pub(crate) fn in_python(simulated: Simulated) -> Result<Chosen> {
    let task = simulated.task.clone();
    let files = task.files();
    Ok(Chosen {
        mujoco: None,
        name: task.source().words(),
        sha256: if files.is_empty() { None } else { Some(files::sha256(&files)?) },
        variant: None,
        values: Layer::from_text("the values of an environment", "")?,
        task: Box::new(task),
        simulated: Some(simulated),
    })
}

/// The task that a run was about, by its name, or its environment.
pub(crate) fn of_run(name: &str, environment: Option<Earlier<'_>>) -> Result<Chosen> {
    match simulator::open(&SimulatorArguments::default(), None, environment, false)? {
        Some(simulated) => in_python(simulated),
        None => choose(name),
    }
}

/// The task as those see it who only play it; the one task without MuJoCo is the point mass.
fn playable(mujoco: Option<&MujocoTask>) -> Box<dyn Task> {
    match mujoco {
        Some(task) => Box::new(task.clone()),
        None => Box::new(PointMass::new()),
    }
}

/// A task of the user's own: a `task.toml`, or the folder that holds one, and perhaps values of its own beside it.
fn users_own(path: &Path) -> Result<Chosen> {
    let absolute =
        std::fs::canonicalize(path).map_err(|error| Error::io("cannot find the task", path, &error))?;
    let name = absolute.to_str().ok_or_else(|| Error::bad_input("the path is not UTF-8").at(path))?;
    if is_model(&absolute) {
        return Err(Error::bad_input(
            "this is a MuJoCo model, and a task is a folder with a task.toml beside its model",
        )
        .at(path)
        .with_hint("`demosift task new` writes such a folder from a model"));
    }
    let task = registry::load(name)?;
    let folder = if absolute.is_dir() { absolute.as_path() } else { absolute.parent().unwrap_or(&absolute) };
    let values_file = Some(folder.join(VALUES_FILE)).filter(|path| path.exists());
    let values = match &values_file {
        Some(path) => Layer::from_file(path)?,
        None => Layer::from_text(VALUES_FILE, "")?,
    };
    let mujoco = Some(task);
    let sha256 = Some(hash_of(&absolute, values_file.as_deref())?);
    Ok(Chosen {
        task: playable(mujoco.as_ref()),
        mujoco,
        name: name.to_owned(),
        sha256,
        variant: None,
        values,
        simulated: None,
    })
}

impl Chosen {
    /// Where it is played.
    pub(crate) fn playground(&self) -> Result<Playground<'_>> {
        match &self.simulated {
            Some(simulated) => simulated.playground(),
            None => Ok(Playground::new(self.task.as_ref())),
        }
    }

    /// Actions of a policy `[T, act]` as they are recorded: in the environment's own unit, and clipped, where it has one.
    pub(crate) fn recorded_actions(&self, actions: &Rows) -> Result<Rows> {
        match &self.simulated {
            Some(simulated) => simulated.task.units().own_rows(actions),
            None => Ok(actions.clone()),
        }
    }

    /// The same task, but only the goal of this name; a task of a single goal is that already.
    pub(crate) fn under(self, variant: &str) -> Result<Self> {
        let variants = &self.task.specification().variants;
        if variants.len() == 1 {
            return match variants[0] == variant {
                true => Ok(self),
                false => Err(Error::bad_input(format!(
                    "there is no variant '{variant}', as the task '{}' has a single goal",
                    self.name
                ))
                .with_hint("leave --variant away")),
            };
        }
        let task = Box::new(OneVariant::new(self.task, variant)?);
        Ok(Self { task, variant: Some(variant.to_owned()), ..self })
    }
}

/// Hash of the files that the task reads, and of its configuration values; what else lies beside them changes nothing.
fn hash_of(task: &Path, values: Option<&Path>) -> Result<String> {
    let mut paths = registry::files(task)?;
    paths.extend(values.map(Path::to_owned));
    paths.sort();
    paths.dedup();
    files::sha256(&paths)
}

/// No task was named.
pub(crate) fn missing() -> Error {
    Error::bad_input("no task is given").with_hint(format!(
        "add --task NAME, where NAME is one of {}, or the path of a folder that holds a task.toml; or --env for an environment \
         in Python",
        names().join(", ")
    ))
}

fn unknown(name: &str) -> Error {
    if name.contains(std::path::MAIN_SEPARATOR) {
        return Error::bad_input("there is no such file or folder, so it is no task").at(Path::new(name));
    }
    Error::bad_input(names::unknown("task", name, &names()))
        .with_hint("or give the path of a folder that holds a task.toml")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use demosift::run::experiment::Config;
    use demosift::run::preset::Preset;

    use super::*;
    use crate::configuration;

    const TASK: &str = "name = 'cart'\nmodel = 'cart.xml'\nframe_skip = 1\nhorizon = 2\nobservation = ['phase']\n\
        measurements = { x = { qpos = 'slider' } }\nheuristic = { fold = 'max', of = 'x' }\n";
    const CART: &str = "<mujocoinclude><worldbody><body name='cart'><joint name='slider' type='slide'/>\
        <geom name='box' size='0.1'/></body></worldbody>\
        <actuator><motor name='push' joint='slider' ctrlrange='-1 1'/></actuator></mujocoinclude>";

    #[test]
    fn appendix_a_2_1_the_preset_of_the_paper_has_its_schedule_of_alpha() {
        for (name, wanted) in [
            ("free_throw", [1.0, 0.5]),
            ("penalty_save", [1.0, 0.5]),
            ("handstand", [2.0, 0.5]),
            ("martial_arts", [2.0, 0.5]),
        ] {
            let values = configuration::preset(Preset::Paper, choose(name).unwrap().values).unwrap();
            let config: Config = configuration::typed(configuration::of_job(values)).unwrap();
            assert_eq!(config.inner.alphas, wanted, "{name}");
        }
    }

    #[test]
    fn the_hash_counts_what_the_task_reads_and_nothing_else_that_lies_there() {
        let folder = std::env::temp_dir().join(format!("demosift-task-hash-of-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
        let cart = CART.replace("mujocoinclude", "mujoco");
        let values = "[inner]\nbatch_steps = 120\n";
        write("task.toml", TASK);
        write("cart.xml", &cart);
        let hash = || choose(folder.to_str().unwrap()).unwrap().sha256.unwrap();
        assert_eq!(hash(), files::sha256_of(format!("{cart}{TASK}").as_bytes()), "as it always was");
        let alone = hash();
        write("pyproject.toml", "[project]\n");
        write("scene.xml", "<mujoco/>");
        // As an editor locks a file that it changes.
        #[cfg(unix)]
        std::os::unix::fs::symlink("user@host.1234", folder.join(".#task.toml")).unwrap();
        assert_eq!(hash(), alone);
        write(VALUES_FILE, values);
        assert_eq!(hash(), files::sha256_of(format!("{cart}{values}{TASK}").as_bytes()));
        write("task.toml", &TASK.replace("horizon = 2", "horizon = 3"));
        assert_ne!(hash(), files::sha256_of(format!("{cart}{values}{TASK}").as_bytes()));
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn the_hash_counts_what_a_model_includes_from_another_folder() {
        let root = std::env::temp_dir().join(format!("demosift-task-hash-{}", std::process::id()));
        let (task, robot) = (root.join("task"), root.join("robot"));
        [&task, &robot].into_iter().for_each(|folder| std::fs::create_dir_all(folder).unwrap());
        std::fs::write(task.join("task.toml"), TASK).unwrap();
        std::fs::write(task.join("cart.xml"), "<mujoco><include file='../robot/cart.xml'/></mujoco>")
            .unwrap();
        let hash_with = |cart: String| {
            std::fs::write(robot.join("cart.xml"), cart).unwrap();
            choose(task.to_str().unwrap()).unwrap().sha256.unwrap()
        };
        let before = hash_with(CART.to_owned());
        assert_ne!(before, hash_with(CART.replace("0.1", "0.2")));
        assert_eq!(before, hash_with(CART.to_owned()));
        std::fs::remove_dir_all(&root).unwrap();
    }
}
