//! A task in MuJoCo, as the library sees it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use demosift::Result;
use demosift::basics::files;
use demosift::data::demonstration::pointer;
use demosift::math::rows::Rows;
use demosift::world::environment::{Specification, Stepped, Task, Worker};
use demosift::world::heuristic::Heuristic;

use crate::environment::MujocoEnvironment;
use crate::include;
use crate::model::Model;
use crate::task::blueprint::{Blueprint, resolve};
use crate::task::observation::{Number, Reading};
use crate::task::reward::RewardShaping;
use crate::task::task_file::TaskFile;

/// Makes the part of the task reward that is written in Rust, once the task's sizes and names are known.
pub type MakeShaping = fn(&Specification) -> Result<Box<dyn RewardShaping>>;

/// A task in MuJoCo; cheap to clone.
#[derive(Clone)]
pub struct MujocoTask(Arc<Blueprint>);

impl MujocoTask {
    /// Reads a `task.toml` and the model that it names, which lies beside it.
    ///
    /// # Errors
    /// If a file is missing or wrong; says what, and what would have been right.
    pub fn from_file(path: &Path) -> Result<Self> {
        let text = read(path)?;
        let load = |model: &str| {
            let model = beside(path, model);
            if !model.is_file() {
                let hint = "`model` is relative to the folder of its task.toml";
                return Model::from_file(&model).map_err(|error| error.with_hint(hint));
            }
            include::files_of(&model)?;
            Model::from_file(&model)
        };
        Self::build(&text, load, None).map_err(|error| error.at(path))
    }

    /// The model that a `task.toml` names.
    ///
    /// # Errors
    /// If the task file is missing or wrong.
    pub(crate) fn model_file(path: &Path) -> Result<PathBuf> {
        let file = TaskFile::parse(&read(path)?).map_err(|error| error.at(path))?;
        Ok(beside(path, &file.model))
    }

    /// Takes the text of a `task.toml` and of its `models`, pairs of file name and MJCF.
    ///
    /// # Errors
    /// As [`MujocoTask::from_file`].
    ///
    /// ```
    /// use demosift::basics::seed::Seed;
    /// use demosift::math::rows::Rows;
    /// use demosift::world::environment::{EnvVariant, Environment, Task};
    /// use demosift_mujoco::mujoco_task::MujocoTask;
    ///
    /// let cart = r#"
    ///     <mujoco>
    ///       <worldbody>
    ///         <body name="cart">
    ///           <joint name="slider" type="slide" axis="1 0 0" damping="0.1"/>
    ///           <geom name="box" size="0.1"/>
    ///         </body>
    ///       </worldbody>
    ///       <actuator><motor name="push" joint="slider" ctrllimited="true" ctrlrange="-2 2"/></actuator>
    ///     </mujoco>"#;
    /// let task_file = r#"
    ///     name = "cart"
    ///     model = "cart.xml"
    ///     frame_skip = 5
    ///     horizon = 40
    ///     observation = [{ qpos = "all" }, { qvel = "all" }]
    ///
    ///     [measurements]
    ///     x = { qpos = "slider" }
    ///
    ///     [heuristic]
    ///     fold = "max"
    ///     of = "x"
    ///     unit = "m"
    /// "#;
    /// let task = MujocoTask::from_texts(task_file, &[("cart.xml", cart)], None)?;
    /// assert_eq!(task.specification().control_ranges, [[-2.0, 2.0]]); // what −1 and 1 mean
    ///
    /// // Pushed with all its force the cart goes east; the score is how far it came.
    /// let mut environment = task.mujoco_environment()?;
    /// let (mut observation, mut measurements) = ([0.0; 2], [0.0; 1]);
    /// environment.reset(EnvVariant(0), Seed::new(1), &mut observation, &mut measurements);
    /// let mut measured = Rows::with_capacity(1, 41);
    /// measured.push(&measurements);
    /// for _ in 0..task.specification().horizon {
    ///     environment.step(&[1.0], &mut observation, &mut measurements);
    ///     measured.push(&measurements);
    /// }
    /// let score = task.heuristic().score(&measured);
    /// assert!(score > 0.0 && score == f64::from(observation[0]), "{score} m");
    ///
    /// // A name that is not in the model is an error that lists those that are.
    /// let wrong = task_file.replace("\"slider\"", "\"slide\"");
    /// let error = MujocoTask::from_texts(&wrong, &[("cart.xml", cart)], None).err().expect("a wrong name");
    /// assert!(error.is_bad_config() && error.to_string().contains("slider"), "{error}");
    /// # Ok::<(), demosift::Error>(())
    /// ```
    pub fn from_texts(
        task_file: &str,
        models: &[(&str, &str)],
        shaping: Option<MakeShaping>,
    ) -> Result<Self> {
        Self::build(task_file, |model| Model::from_texts(model, models), shaping)
    }

    /// Takes the text of a `task.toml` and a model that is loaded already.
    ///
    /// # Errors
    /// As [`MujocoTask::from_file`].
    pub(crate) fn from_model(task_file: &str, model: Model) -> Result<Self> {
        Self::build(task_file, |_| Ok(model), None)
    }

    fn build(
        text: &str,
        load: impl FnOnce(&str) -> Result<Model>,
        shaping: Option<MakeShaping>,
    ) -> Result<Self> {
        let file = TaskFile::parse(text)?;
        let model = load(&file.model)?;
        let mut blueprint = resolve(&file, model)?;
        blueprint.shaping = shaping.map(|make| make(&blueprint.specification)).transpose()?;
        Ok(Self(Arc::new(blueprint)))
    }

    /// A new running instance, to be stepped by hand.
    ///
    /// # Errors
    /// If MuJoCo has no memory for it.
    pub fn mujoco_environment(&self) -> Result<MujocoEnvironment> {
        MujocoEnvironment::new(self.0.clone())
    }

    pub(crate) fn blueprint(&self) -> &Blueprint {
        &self.0
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.0.model
    }

    /// The range of the joint whose position each observed number is, `[obs]`; `None` for any other number and where the
    /// model sets no limits.
    pub fn observation_ranges(&self) -> Vec<Option<[f64; 2]>> {
        let axes = self.0.model.axes();
        let of = |number: &Number| axes.iter().find(|axis| *number == Number::Position(axis.qpos));
        self.0.observation.iter().flat_map(Reading::numbers).map(|number| of(&number)?.range).collect()
    }

    /// The camera that shows the task best, if the model has cameras.
    pub fn camera(&self) -> Option<&str> {
        self.0.camera.as_deref()
    }

    /// Whether the task says on what reward a demonstrator is trained.
    pub fn has_reward(&self) -> bool {
        let blueprint = &self.0;
        let pays = blueprint.success.as_ref().is_some_and(|success| success.reward != 0.0);
        pays || !blueprint.terms.is_empty() || blueprint.shaping.is_some()
    }

    /// Steps of the physics in a control step.
    pub fn frame_skip(&self) -> u32 {
        self.0.frame_skip
    }
}

impl Task for MujocoTask {
    fn specification(&self) -> &Specification {
        &self.0.specification
    }

    fn worker(&self) -> Result<Box<dyn Worker>> {
        Ok(Box::new(Stepped::new(self.mujoco_environment()?, self.specification())))
    }

    fn heuristic(&self) -> &dyn Heuristic {
        &self.0.heuristic
    }

    fn succeeded(&self, measurements: &Rows) -> Option<bool> {
        let success = self.0.success.as_ref()?;
        Some(success.bound.holds(success.fold.over(measurements)))
    }

    fn true_return(&self, measurements: &Rows) -> Option<f64> {
        let column = self.0.true_return?;
        // The first row is that of the reset, to which no step led.
        Some(measurements.iter().skip(1).map(|row| f64::from(row[column])).sum())
    }

    fn may_end_early(&self) -> bool {
        !self.0.ends.is_empty()
    }
}

fn read(task_file: &Path) -> Result<String> {
    pointer::refuse(task_file)?;
    files::read_text(task_file, "the task file")
}

fn beside(task_file: &Path, model: &str) -> PathBuf {
    task_file.parent().unwrap_or(Path::new("")).join(model)
}
