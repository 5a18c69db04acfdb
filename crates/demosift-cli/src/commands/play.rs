//! `demosift play`: a look at what a policy does, or at what a demonstration did.

use std::path::{Path, PathBuf};

use demosift::basics::files;
use demosift::basics::seed::Seed;
use demosift::data::demonstration::{self, DemoId, DemonstrationSet};
use demosift::data::trajectory::StateLog;
use demosift::math::rows::Rows;
use demosift::results::artifact;
use demosift::world::environment::{EnvVariant, Episode as Asked, Rollout, Specification};
use demosift::world::heuristic::Score;
use demosift::world::policy::Policy;
use demosift::world::rollout::{self, Acting};
use demosift::{Error, Result};
use demosift_gymnasium::pictures::Reel;
use demosift_gymnasium::replay as replay_in_env;
use demosift_gymnasium::task::GymnasiumTask;
use demosift_gymnasium::trial::Repeats;
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::pictures::film::{self, Film, OfStates, Recorded, Take, Wanted};
use demosift_mujoco::pictures::render::Viewpoint;
use demosift_mujoco::replay;

use crate::answers;
use crate::arguments::{PictureArguments, PlayArguments, SetArguments};
use crate::console::terminal::{self, Progress};
use crate::files::picture_folder::PictureFolder;
use crate::job::as_recorded::AsRecorded;
use crate::job::demonstrations::{self, Demonstrations};
use crate::job::identity::Identity;
use crate::job::request;
use crate::job::run_folder;
use crate::tables::{self, Scale};
use crate::task::reels;
use crate::task::simulator::{self, Simulated};
use crate::task::{self, Chosen};

/// One episode, played or replayed.
struct Episode {
    /// Such as `demonstration 4`.
    name: String,
    steps: usize,
    score: Score,
    succeeded: Option<bool>,
    /// What pictures are made of; a task without a simulator has nothing.
    seen: Option<Seen>,
}

/// What pictures of an episode are made of.
enum Seen {
    /// The states of MuJoCo, one per step.
    States(StateLog),
    /// An episode of an environment in Python, which is played again.
    Reel(Box<Reel>),
}

pub(crate) fn run(arguments: &PlayArguments) -> Result<()> {
    let chosen = choose(arguments)?;
    let beside = beside(arguments.policy.as_deref(), &chosen);
    let studio = Studio::open(&chosen, &arguments.pictures, beside)?;
    let episodes = match (&arguments.policy, &arguments.data) {
        (Some(policy), _) => play(&chosen, policy, arguments)?,
        (None, Some(data)) => replay(&chosen, data, arguments)?,
        (None, None) => return Err(Error::bad_config("wanted --policy or --data")),
    };
    let unit = chosen.task.heuristic().unit();
    let folder = studio.map(|studio| studio.film(&episodes, unit)).transpose()?;
    if arguments.json {
        let row = |episode: &'_ Episode| answers::Episode {
            episode: episode.name.clone(),
            steps: episode.steps,
            score: episode.score,
            succeeded: episode.succeeded,
        };
        let episodes = episodes.iter().map(row).collect();
        terminal::show_json(&answers::Play { episodes, unit, pictures: folder.as_deref() });
        return Ok(());
    }
    terminal::show(&table(&episodes, unit));
    if let Some(folder) = folder {
        terminal::show(&format!("\nPictures: {}\n", folder.display()));
    }
    Ok(())
}

/// The task that is named, or that of the run which the policy lies in the folder of.
fn choose(arguments: &PlayArguments) -> Result<Chosen> {
    let of_run = |policy| Some((policy, run_folder::of_finished(Path::parent(policy)?).ok()?.0));
    let Some((policy, identity)) = arguments.policy.as_deref().and_then(of_run) else {
        return choose_by(arguments, None);
    };
    let chosen = choose_by(arguments, Some(&identity).filter(|_| arguments.task.is_none()))?;
    let is_named = arguments.task.is_some() || arguments.simulator.names_files();
    match identity.check_unchanged(&chosen).map_err(|error| error.at(policy)) {
        Err(error) if !is_named => {
            let option = if identity.simulator.is_some() { "--env" } else { "--task" };
            let hint = format!("{option} {} plays it in the task as it is now", identity.task);
            Err(error.with_hint(hint))
        }
        // Who names another task wants another one.
        Err(error) if arguments.task.is_some() && identity.task == chosen.name => {
            terminal::note(&error.to_string());
            Ok(chosen)
        }
        _ => Ok(chosen),
    }
}

/// The task that is named, or that of the run where none is.
fn choose_by(arguments: &PlayArguments, run: Option<&Identity>) -> Result<Chosen> {
    let environment = run.and_then(Identity::environment);
    let set = simulator::naming(arguments.data.as_deref(), None, None);
    if let Some(simulated) = simulator::open(&arguments.simulator, set, environment, false)? {
        return task::in_python(simulated);
    }
    let name = arguments.task.as_ref().or(run.map(|identity| &identity.task));
    task::choose(name.ok_or_else(task::missing)?)
}

/// Episodes of a policy, each from a seed of its own.
fn play(chosen: &Chosen, path: &Path, arguments: &PlayArguments) -> Result<Vec<Episode>> {
    let playground = chosen.playground()?;
    let policy = read_policy(path, playground.specification())?;
    let variant = match arguments.variant.clone().or_else(|| trained_under(path, chosen)) {
        Some(name) => playground.specification().variant(&name)?,
        None => EnvVariant(0),
    };
    if arguments.episodes == 0 {
        return Err(Error::bad_config("--episodes 0: must be at least 1"));
    }
    let acting = if arguments.sampled { Acting::Sampled } else { Acting::Mean };
    let seeds = Seed::new(arguments.seed).of("play").many(arguments.episodes);
    let policy = &policy;
    let asked = seeds.iter().map(|seed| Asked { policy, acting, variant, seed, keep_states: true });
    let played = rollout::play_episodes(&playground, &asked.collect::<Vec<_>>())?;
    let played = played.into_iter().zip(&seeds).enumerate();
    let episodes = played.map(|(number, (Rollout { trajectory, states }, seed))| Episode {
        name: format!("episode {number}"),
        steps: trajectory.steps(),
        score: playground.score(&trajectory),
        succeeded: playground.task().succeeded(trajectory.measurements()),
        seen: match &chosen.simulated {
            Some(Simulated { task, .. }) => {
                Some(Seen::Reel(Box::new(Reel::of_episode(task, seed, &trajectory))))
            }
            None => states.map(Seen::States),
        },
    });
    Ok(episodes.collect())
}

/// The run folder that a policy lies in; of others, and of demonstrations, that which a run with this task would have.
fn beside(policy: Option<&Path>, chosen: &Chosen) -> PathBuf {
    // The folder that one stands in has no name in the path.
    let named = |folder: &Path| match folder.file_name() {
        Some(_) => Some(folder.to_owned()),
        None => Path::new(".").join(folder).canonicalize().ok(),
    };
    let of_run = policy.and_then(Path::parent).filter(|folder| run_folder::is_one(folder)).and_then(named);
    of_run.unwrap_or_else(|| request::default_folder(&chosen.name, None))
}

/// The one goal of the run that a policy lies in the folder of, if that was about one goal of this task.
fn trained_under(policy: &Path, chosen: &Chosen) -> Option<String> {
    let (identity, _) = run_folder::of_finished(policy.parent()?).ok()?;
    identity.variant.filter(|_| identity.task == chosen.name)
}

/// A policy of a run folder, if it fits the task.
pub(crate) fn read_policy(path: &Path, specification: &Specification) -> Result<Policy> {
    if !path.exists() {
        return Err(Error::bad_input("the policy does not exist").at(path).with_hint("check the path"));
    }
    let bytes = files::read(path)?;
    let policy = artifact::read_policy(&bytes, "the policy").map_err(|error| error.at(path))?;
    let found = (policy.filter().observation_size(), policy.action_size());
    let wanted = (specification.observation_size, specification.action_size);
    if found != wanted {
        return Err(Error::bad_input(format!(
            "the policy maps {} observations to {} actions, and the task '{}' has {} and {}",
            found.0, found.1, specification.name, wanted.0, wanted.1
        ))
        .at(path));
    }
    Ok(policy)
}

/// Demonstrations as they were recorded, in the order in which they are named.
fn replay(chosen: &Chosen, data: &Path, arguments: &PlayArguments) -> Result<Vec<Episode>> {
    if let Some(simulated) = &chosen.simulated {
        return replay_in_python(&simulated.task, data, arguments);
    }
    let task = in_mujoco(chosen, "replay")?;
    // Nothing is chosen among them, so one is enough.
    let how = SetArguments::of(&arguments.storage);
    let Demonstrations { set, source, path, .. } =
        &demonstrations::open_of_any_size(Some(data), &how, None, Some(chosen))?;
    let states = demonstration::open::read_states(path, Some(source.format))?.ok_or_else(|| {
        let what = "the set holds no states of the simulator, 'infos/qpos' and 'infos/qvel', to replay from";
        Error::bad_input(what).at(path).with_hint(
            "sets that `demosift record` writes hold them, and those that `demosift convert` makes of these",
        )
    })?;
    let ids = match &arguments.demonstration[..] {
        [] => set.ids().into_iter().map(|demo| demo.0).collect(),
        named => named.to_vec(),
    };
    let episodes = ids.into_iter().map(|id| {
        let (id, demonstration) = find(set, id)?;
        let states = demonstrations::states_of(&states, DemoId(id)).map_err(|error| error.at(path))?;
        let measured: Rows = replay::measurements(task, states, demonstration.actions())
            .map_err(|error| error.during(&format!("demonstration {id}")).at(path))?;
        Ok(Episode {
            name: format!("demonstration {id}"),
            steps: demonstration.steps(),
            score: chosen.task.heuristic().score(&measured),
            succeeded: chosen.task.succeeded(&measured),
            seen: Some(Seen::States(states.clone())),
        })
    });
    episodes.collect()
}

/// The same in an environment in Python, where recorded actions are played again from where a demonstration began.
fn replay_in_python(task: &GymnasiumTask, data: &Path, arguments: &PlayArguments) -> Result<Vec<Episode>> {
    let mut opened = demonstrations::open_unchecked(Some(data), &SetArguments::of(&arguments.storage), None)?;
    opened.read_as_taken(task)?;
    opened.said.say();
    let as_recorded = AsRecorded::of(task, &opened, usize::MAX)?;
    let AsRecorded { set, starts } = &as_recorded;
    let ids = match &arguments.demonstration[..] {
        [] => set.ids(),
        named => named.iter().map(|id| find(set, *id).map(|(id, _)| DemoId(id))).collect::<Result<_>>()?,
    };
    let reel = |demo: &DemoId| {
        Reel::of_demonstration(starts, *demo, set.get(*demo)).ok_or_else(|| {
            Error::bad_input(format!(
                "the set does not say from which seed or state demonstration {demo} began, so it cannot be played again"
            ))
            .at(&opened.path)
            .with_hint("sets of Minari keep the seed of each episode, and those of robomimic their states")
        })
    };
    let reels = ids.iter().map(reel).collect::<Result<Vec<_>>>()?;
    let replayed = replay_in_env::replayed(task, set, starts, &ids)?;
    let episodes = ids.iter().zip(replayed).zip(reels).map(|((demo, replayed), reel)| {
        if let Some(step) = replayed.left_at {
            terminal::note(&format!(
                "demonstration {demo}: its recorded actions lead elsewhere from step {step} on than they did"
            ));
        }
        Episode {
            name: format!("demonstration {demo}"),
            steps: replayed.steps,
            score: replayed.score,
            succeeded: replayed.succeeded,
            seen: Some(Seen::Reel(Box::new(reel))),
        }
    });
    Ok(episodes.collect())
}

fn find(set: &DemonstrationSet, id: usize) -> Result<(usize, &demosift::data::demonstration::Demonstration)> {
    if !set.holds(DemoId(id)) {
        let range = tables::range_of(set);
        return Err(Error::bad_input(format!(
            "--demonstration {id}: the demonstrations of this set are {range}"
        )));
    }
    Ok((id, set.get(DemoId(id))))
}

/// The task, if it is one in MuJoCo.
fn in_mujoco<'c>(chosen: &'c Chosen, what: &str) -> Result<&'c MujocoTask> {
    chosen.mujoco.as_ref().ok_or_else(|| {
        Error::bad_input(format!(
            "the task '{}' has no MuJoCo model, so there is nothing to {what}",
            chosen.name
        ))
        .with_hint("a policy can be played on it without --frames, --sheet and --clip")
    })
}

/// Where pictures are made; opened before anything is played, since it says what is wrong with the arguments.
struct Studio<'c> {
    place: Place<'c>,
    step_secs: f64,
    wanted: Wanted,
    out: PathBuf,
}

/// From where episodes are looked at.
enum Place<'c> {
    InMujoco(&'c MujocoTask, Viewpoint),
    InPython(reels::Camera),
}

impl<'c> Studio<'c> {
    /// `None` if no pictures are wanted; without a folder for them they go beside this one.
    fn open(chosen: &'c Chosen, arguments: &PictureArguments, beside: PathBuf) -> Result<Option<Self>> {
        let PictureArguments { frames, sheet, clip, moments, .. } = *arguments;
        if !(frames || sheet || clip) {
            return match &arguments.out {
                None => Ok(None),
                Some(out) => Err(Error::bad_config("nothing is to be written to the folder of --out")
                    .at(out)
                    .with_hint("add --sheet, --clip or --frames")),
            };
        }
        if moments == 0 {
            return Err(Error::bad_config("--moments 0: must be at least 1"));
        }
        let out = arguments.out.clone().unwrap_or_else(|| {
            let mut folder = beside.into_os_string();
            folder.push("_pictures");
            folder.into()
        });
        PictureFolder::check(&out)?;
        let place = Place::open(chosen, arguments)?;
        let wanted = Wanted { frames, sheet: sheet.then_some(moments), clip };
        Ok(Some(Self { place, step_secs: chosen.task.specification().control_step_secs, wanted, out }))
    }

    /// Makes the pictures; returns their folder.
    fn film(self, episodes: &[Episode], unit: &str) -> Result<PathBuf> {
        let seen: Vec<(&Episode, &Seen)> =
            episodes.iter().filter_map(|episode| Some((episode, episode.seen.as_ref()?))).collect();
        let takes: Vec<Take> = seen
            .iter()
            .map(|(episode, _)| Take { label: label(episode, unit), steps: episode.steps })
            .collect();
        let mut camera = self.place.before(&seen);
        let folder = PictureFolder::begin(&self.out)?;
        let mut progress = Progress::of_bar_only();
        let made =
            film::film(camera.as_mut(), &takes, self.step_secs, self.wanted, &mut progress, &mut |film| {
                match film {
                    Film::Frame { take, step, png } => {
                        let name = seen[take].0.name.replace(' ', "_");
                        folder.add(&format!("frames/{name}/step_{step:04}.png"), &png)
                    }
                    Film::Sheet(png) => folder.add("sheet.png", &png),
                    Film::Clip(gif) => folder.add("clip.gif", &gif),
                }
            });
        progress.finish();
        made?;
        folder.finish()?;
        Ok(self.out)
    }
}

impl<'c> Place<'c> {
    fn open(chosen: &'c Chosen, arguments: &PictureArguments) -> Result<Self> {
        let (width, height) = arguments.size;
        if let Some(simulated) = &chosen.simulated {
            if arguments.camera.is_some() {
                return Err(Error::bad_config(
                    "--camera: an environment in Python is looked at as it renders itself",
                ));
            }
            let repeats = simulated.task.repeats();
            if repeats != Repeats::Exactly {
                terminal::note(&format!(
                    "the environment {}, so the pictures may show other episodes than the table",
                    repeats.words()
                ));
            }
            let (Ok(width @ 1..), Ok(height @ 1..)) = (u32::try_from(width), u32::try_from(height)) else {
                return Err(Error::bad_config(format!(
                    "--size {width}x{height}: a picture has at least 1 x 1 pixels"
                )));
            };
            let size = [width, height];
            return Ok(Self::InPython(reels::Camera::open(&simulated.task, size)?));
        }
        let task = in_mujoco(chosen, "look at")?;
        let camera = arguments.camera.as_deref().or(task.camera()).ok_or_else(|| {
            let why = task.model().lacks_camera().unwrap_or("has no camera");
            Error::bad_input(format!("the model of '{}' {why} to look from", chosen.name))
                .with_hint("wanted a <camera name=\"side\" .../> in it")
        })?;
        Ok(Self::InMujoco(task, Viewpoint::new(task, camera, width, height)?))
    }

    /// With these episodes before it.
    fn before<'e>(self, seen: &'e [(&'e Episode, &'e Seen)]) -> Box<dyn film::Camera + 'e>
    where
        'c: 'e,
    {
        match self {
            Self::InMujoco(task, viewpoint) => {
                let states = seen.iter().filter_map(|(episode, seen)| match seen {
                    Seen::States(states) => Some(Recorded { states, steps: episode.steps }),
                    Seen::Reel(_) => None,
                });
                Box::new(OfStates::new(task, viewpoint, states.collect()))
            }
            Self::InPython(camera) => {
                let reels = seen.iter().filter_map(|(_, seen)| match seen {
                    Seen::Reel(reel) => Some(reel.as_ref()),
                    Seen::States(_) => None,
                });
                Box::new(camera.before(reels.collect()))
            }
        }
    }
}

/// What stands above the pictures of an episode.
fn label(episode: &Episode, unit: &str) -> String {
    let score = Scale::of([episode.score], unit).with_unit(episode.score);
    let success = episode.succeeded.map_or("", |yes| if yes { ", success" } else { ", no success" });
    format!("{}: {score}{success}", episode.name)
}

fn table(episodes: &[Episode], unit: &str) -> String {
    let scale = Scale::of(episodes.iter().map(|episode| episode.score), unit);
    let title = scale.title("heuristic");
    let mut header = vec!["episode", "steps", title.as_str()];
    let knows_success = episodes.iter().any(|episode| episode.succeeded.is_some());
    if knows_success {
        header.push("success");
    }
    let rows: Vec<Vec<String>> = episodes
        .iter()
        .map(|episode| {
            let mut row = vec![episode.name.clone(), episode.steps.to_string(), scale.plain(episode.score)];
            row.extend(episode.succeeded.map(tables::yes_or_no));
            row
        })
        .collect();
    tables::table(&header, &rows)
}
