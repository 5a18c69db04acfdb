//! A task: `task.toml` and its model, every name looked up.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use demosift::math::rows::Rows;
use demosift::world::environment::{Environment, Specification, Task};
use demosift::world::heuristic::Heuristic;
use demosift::{Error, Result};

use crate::ends::Ends;
use crate::environment::MujocoEnvironment;
use crate::heuristic_fold::{Fold, column};
use crate::measurement::{self, Measurement};
use crate::model::{Kind, Model};
use crate::observation::{self, Observed, Reading};
use crate::reset::Reset;
use crate::reward::{RewardShaping, Success, Term};
use crate::task_file::TaskFile;

/// Makes the part of the task reward that is written in Rust, once the task's sizes and names are known.
pub type MakeShaping = fn(&Specification) -> Result<Box<dyn RewardShaping>>;

/// A task in MuJoCo; cheap to clone.
#[derive(Clone)]
pub struct MujocoTask(Arc<Blueprint>);

/// All that the environments of a task share.
pub(crate) struct Blueprint {
    pub(crate) specification: Specification,
    pub(crate) model: Model,
    pub(crate) frame_skip: u32,
    pub(crate) observation: Vec<Reading>,
    pub(crate) measurements: Vec<Measurement>,
    /// The columns of the measurements, each after those that it is made of.
    pub(crate) measuring_order: Vec<usize>,
    pub(crate) ends: Ends,
    pub(crate) controls: Vec<Control>,
    pub(crate) reset: Reset,
    pub(crate) terms: Vec<Term>,
    pub(crate) success: Option<Success>,
    pub(crate) shaping: Option<Box<dyn RewardShaping>>,
    pub(crate) heuristic: Fold,
    /// The column whose sum over the steps others would report.
    pub(crate) true_return: Option<usize>,
    camera: Option<String>,
}

/// How an action in [−1, 1] becomes a control: middle + half_range · action.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Control {
    pub(crate) middle: f64,
    pub(crate) half_range: f64,
}

impl MujocoTask {
    /// Reads a `task.toml` and the model that it names, which lies beside it.
    ///
    /// # Errors
    /// If a file is missing or wrong; says what, and what would have been right.
    pub fn from_file(path: &Path) -> Result<Self> {
        let text = read(path)?;
        Self::build(&text, |model| Model::from_file(&beside(path, model)), None)
            .map_err(|error| error.at(path))
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
    /// use demosift::world::environment::{EnvVariant, Task};
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
    /// let mut environment = task.environment()?;
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

    /// A new running instance, with the methods that only MuJoCo's environments have.
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

    /// The camera that shows the task best, if the model has cameras.
    pub fn camera(&self) -> Option<&str> {
        self.0.camera.as_deref()
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

    fn environment(&self) -> Result<Box<dyn Environment>> {
        Ok(Box::new(self.mujoco_environment()?))
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
    std::fs::read_to_string(task_file)
        .map_err(|error| Error::io("cannot read the task file", task_file, &error))
}

fn beside(task_file: &Path, model: &str) -> PathBuf {
    task_file.parent().unwrap_or(Path::new("")).join(model)
}

/// Control steps that an episode may have: beyond any that could be learned from, and few enough to be counted and kept.
const LONGEST: usize = 10_000_000;

fn horizon(file: &TaskFile) -> Result<usize> {
    match file.horizon.get() {
        horizon if horizon > LONGEST => {
            Err(Error::bad_config(format!("horizon = {horizon}: must be at most {LONGEST} control steps")))
        }
        horizon => Ok(horizon),
    }
}

fn resolve(file: &TaskFile, model: Model) -> Result<Blueprint> {
    let horizon = horizon(file)?;
    let names: Vec<String> = file.measurements.keys().cloned().collect();
    let Observed { readings: observation, parts } =
        observation::resolve(&file.observation, &model).map_err(|error| error.during("observation"))?;
    let ends = Ends::resolve(&file.ends, &names).map_err(|error| error.during("ends"))?;
    let measurements = measurement::resolve(&file.measurements, &names, &model, &ends)?;
    let true_return = file.true_return.as_ref().map(|of| column(&of.measurement, &names)).transpose();
    let true_return = true_return.map_err(|error| error.during("return"))?;
    let control_step_secs = model.timestep_secs() * f64::from(file.frame_skip.get());
    let terms = file.reward.iter().map(|term| Term::resolve(term, &names, control_step_secs));
    let terms = terms.collect::<Result<Vec<_>>>().map_err(|error| error.during("reward"))?;
    let heuristic = Fold::resolve(&file.heuristic, &names).map_err(|error| error.during("heuristic"))?;
    let success = file.success.as_ref().map(|success| Success::resolve(success, &names)).transpose();
    let success = success.map_err(|error| error.during("success"))?;
    let control_ranges = model.control_ranges()?;
    let controls: Vec<Control> = control_ranges
        .iter()
        .map(|[low, high]| Control { middle: 0.5 * (low + high), half_range: 0.5 * (high - low) })
        .collect();
    let specification = Specification {
        name: file.name.clone(),
        observation_size: observation.iter().map(Reading::width).sum(),
        observation_parts: parts,
        action_size: controls.len(),
        control_ranges,
        measurements: names,
        variants: variant_names(file)?,
        horizon,
        control_step_secs,
    };
    Ok(Blueprint {
        reset: Reset::resolve(file, &model)?,
        camera: camera(file, &model)?,
        specification,
        model,
        frame_skip: file.frame_skip.get(),
        observation,
        measuring_order: measurement::order(&measurements),
        measurements,
        ends,
        true_return,
        controls,
        terms,
        success,
        shaping: None,
        heuristic,
    })
}

fn variant_names(file: &TaskFile) -> Result<Vec<String>> {
    let names: Vec<String> = file.variant.iter().map(|variant| variant.name.clone()).collect();
    for (index, name) in names.iter().enumerate() {
        if names[..index].contains(name) {
            return Err(Error::bad_config(format!(
                "two variants are called '{name}'; each needs a name of its own"
            )));
        }
    }
    Ok(if names.is_empty() { vec!["default".to_owned()] } else { names })
}

fn camera(file: &TaskFile, model: &Model) -> Result<Option<String>> {
    match &file.camera {
        Some(name) => {
            model.id(Kind::Camera, name).map_err(|error| error.during("camera"))?;
            Ok(Some(name.clone()))
        }
        None => Ok(model.cameras().into_iter().next()),
    }
}
