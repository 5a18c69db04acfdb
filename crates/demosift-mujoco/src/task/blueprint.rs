//! What the environments of a task share: its task file with every name looked up in its model.

use demosift::world::environment::Specification;
use demosift::world::fold::Fold;
use demosift::{Error, Result};

use crate::model::{Kind, Model};
use crate::task::columns::{self, column};
use crate::task::ends::Ends;
use crate::task::measurement::{self, Measurement};
use crate::task::observation::{self, Observed, Reading};
use crate::task::reset::Reset;
use crate::task::reward::{RewardShaping, Success, Term};
use crate::task::task_file::TaskFile;

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
    pub(crate) camera: Option<String>,
}

/// How an action in [−1, 1] becomes a control: middle + half_range · action.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Control {
    pub(crate) middle: f64,
    pub(crate) half_range: f64,
}

/// Looks up every name of a task file in its model.
///
/// # Errors
/// Of the first name or number that cannot be; says what would be right.
pub(crate) fn resolve(file: &TaskFile, model: Model) -> Result<Blueprint> {
    let horizon = horizon(file)?;
    let names: Vec<String> = file.measurements.keys().cloned().collect();
    let Observed { readings: observation, parts } =
        observation::resolve(&file.observation, &model).map_err(|error| error.during("observation"))?;
    let ends = Ends::resolve(&file.ends, &names).map_err(|error| error.during("ends"))?;
    let measurements = measurement::resolve(&file.measurements, &names, &model, &ends)?;
    let true_return = file.true_return.as_ref().map(|of| column(&of.measurement, &names)).transpose();
    let true_return = true_return.map_err(|error| error.during("return"))?;
    let control_step_secs = control_step_secs(file, &model)?;
    let terms = file.reward.iter().map(|term| Term::resolve(term, &names, control_step_secs));
    let terms = terms.collect::<Result<Vec<_>>>().map_err(|error| error.during("reward"))?;
    let heuristic = Fold::resolve(&file.heuristic, &columns::named(&names));
    let heuristic = heuristic.map_err(|error| error.during("heuristic"))?;
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
        is_control_step_told: true,
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

/// Steps of the physics that a control step may have.
const MOST_SKIPPED: u32 = 10_000;
/// Nobody acts less often; an agent that did would have no hold of what happens.
const LONGEST_CONTROL_STEP_SECS: f64 = 60.0;

fn control_step_secs(file: &TaskFile, model: &Model) -> Result<f64> {
    let (timestep, frame_skip) = (model.timestep_secs(), file.frame_skip.get());
    if !(timestep.is_finite() && timestep > 0.0) {
        return Err(Error::bad_config(format!(
            "the model's timestep is {timestep} s, and must be above 0: time would not go forward"
        ))
        .with_hint("set <option timestep=\"0.002\"/> in the model"));
    }
    if frame_skip > MOST_SKIPPED {
        return Err(Error::bad_config(format!(
            "frame_skip = {frame_skip}: must be at most {MOST_SKIPPED} steps of the physics"
        )));
    }
    let secs = timestep * f64::from(frame_skip);
    if secs > LONGEST_CONTROL_STEP_SECS {
        return Err(Error::bad_config(format!(
            "a control step takes {secs} s (frame_skip {frame_skip} times the model's timestep of {timestep} s), and must take \
             at most {LONGEST_CONTROL_STEP_SECS} s; most robots are controlled every 0.01 s to 0.1 s"
        )));
    }
    Ok(secs)
}

/// Whether a name can be that of a folder: what is found out about a variant is kept in one that is called like it.
fn check_folder_name(name: &str) -> Result<()> {
    let is_wrong = |letter: char| letter.is_control() || letter == '/' || letter == '\\';
    if name.is_empty() || name.len() > 100 || name.starts_with('.') || name.contains(is_wrong) {
        return Err(Error::bad_config(format!(
            "a variant is called '{name}', and must be called so that a folder can be: 1 to 100 letters, none of them a slash, \
             and no dot in front"
        )));
    }
    Ok(())
}

fn variant_names(file: &TaskFile) -> Result<Vec<String>> {
    let names: Vec<String> = file.variant.iter().map(|variant| variant.name.clone()).collect();
    for (index, name) in names.iter().enumerate() {
        check_folder_name(name)?;
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
