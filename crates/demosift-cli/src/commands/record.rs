//! `demosift record`: a demonstrator is trained, and its episodes at stages from hopeless to successful become a set.

use std::path::Path;

use demosift::demonstration::d4rl::{self, Episode, States};
use demosift::demonstrator::{self, DemonstratorState, DemonstratorTraining, Recorded, Stage};
use demosift::environment::EnvVariant;
use demosift::experiment::{self, Keeping};
use demosift::heuristic::Score;
use demosift::ledger::Ledger as _;
use demosift::rollout::Playground;
use demosift::rows::Rows;
use demosift::seed::Seed;
use demosift::{Error, Result, artifact};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::kept_in;
use crate::arguments::RecordArguments;
use crate::configuration;
use crate::job::{self, Plan, SET_FILE};
use crate::metrics_file::MetricsFile;
use crate::run_folder::RunFolder;
use crate::tables::{self, Scale};
use crate::terminal::{self, Progress};

/// Where the demonstrations came from: apart from them, so that nothing that judges reads it.
const PROVENANCE_FILE: &str = "provenance.json";

/// What a recording depends on.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Recording {
    seed: u64,
    demonstrator: DemonstratorTraining,
}

/// Where a set came from.
#[derive(Debug, Serialize, Deserialize)]
struct Provenance {
    /// TRPO steps of the finished demonstrator.
    updates: usize,
    environment_steps: usize,
    /// Share of its episodes that succeeded.
    success: Option<f64>,
    demonstrations: Vec<Origin>,
}

/// Where one demonstration came from.
#[derive(Debug, Serialize, Deserialize)]
struct Origin {
    demonstration: usize,
    variant: usize,
    /// TRPO steps of the demonstrator at this stage.
    updates: usize,
    stage_return: f64,
    stage_score: Score,
    stage_success: Option<f64>,
    /// Of the recorded episode itself.
    score: Score,
    succeeded: Option<bool>,
    steps: usize,
}

pub(crate) fn run(arguments: &RecordArguments) -> Result<()> {
    job::use_threads(arguments.run.threads)?;
    let plan = Plan::of(&arguments.run)?;
    let mut values = configuration::of_recording(plan.values.clone());
    let recording: Recording = configuration::typed(values.clone())?;
    experiment::check_demonstrator(&recording.demonstrator)?;
    // Kept with the configuration, so that a folder of another count is told apart.
    let count = count(arguments, &plan)?;
    values.insert("count".to_owned(), toml::Value::Integer(count as i64));
    let mut folder = plan.open_folder(None, &values)?;
    let provenance = match folder.recall(PROVENANCE_FILE)? {
        Some(bytes) => serde_json::from_slice(&bytes)
            .map_err(|error| Error::bad_input(format!("{PROVENANCE_FILE} cannot be read: {error}")))?,
        None => make(&plan, &recording, count, &mut folder)?,
    };
    if arguments.run.json {
        terminal::show_json(&json!({ "provenance": provenance, "run_folder": folder.path() }));
        return Ok(());
    }
    terminal::show(&tell(&provenance, plan.chosen.task.heuristic().unit()));
    terminal::show(&kept_in(&folder));
    Ok(())
}

fn count(arguments: &RecordArguments, plan: &Plan) -> Result<usize> {
    let begun = plan.begun.as_ref().and_then(|begun| begun.configuration.get("count")?.as_integer());
    let count = arguments.count.or(begun.and_then(|count| usize::try_from(count).ok())).unwrap_or(8);
    if count < 2 {
        return Err(Error::bad_config(format!("--count {count}: must be at least 2")));
    }
    Ok(count)
}

/// Trains, records and writes everything; the provenance comes last, since it says that the recording is whole.
fn make(plan: &Plan, recording: &Recording, count: usize, folder: &mut RunFolder) -> Result<Provenance> {
    let playground = Playground::new(plan.chosen.task.as_ref());
    let seed = Seed::new(recording.seed);
    let mut progress = Progress::new(MetricsFile::open(folder.path())?);
    let stages = train(&playground, &recording.demonstrator, &seed, (folder, &mut progress));
    let told = progress.finish();
    let stages = stages?;
    told?;
    let last = stages.last().expect("training keeps its last stage");
    let (episodes, origins) = record(&playground, &stages, count, &seed)?;
    let provenance = Provenance {
        updates: last.updates,
        environment_steps: last.environment_steps,
        success: last.success,
        demonstrations: origins,
    };
    write(&folder.path().join(SET_FILE), &episodes)?;
    folder.keep("policy_demonstrator.safetensors", &artifact::write_policy(&last.policy))?;
    let mut json = serde_json::to_vec_pretty(&provenance).expect("names and numbers are JSON");
    json.push(b'\n');
    folder.keep(PROVENANCE_FILE, &json)?;
    folder.forget(&artifact::checkpoint_name(demonstrator::STAGE, ""))?;
    Ok(provenance)
}

fn train(
    playground: &Playground<'_>,
    training: &DemonstratorTraining,
    seed: &Seed,
    (folder, progress): (&mut RunFolder, &mut Progress),
) -> Result<Vec<Stage>> {
    let seed = seed.of("demonstrator");
    let start = || DemonstratorState::start(playground, training, &seed.of("start"));
    let (state, mut keeping) = Keeping::begin(folder, progress, demonstrator::STAGE, "", start)?;
    demonstrator::train(playground, training, state, &seed, &mut keeping)
}

/// One episode of each chosen stage, in an order from which the stages cannot be read.
fn record(
    playground: &Playground<'_>,
    stages: &[Stage],
    count: usize,
    seed: &Seed,
) -> Result<(Vec<Recorded>, Vec<Origin>)> {
    let chosen = demonstrator::choose_stages(stages, count)?;
    let order = demonstrator::shuffled_order(count, seed.of("order"));
    let variants = playground.specification().variants.len();
    let mut episodes = Vec::with_capacity(count);
    let mut origins = Vec::with_capacity(count);
    for (demonstration, &stage) in order.iter().enumerate() {
        let (stage, variant) = (&chosen[stage], demonstration % variants);
        let seed = seed.of("record").at(demonstration);
        let recorded = demonstrator::record(playground, stage, EnvVariant(variant), &seed)?;
        let played = &recorded.trajectory;
        origins.push(Origin {
            demonstration,
            variant,
            updates: stage.updates,
            stage_return: stage.task_return,
            stage_score: stage.score,
            stage_success: stage.success,
            score: playground.score(played),
            succeeded: playground.task().succeeded(played.measurements()),
            steps: played.steps(),
        });
        episodes.push(recorded);
    }
    Ok((episodes, origins))
}

fn write(path: &Path, recorded: &[Recorded]) -> Result<()> {
    // The last observation has no action, and the layout has no place for it.
    let observations: Vec<Rows> = recorded
        .iter()
        .map(|Recorded { trajectory, .. }| trajectory.observations().head(trajectory.steps()))
        .collect();
    let episodes: Vec<Episode<'_>> = recorded
        .iter()
        .zip(&observations)
        .map(|(Recorded { trajectory, states }, observations)| Episode {
            observations,
            actions: trajectory.actions(),
            states: states.as_ref().map(|log| States { qpos: &log.qpos, qvel: &log.qvel }),
            terminated: trajectory.terminated(),
        })
        .collect();
    d4rl::write(path, &episodes)
}

fn tell(provenance: &Provenance, unit: &str) -> String {
    let origins = &provenance.demonstrations;
    let scale = Scale::of(origins.iter().flat_map(|origin| [origin.score, origin.stage_score]), unit);
    let titles = ["heuristic", "stage's mean"].map(|name| scale.title(name));
    let header =
        ["demonstration", "steps", &titles[0], "success", "recorded after", &titles[1], "stage's success"];
    let rows: Vec<Vec<String>> = origins
        .iter()
        .map(|origin| {
            vec![
                origin.demonstration.to_string(),
                origin.steps.to_string(),
                scale.plain(origin.score),
                origin.succeeded.map_or("-".to_owned(), tables::yes_or_no),
                format!("{} updates", origin.updates),
                scale.plain(origin.stage_score),
                origin.stage_success.map_or("-".to_owned(), tables::percent),
            ]
        })
        .collect();
    let success = provenance.success.map_or(String::new(), |share| {
        format!(" and succeeded in {} of its episodes", tables::percent(share))
    });
    format!(
        "{}\nThe demonstrator was done after {} updates on {} environment steps{success}.\n",
        tables::table(&header, &rows),
        provenance.updates,
        provenance.environment_steps
    )
}
