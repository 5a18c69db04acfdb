//! `demosift record`: a demonstrator is trained, and its episodes at stages from hopeless to successful become a set.

mod source;

use std::path::Path;

use demosift::basics::files;
use demosift::basics::ledger::Ledger as _;
use demosift::basics::seal;
use demosift::basics::seed::Seed;
use demosift::data::demonstration::d4rl::{self, Episode, States};
use demosift::data::demonstration::episode::RECORDED;
use demosift::math::rows::Rows;
use demosift::results::artifact::{self, Artifact as _, onnx};
use demosift::results::recording::{self, Cast, Origin, Recorded};
use demosift::run::experiment::{self, Checkpointing};
use demosift::run::forecast::{self, By, Forecast};
use demosift::stages::demonstrator::{self, DemonstratorState, DemonstratorTraining, Outcome, Stage};
use demosift::world::rollout::Playground;
use demosift::{Error, Result};
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use self::source::{Guest, Source};
use super::play::read_policy;
use super::{dry_run, kept_in};
use crate::answers;
use crate::arguments::{RecordArguments, RunArguments};
use crate::configuration;
use crate::console::terminal::{self, Progress};
use crate::files::metrics_file::MetricsFile;
use crate::files::writing::undisturbed;
use crate::job::request::{Asked, Request};
use crate::job::run_folder::RunFolder;
use crate::job::threads;
use crate::tables::{self, Scale};
use crate::task::Chosen;

/// Where the demonstrations came from: apart from them, so that nothing that judges reads it.
const PROVENANCE_FILE: &str = "provenance.json";
/// A second set, and where it came from.
const UNSEEN_SET_FILE: &str = "unseen.hdf5";
const UNSEEN_PROVENANCE_FILE: &str = "unseen_provenance.json";
/// The part of the trained policy, and its file.
const DEMONSTRATOR: &str = "demonstrator";
const POLICY: &str = "policy_demonstrator.safetensors";

/// Episodes from which a finished demonstrator is known.
const FINAL_EPISODES: usize = 100;

/// What a recording depends on.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Recording {
    seed: u64,
    count: usize,
    unseen: usize,
    /// How the demonstrator is trained.
    demonstrator: Option<DemonstratorTraining>,
    /// The demonstrator, if it is there already.
    recorded_from: Option<Source>,
    #[serde(default)]
    guests: Vec<Guest>,
    /// The one stage of all demonstrations, as a share of the way from the worst to the best; without it they span the training.
    stage: Option<f64>,
}

/// Where a set came from.
#[derive(Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Provenance {
    #[serde(flatten)]
    demonstrator: Demonstrator,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    guests: Vec<Demonstrator>,
    demonstrations: Vec<Origin>,
    /// Hash of the file of the set; recordings of before it was kept do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    set_sha256: Option<String>,
}

/// A finished demonstrator.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Demonstrator {
    /// The task that it plays, in its own body.
    task: String,
    /// TRPO steps.
    updates: usize,
    environment_steps: usize,
    /// Share of the episodes that succeeded which it played for its last step.
    success: Option<f64>,
    /// How it does in episodes from which it did not learn.
    #[serde(rename = "final")]
    finally: Outcome,
}

pub(crate) fn run(arguments: &RecordArguments) -> Result<()> {
    threads::make_all_loops_use(arguments.run.threads)?;
    let given = arguments.demonstrator.as_deref().map(Source::of).transpose()?;
    let plan = Request::of(&Asked {
        part: None,
        run: &with_task(arguments, given.as_ref()),
        variant: None,
        preset: None,
        given: None,
        set: None,
        stored: None,
        referees: false,
        trainer: None,
    })?;
    let values = values(arguments, given, &plan)?;
    let recording: Recording = configuration::typed(values.clone())?;
    check(&recording, &plan)?;
    let mut folder = plan.open_folder(None, &values, arguments.run.dry_run)?;
    if arguments.run.dry_run {
        return foresee(&plan, &recording, &folder, &arguments.run);
    }
    let Made { provenance, unseen } = match recall(&recording, &folder)? {
        Some(made) => {
            let policy = read_policy(&folder.path().join(POLICY), plan.chosen.task.specification())?;
            // It is made of the other, and may be gone, or of before there were such files.
            onnx::store_policy(&mut folder, DEMONSTRATOR, &policy, plan.chosen.task.specification())?;
            made
        }
        None => make(&plan, &recording, &mut folder)?,
    };
    if arguments.run.json {
        let unseen = unseen.as_ref().map(|unseen| &unseen.demonstrations);
        terminal::show_json(&answers::Record { provenance: &provenance, unseen, run_folder: folder.path() });
        return Ok(());
    }
    let unit = plan.chosen.task.heuristic().unit();
    terminal::show(&tell(&provenance, unit));
    if let Some(unseen) = unseen {
        terminal::show(&format!("\nUnseen demonstrations:\n\n{}", table(&unseen.demonstrations, unit)));
    }
    terminal::show(&kept_in(&folder, None));
    Ok(())
}

/// The task is that of the demonstrator, if no other one is named.
fn with_task(arguments: &RecordArguments, given: Option<&Source>) -> RunArguments {
    let of_demonstrator =
        given.filter(|_| arguments.run.simulator.env.is_none()).map(|source| source.task.clone());
    let task = arguments.run.task.clone().or(of_demonstrator);
    RunArguments { task, ..arguments.run.clone() }
}

/// All that the recording depends on: what is asked for now, or was when it began.
fn values(arguments: &RecordArguments, given: Option<Source>, plan: &Request) -> Result<Table> {
    let begun = plan.begun.as_ref().map(|begun| &begun.configuration);
    let mut values = configuration::of_recording(plan.values.clone());
    for (name, given, default) in [("count", arguments.count, 8), ("unseen", arguments.unseen, 0)] {
        let value = given.map(|number| Value::Integer(number as i64));
        let value = value.or(begun.and_then(|begun| begun.get(name).cloned()));
        values.insert(name.to_owned(), value.unwrap_or(Value::Integer(default)));
    }
    let stage = arguments.stage.map(Value::Float).or(begun.and_then(|begun| begun.get("stage").cloned()));
    values.extend(stage.map(|stage| ("stage".to_owned(), stage)));
    let plain = |source| Value::try_from(source).expect("names and hashes are TOML");
    let source = given.map(plain).or(begun.and_then(|begun| begun.get("recorded_from").cloned()));
    if let Some(source) = source {
        if arguments.run.set.iter().any(|assignment| assignment.starts_with("demonstrator.")) {
            let message = "--demonstrator trains nothing, so --set demonstrator.… would change nothing";
            return Err(Error::bad_config(message).with_hint("leave one of the two away"));
        }
        values.remove(configuration::DEMONSTRATOR);
        values.insert("recorded_from".to_owned(), source);
    }
    let guests = arguments.guest.iter().map(|typed| Guest::of(typed)).collect::<Result<Vec<_>>>()?;
    let guests = if guests.is_empty() {
        begun.and_then(|begun| begun.get("guests").cloned())
    } else {
        Some(Value::try_from(guests).expect("names and hashes are TOML"))
    };
    values.extend(guests.map(|guests| ("guests".to_owned(), guests)));
    Ok(values)
}

/// Whether the numbers mean something and the demonstrators fit, before the run folder is touched.
fn check(recording: &Recording, plan: &Request) -> Result<()> {
    let Recording { count, unseen, guests, .. } = recording;
    if *count < 2 {
        return Err(Error::bad_config(format!("--count {count}: must be at least 2")));
    }
    if *unseen == 1 {
        return Err(Error::bad_config("--unseen 1: must be 0, or at least 2 for a set"));
    }
    if let Some(stage) = recording.stage.filter(|stage| !(0.0..=1.0).contains(stage)) {
        return Err(Error::bad_config(format!("--stage {stage}: must be from 0, the worst, to 1, the best")));
    }
    let of_guests: usize = guests.iter().map(|guest| guest.count).sum();
    if of_guests >= *count {
        return Err(Error::bad_config(format!(
            "{of_guests} of the {count} demonstrations are by guests, and at least 1 must be by the task's own demonstrator"
        ))
        .with_hint("raise --count, which counts all of them, or lower the N of --guest DIR=N"));
    }
    if let Some(training) = &recording.demonstrator {
        experiment::check_demonstrator(training)?;
        if plan.chosen.mujoco.as_ref().is_some_and(|task| !task.has_reward()) {
            return Err(Error::bad_config(format!(
                "the task '{}' has no reward, so there is nothing to train a demonstrator on",
                plan.chosen.name
            ))
            .with_hint(
                "add terms to `reward` in its task.toml, or `reward` to [success]; --demonstrator records one that is trained",
            ));
        }
    }
    if let Some(source) = &recording.recorded_from {
        if (&source.task, &source.task()?.sha256) != (&plan.chosen.name, &plan.chosen.sha256) {
            return Err(Error::bad_config(format!(
                "--demonstrator was trained on the task {}, and the recording is of {}",
                source.task, plan.chosen.name
            ))
            .with_hint("leave --task away, or let it be a --guest"));
        }
        source.stages(&plan.chosen)?;
    }
    for Guest { source, count } in guests {
        let chosen = source.task()?;
        recording::check_guest(plan.chosen.task.specification(), chosen.task.specification())?;
        recording::guest_stages(&source.stages(&chosen)?, *count).map_err(|error| source.blame(error))?;
    }
    Ok(())
}

/// What the recording would cost.
fn foresee(
    plan: &Request,
    recording: &Recording,
    folder: &RunFolder,
    arguments: &RunArguments,
) -> Result<()> {
    let guests = recording.guests.len();
    let trained = match &recording.recorded_from {
        Some(source) => source.stages(&plan.chosen)?.pop(),
        None => None,
    };
    let by = match (&recording.demonstrator, &trained) {
        (_, Some(last)) => By::Trained(&last.policy),
        (Some(training), None) => By::Training(training),
        (None, None) => return Err(Error::bad_input("the demonstrator has no stages")),
    };
    let asked = forecast::Recording {
        by,
        demonstrations: recording.count + recording.unseen,
        demonstrators: guests + 1,
        assessed: FINAL_EPISODES,
    };
    let playground = plan.chosen.playground()?;
    let foreseen = match recall(recording, folder)? {
        Some(_) => Forecast::nothing(),
        None => forecast::forecast_recording(&playground, &asked, folder, &mut dry_run::clock())?,
    };
    dry_run::show(&foreseen, playground.task(), folder.path(), arguments);
    Ok(())
}

/// Where the sets of a recording came from.
struct Made {
    provenance: Provenance,
    unseen: Option<Provenance>,
}

/// A finished recording: all its files are there, and its sets are those that it wrote.
fn recall(recording: &Recording, folder: &RunFolder) -> Result<Option<Made>> {
    let trained = recording.demonstrator.is_some().then_some(artifact::STAGES);
    if ![POLICY].into_iter().chain(trained).all(|name| folder.path().join(name).exists()) {
        return Ok(None);
    }
    let unseen = match recording.unseen {
        0 => None,
        _ => match recall_set(folder, UNSEEN_SET_FILE, UNSEEN_PROVENANCE_FILE)? {
            None => return Ok(None),
            unseen => unseen,
        },
    };
    let provenance = recall_set(folder, RECORDED, PROVENANCE_FILE)?;
    Ok(provenance.map(|provenance| Made { provenance, unseen }))
}

/// Where a set came from, if both files are there.
///
/// # Errors
/// `is_bad_input` if one of them is not as it was written.
fn recall_set(folder: &RunFolder, set: &str, name: &str) -> Result<Option<Provenance>> {
    let path = folder.path().join(set);
    let (Some(bytes), true) = (folder.recall(name)?, path.exists()) else { return Ok(None) };
    let provenance: Provenance = serde_json::from_slice(&seal::of_json(&bytes, name)?)
        .map_err(|error| Error::bad_input(format!("{name} cannot be read: {error}")))?;
    if let Some(written) = &provenance.set_sha256 {
        let found = files::sha256(std::slice::from_ref(&path))?;
        if found != *written {
            return Err(Error::bad_input(format!(
                "the set is not as it was recorded: its SHA-256 was {written}, and is {found} now"
            ))
            .at(&path)
            .with_hint(
                "delete it, and --resume records it again; or copy it elsewhere, if the change was meant",
            ));
        }
    }
    Ok(Some(provenance))
}

/// Trains, records and writes everything; the provenance of the set comes last, since it says that the recording is whole.
fn make(plan: &Request, recording: &Recording, folder: &mut RunFolder) -> Result<Made> {
    folder.claim()?;
    let playground = plan.chosen.playground()?;
    let seed = Seed::new(recording.seed);
    let stages = stages(&playground, recording, plan, folder)?;
    let demonstrator = finished(&playground, &stages, &seed.of("final"))?;
    let guests = recording.guests.iter().map(Invited::of).collect::<Result<Vec<_>>>()?;
    let playgrounds: Vec<Playground<'_>> =
        guests.iter().map(|guest| guest.chosen.playground()).collect::<Result<_>>()?;

    let all: Vec<&Stage> = stages.iter().collect();
    let own = recording.count - recording.guests.iter().map(|guest| guest.count).sum::<usize>();
    let chosen = match recording.stage {
        Some(share) => vec![recording::stage_at(&all, share)?; own],
        None => recording::choose_stages(&all, own)?,
    };
    let mut parts = vec![Cast { playground: &playground, stages: chosen }];
    let mut visitors = Vec::with_capacity(guests.len());
    for (index, (guest, playground)) in guests.iter().zip(&playgrounds).enumerate() {
        parts.push(Cast { playground, stages: recording::guest_stages(&guest.stages, guest.count)? });
        visitors.push(finished(playground, &guest.stages, &seed.of("final of guest").at(index))?);
    }
    let recorded = recording::record(&parts, &seed)?;
    let set_sha256 = write(&folder.path().join(RECORDED), &recorded, &plan.chosen)?;

    let unseen = if recording.unseen > 0 {
        let others = recording::other_stages(&stages, &parts[0].stages, recording.unseen);
        let stages = recording::choose_stages(&others, recording.unseen)?;
        let recorded = recording::record(&[Cast { playground: &playground, stages }], &seed.of("unseen"))?;
        let set_sha256 = write(&folder.path().join(UNSEEN_SET_FILE), &recorded, &plan.chosen)?;
        let provenance = Provenance::of(demonstrator.clone(), Vec::new(), &recorded).of_file(set_sha256);
        provenance.store(folder, UNSEEN_PROVENANCE_FILE)?;
        Some(provenance)
    } else {
        None
    };
    let last = stages.last().expect("training keeps its last stage");
    folder.store(POLICY, &artifact::write_policy(&last.policy))?;
    onnx::store_policy(folder, DEMONSTRATOR, &last.policy, playground.specification())?;
    let provenance = Provenance::of(demonstrator, visitors, &recorded).of_file(set_sha256);
    provenance.store(folder, PROVENANCE_FILE)?;
    Ok(Made { provenance, unseen })
}

/// A guest with what it brings.
struct Invited {
    chosen: Chosen,
    stages: Vec<Stage>,
    count: usize,
}

impl Invited {
    fn of(guest: &Guest) -> Result<Self> {
        let chosen = guest.source.task()?;
        let stages = guest.source.stages(&chosen)?;
        Ok(Self { chosen, stages, count: guest.count })
    }
}

impl Provenance {
    fn of(demonstrator: Demonstrator, guests: Vec<Demonstrator>, recorded: &[Recorded]) -> Self {
        let demonstrations = recorded.iter().map(|recorded| recorded.origin.clone()).collect();
        Self { demonstrator, guests, demonstrations, set_sha256: None }
    }

    fn of_file(self, sha256: String) -> Self {
        Self { set_sha256: Some(sha256), ..self }
    }

    fn store(&self, folder: &mut RunFolder, name: &str) -> Result<()> {
        folder.store(name, &seal::to_json(self))
    }
}

/// The demonstrator's stages: kept before, those of another run folder, or those of its training now.
fn stages(
    playground: &Playground<'_>,
    recording: &Recording,
    plan: &Request,
    folder: &mut RunFolder,
) -> Result<Vec<Stage>> {
    if let Some(stages) = Vec::recall(folder, "")? {
        experiment::forget_checkpoint(folder, demonstrator::STAGE, "");
        return Ok(stages);
    }
    if let Some(source) = &recording.recorded_from {
        return source.stages(&plan.chosen);
    }
    let training = recording.demonstrator.as_ref().expect("a recording has a training or a source");
    let mut progress = Progress::new(MetricsFile::of(folder.path())?);
    let seed = Seed::new(recording.seed).of("demonstrator");
    let stages = train(playground, training, &seed, folder, &mut progress);
    progress.finish();
    stages
}

fn train(
    playground: &Playground<'_>,
    training: &DemonstratorTraining,
    seed: &Seed,
    folder: &mut RunFolder,
    progress: &mut Progress,
) -> Result<Vec<Stage>> {
    let start = || DemonstratorState::start(playground, training, &seed.of("start"));
    let (state, mut checkpointing) =
        Checkpointing::begin(folder, progress, playground, demonstrator::STAGE, "", start)?;
    let stages = demonstrator::train(playground, training, state, seed, &mut checkpointing)?;
    checkpointing.finish("", &stages)?;
    Ok(stages)
}

fn finished(playground: &Playground<'_>, stages: &[Stage], seed: &Seed) -> Result<Demonstrator> {
    let last = stages.last().ok_or_else(|| Error::bad_input("the demonstrator has no stages"))?;
    Ok(Demonstrator {
        task: playground.specification().name.clone(),
        updates: last.updates,
        environment_steps: last.environment_steps,
        success: last.success,
        finally: demonstrator::assess(playground, &last.policy, FINAL_EPISODES, seed)?,
    })
}

/// Writes a set; returns the hash of its file.
fn write(path: &Path, recorded: &[Recorded], chosen: &Chosen) -> Result<String> {
    // The last observation has no action, and the layout has no place for it.
    let observations: Vec<Rows> = recorded
        .iter()
        .map(|Recorded { trajectory, .. }| trajectory.observations().head(trajectory.steps()))
        .collect();
    let actions = recorded.iter().map(|of| chosen.recorded_actions(of.trajectory.actions()));
    let actions = actions.collect::<Result<Vec<Rows>>>()?;
    let episodes: Vec<Episode<'_>> = recorded
        .iter()
        .zip(observations.iter().zip(&actions))
        .map(|(Recorded { trajectory, states, .. }, (observations, actions))| Episode {
            observations,
            actions,
            states: states.as_ref().map(|log| States { qpos: &log.qpos, qvel: &log.qvel }),
            terminated: trajectory.terminated(),
        })
        .collect();
    undisturbed(|| d4rl::write(path, &episodes))?;
    files::sha256(&[path.to_owned()])
}

fn tell(provenance: &Provenance, unit: &str) -> String {
    let mut said = table(&provenance.demonstrations, unit) + "\n";
    said += &tell_of(&provenance.demonstrator, "The demonstrator", unit);
    for guest in &provenance.guests {
        said += &tell_of(guest, &format!("The guest of {}", guest.task), unit);
    }
    said
}

fn tell_of(
    Demonstrator { updates, environment_steps, finally, .. }: &Demonstrator,
    who: &str,
    unit: &str,
) -> String {
    let Outcome { episodes, success, score, task_return } = finally;
    let scale = Scale::of([*score], unit);
    let success =
        success.map_or(String::new(), |share| format!("it succeeds in {}, ", tables::percent(share)));
    format!(
        "{who} was done after {updates} updates on {environment_steps} environment steps.\n\
         In {episodes} episodes after that {success}with a mean heuristic of {} and a mean return of {task_return:.1}.\n",
        scale.with_unit(*score)
    )
}

fn table(origins: &[Origin], unit: &str) -> String {
    let scale = Scale::of(origins.iter().flat_map(|origin| [origin.score, origin.stage_score]), unit);
    let titles = ["heuristic", "stage's mean"].map(|name| scale.title(name));
    let several =
        |differs: fn(&Origin, &Origin) -> bool| origins.iter().any(|origin| differs(origin, &origins[0]));
    let (bodies, variants) = (several(|a, b| a.task != b.task), several(|a, b| a.variant != b.variant));
    let mut header = vec!["demonstration"];
    header.extend(bodies.then_some("task"));
    header.extend(variants.then_some("variant"));
    header.extend(["steps", &titles[0], "success", "recorded after", &titles[1], "stage's success"]);
    let rows: Vec<Vec<String>> = origins
        .iter()
        .map(|origin| {
            let mut row = vec![origin.demonstration.to_string()];
            row.extend(bodies.then(|| origin.task.clone()));
            row.extend(variants.then(|| origin.variant.to_string()));
            row.extend([
                origin.steps.to_string(),
                scale.plain(origin.score),
                origin.succeeded.map_or("-".to_owned(), tables::yes_or_no),
                format!("{} updates", origin.updates),
                scale.plain(origin.stage_score),
                origin.stage_success.map_or("-".to_owned(), tables::percent),
            ]);
            row
        })
        .collect();
    tables::table(&header, &rows)
}
