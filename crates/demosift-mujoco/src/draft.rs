//! A first `task.toml` for a model: what can be told from the model and from a set is filled in, and the rest is marked.

use demosift::basics::seed::Seed;
use demosift::data::demonstration::Demonstration;
use demosift::world::environment::Task as _;
use demosift::{Error, Result};

use crate::check::{self, Presented, Severity};
use crate::model::{Joint, Kind, Model};
use crate::mujoco_task::MujocoTask;

/// Seconds of a control step, where no set says its rate.
const CONTROL_STEP_SECS: f64 = 0.04;
/// Control steps of an episode, where no set says how many.
const HORIZON: usize = 100;

/// What a first task file is made for.
#[derive(Clone, Debug)]
pub struct Wanted<'a> {
    /// The name of the task.
    pub name: &'a str,
    /// The model file as the task file will name it.
    pub model_file: &'a str,
    /// Demonstrations that should fit it.
    pub set: Option<&'a [Demonstration]>,
    /// Their rate, where it is known.
    pub steps_per_sec: Option<f64>,
}

/// A first task file, which `demosift task check` accepts.
#[derive(Clone, Debug, PartialEq)]
pub struct Draft {
    /// The text of the `task.toml`.
    pub text: String,
    /// Whether it observes as many numbers as the set holds, and takes as many; `None` without a set.
    pub fits: Option<bool>,
}

/// An observation that a set may hold: as the task file says it, and in words.
struct Observed {
    parts: String,
    width: usize,
}

/// Something that a first heuristic may be about.
struct Measured {
    line: String,
    heuristic: &'static str,
    words: &'static str,
}

/// Writes a first task file.
///
/// # Errors
/// If an actuator of the model has no range, or nothing of it moves.
pub fn draft(model: &Model, wanted: &Wanted<'_>) -> Result<Draft> {
    let actions = model.control_ranges()?.len();
    let observed = observed(model, wanted)?;
    let sizes = wanted.set.and_then(|set| set.first());
    let fits =
        sizes.map(|one| (one.observations().width(), one.actions().width()) == (observed.width, actions));
    for measured in measured(model) {
        let text = text(model, wanted, &observed, &measured);
        let task = MujocoTask::from_model(&text, model.clone())?;
        let (_, findings) = check::play(&task, &Seed::new(0))?;
        if check::count(&findings, Severity::Error) == 0 {
            return Ok(Draft { text, fits });
        }
    }
    Err(Error::bad_input("no joint of the model moves under random actions, so there is nothing to measure")
        .with_hint("see whether its actuators have a gear and a ctrlrange that move something"))
}

/// What is observed: of what has as many numbers as the set, the first whose positions are within the joints' ranges.
fn observed(model: &Model, wanted: &Wanted<'_>) -> Result<Observed> {
    let joints = model.joints();
    let count = |of: fn(&Joint) -> usize| joints.iter().map(of).sum::<usize>();
    let (positions, velocities) = (count(|joint| joint.qpos.len()), count(|joint| joint.qvel.len()));
    let all = |parts: &str, width: usize| Observed { parts: parts.to_owned(), width };
    let mut candidates = vec![
        all("{ qpos = \"all\" }, { qvel = \"all\" }", positions + velocities),
        all("{ qpos = \"all\" }", positions),
        all("{ qvel = \"all\" }, { qpos = \"all\" }", positions + velocities),
    ];
    // Where a robot stands in the world is often left out.
    for hidden in 1..positions.min(4) {
        let parts = format!("{{ qpos = \"all[{hidden}:]\" }}, {{ qvel = \"all\" }}");
        candidates.push(all(&parts, positions - hidden + velocities));
    }
    for named in joints.iter().filter(|joint| joint.qpos.len() > 1 && joints.len() > 1) {
        let rest = format!("{{ except = [\"{}\"] }}", named.name);
        let (qpos, qvel) = (positions - named.qpos.len(), velocities - named.qvel.len());
        candidates.push(all(&format!("{{ qpos = {rest} }}, {{ qvel = {rest} }}"), qpos + qvel));
        candidates.push(all(&format!("{{ qpos = {rest} }}"), qpos));
    }
    let Some(set) = wanted.set.filter(|set| !set.is_empty()) else { return Ok(candidates.swap_remove(0)) };
    let width = set[0].observations().width();
    let right: Vec<usize> = (0..candidates.len()).filter(|at| candidates[*at].width == width).collect();
    let Some(first) = measured(model).into_iter().next() else { return Ok(candidates.swap_remove(0)) };
    let within = |at: &usize| -> Result<bool> {
        let text = text(model, wanted, &candidates[*at], &first);
        let task = MujocoTask::from_model(&text, model.clone())?;
        let findings = check::fit(task.specification(), Some(&task), &Presented::plain(set, None))?;
        // Units may be mended later; an order may not be guessed against the physics.
        Ok(check::count(&findings, Severity::Error) == 0)
    };
    for at in &right {
        if within(at)? {
            return Ok(candidates.swap_remove(*at));
        }
    }
    Ok(candidates.swap_remove(right.first().copied().unwrap_or(0)))
}

/// What a first heuristic may be about, the likeliest first.
fn measured(model: &Model) -> Vec<Measured> {
    let mut all = Vec::new();
    let sites: Vec<String> = model.names(Kind::Site).into_iter().flatten().collect();
    if let [.., other, last] = &sites[..] {
        all.push(Measured {
            line: format!("reach = {{ distance = [\"site:{last}\", \"site:{other}\"] }}"),
            heuristic: "fold = \"mean\"\nof = \"reach\"\nnegate = true   # near is good\nunit = \"m\"",
            words: "how near two sites of the model are",
        });
    }
    let axes = model.axes();
    // The first slide of a runner is the way that it has come, and the last joint of an arm is its wrist.
    let slides = axes.first().into_iter().filter(|axis| !axis.is_hinge);
    for axis in slides.chain(axes.iter().rev()) {
        all.push(Measured {
            line: format!("way = {{ qpos = \"{}\" }}", axis.name),
            heuristic: "fold = \"last_minus_first\"\nof = \"way\"",
            words: "how far a joint has come",
        });
    }
    all
}

fn text(model: &Model, wanted: &Wanted<'_>, observed: &Observed, measured: &Measured) -> String {
    let timestep = model.timestep_secs();
    let step_secs = wanted.steps_per_sec.map_or(CONTROL_STEP_SECS, |rate| 1.0 / rate);
    let skip = (step_secs / timestep).round().max(1.0);
    let horizon = wanted.set.and_then(|set| set.iter().map(Demonstration::steps).max()).unwrap_or(HORIZON);
    let (rate_of, length_of) = match (wanted.steps_per_sec, wanted.set) {
        (Some(_), _) => ("the rate of the set", "the longest episode of the set"),
        (None, Some(_)) => ("not said by the set: see that it is right", "the longest episode of the set"),
        (None, None) => ("see that it is right", "see that it is right"),
    };
    let key = model.names(Kind::Key).into_iter().flatten().next();
    let start = if key.is_some() { "the first keyframe" } else { "the model" };
    let keyframe = key.map_or(String::new(), |name| format!("keyframe = {}\n", toml::Value::from(name)));
    let other_size = wanted.set.and_then(|set| set.first()).map(|one| one.observations().width());
    let sizes = match other_size {
        Some(width) if width != observed.width => format!(
            "# The set holds {width} numbers in an observation, and this has {}: say what they are.\n",
            observed.width
        ),
        Some(_) => "# As many numbers as the set holds: see that they are the same.\n".to_owned(),
        None => String::new(),
    };
    format!(
        "# A first task file: what is marked with TODO says what you want, and no model can tell that.\n\
         # docs/task-file.md of demosift has the whole form.\n\
         name = \"{name}\"\n\
         model = \"{file}\"\n\
         frame_skip = {skip}   # steps of the physics of {timestep} s in a control step; {rate_of}\n\
         horizon = {horizon}   # control steps in an episode; {length_of}\n\n\
         # What the agent sees.\n{sizes}observation = [{parts}]\n\n\
         # How an episode starts: as {start} says, with a little noise.\n\
         [reset]\n{keyframe}qpos_noise = {{ uniform = 0.01 }}\nqvel_noise = {{ uniform = 0.01 }}\n\n\
         # TODO: what is measured at every step; here {words}.\n\
         [measurements]\n{line}\n\n\
         # TODO: how good an episode was; higher is better.\n\
         [heuristic]\n{heuristic}\n",
        name = wanted.name,
        file = wanted.model_file,
        parts = observed.parts,
        words = measured.words,
        line = measured.line,
        heuristic = measured.heuristic,
    )
}
