//! What the page plays: each demonstration, and the agent before and after imitating it; from the states of MuJoCo, or in
//! pictures of an environment in Python.

mod filmed;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use demosift::Result;
use demosift::data::demonstration::DemoId;
use demosift::data::trajectory::StateLog;
use demosift::results::panel::Judge;
use demosift::results::report::{self, Moment, Shown};
use demosift::run::experiment;
use demosift::world::environment::Task as _;
use demosift::world::heuristic::Score;
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::pictures::scene::{self, Scene};
use demosift_mujoco::replay::measurements;
use serde::Serialize;

use crate::job::Job;

/// Why there is no agent of a trainer in a replay.
const OF_TRAINER: &str =
    "Policies of your own trainer are not kept, so the agent that it trained is not shown.";

/// All poses of a page, before they are written as text, which is a third longer.
const MOST_BYTES: usize = 5_500_000;

/// The scene with its episodes.
#[derive(Serialize)]
pub(crate) struct Replay {
    scene: Option<Scene>,
    episodes: Vec<Episode>,
    /// Of an environment in Python.
    films: Vec<filmed::Film>,
    /// What is missing, and why.
    missing: Option<String>,
    /// Which demonstrations are looked at, by rank, where these are not all.
    pub(crate) demos: Option<Vec<DemoId>>,
}

/// What stands above an episode.
#[derive(Clone, Serialize)]
struct Caption {
    /// `demonstration`, `before` or `after`.
    part: &'static str,
    /// Whose agent it is.
    judge: Option<Judge>,
    demo: Option<usize>,
    variant: Option<usize>,
    steps: usize,
    score: Score,
    succeeded: Option<bool>,
}

#[derive(Serialize)]
struct Episode {
    #[serde(flatten)]
    caption: Caption,
    frames: usize,
    stride: usize,
    low: [f64; 3],
    high: [f64; 3],
    /// As [`scene::Motion`] has them, in base64.
    poses: String,
}

/// An episode before its poses are known.
struct Cast {
    caption: Caption,
    states: StateLog,
}

impl Replay {
    fn none(why: &str) -> Self {
        Self {
            scene: None,
            episodes: Vec::new(),
            films: Vec::new(),
            missing: Some(why.to_owned()),
            demos: None,
        }
    }
}

/// Plays the agent again and brings the demonstrations beside it, for these demonstrations.
pub(crate) fn of(job: &mut Job, demos: &[DemoId]) -> Result<Replay> {
    let is_all = demos.len() == job.set().len();
    let tried = tried(job, demos)?;
    let has_trainer = job.run(|run| Ok(run.config.judges.each().contains(&Judge::Trainer)))?;
    let missing = tried.missing.into_iter().chain(has_trainer.then(|| OF_TRAINER.to_owned()));
    let missing = missing.reduce(|one, other| format!("{one} {other}"));
    Ok(Replay { demos: (!is_all).then(|| demos.to_vec()), missing, ..tried })
}

fn tried(job: &mut Job, demos: &[DemoId]) -> Result<Replay> {
    let (mujoco, simulated) = (job.chosen().mujoco.clone(), job.chosen().simulated.as_ref());
    let replay = match (mujoco, simulated.map(|simulated| simulated.task.clone())) {
        (Some(task), _) => played(&task, job, demos),
        (None, Some(task)) => filmed::played(&task, job, demos),
        (None, None) => {
            return Ok(Replay::none("This task has no MuJoCo model, so there is nothing to draw."));
        }
    };
    match replay {
        // A replay that cannot be had is no reason to go without the report.
        Err(error) if !error.is_io() => Ok(Replay::none(&format!("There is no replay: {}", error.message()))),
        replay => replay,
    }
}

fn played(task: &MujocoTask, job: &mut Job, demos: &[DemoId]) -> Result<Replay> {
    let agent = agent(job, demos)?
        .into_iter()
        .filter_map(|of| Some(Cast { caption: of.caption(), states: of.shown.states? }));
    let recorded = job.states();
    let played =
        recorded.and_then(|recorded| demonstrations(task, job, demos, &recorded.unwrap_or_default()));
    let (mut cast, missing) = match played {
        Ok(cast) if cast.is_empty() => (
            cast,
            Some("The set holds no states of the simulator, so demonstrations are not shown.".to_owned()),
        ),
        Ok(cast) => (cast, None),
        Err(error) if !error.is_io() => {
            (Vec::new(), Some(format!("Demonstrations are not shown: {}", error.message())))
        }
        Err(error) => return Err(error),
    };
    cast.extend(agent);
    let scene = scene::scene(task)?;
    let steps = cast.iter().map(|cast| cast.caption.steps).sum();
    let stride = scene::stride(&scene, steps, MOST_BYTES);
    let episodes = cast.iter().map(|cast| episode(task, cast, stride)).collect::<Result<_>>()?;
    Ok(Replay { scene: Some(scene), episodes, films: Vec::new(), missing, demos: None })
}

/// The demonstrations whose states are known, with what they scored themselves.
fn demonstrations(
    task: &MujocoTask,
    job: &Job,
    demos: &[DemoId],
    recorded: &[StateLog],
) -> Result<Vec<Cast>> {
    let known = job
        .set()
        .iter()
        .filter(|(demo, _)| demos.contains(demo))
        .filter_map(|(demo, recording)| Some((recorded.get(demo.0)?.clone(), demo, recording)));
    let cast = known.map(|(states, demo, recording)| {
        let measured = measurements(task, &states, recording.actions())
            .map_err(|error| error.during(&format!("demonstration {demo}")))?;
        let caption = Caption {
            part: "demonstration",
            judge: None,
            demo: Some(demo.0),
            variant: None,
            steps: recording.steps(),
            score: task.heuristic().score(&measured),
            succeeded: task.succeeded(&measured),
        };
        Ok(Cast { caption, states })
    });
    cast.collect()
}

impl OfAgent {
    fn caption(&self) -> Caption {
        let Self { judge, shown } = self;
        let (part, demo) = match shown.moment {
            Moment::Before => ("before", None),
            Moment::After(demo) => ("after", Some(demo.0)),
        };
        Caption {
            part,
            judge: Some(*judge),
            demo,
            variant: Some(shown.variant.0),
            steps: shown.played.steps(),
            score: shown.score,
            succeeded: shown.succeeded,
        }
    }
}

/// An episode of the agent of one judge.
struct OfAgent {
    judge: Judge,
    shown: Shown,
}

/// What each judge's agent did before and after imitating each demonstration.
fn agent(job: &mut Job, demos: &[DemoId]) -> Result<Vec<OfAgent>> {
    job.run(|run| {
        let mut cast = Vec::new();
        for &judge in run.config.judges.each() {
            let judged = report::judged(run.ledger, judge)?;
            let (judging, seed) =
                (experiment::judging(run, judge), experiment::judging_seed(run.config, judge));
            let start = experiment::first_start(run, judge)?;
            let shown = report::agent_episodes(run.playground, &start, &judged, &judging, &seed, demos)?;
            cast.extend(shown.into_iter().map(|shown| OfAgent { judge, shown }));
        }
        Ok(cast)
    })
}

fn episode(task: &MujocoTask, cast: &Cast, stride: usize) -> Result<Episode> {
    let motion = scene::motion(task, &cast.states, cast.caption.steps, stride)?;
    Ok(Episode {
        caption: cast.caption.clone(),
        frames: motion.frames,
        stride: motion.stride,
        low: motion.low,
        high: motion.high,
        poses: STANDARD.encode(&motion.poses),
    })
}
