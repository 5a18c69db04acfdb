//! DemonstrationSet → MetaPrior → ScoreTable → Panel: each judge that is asked, and what they say together.

use std::collections::BTreeSet;

use super::asked_trainer::Asks;
use super::made_with::{
    JudgedBy, Preparation, check_budget, information, judged_by, learning_by, learning_seed, preparation,
};
use super::{
    Checkpointing, Config, OfPart, Run, arrows, asked_trainer, check_known, cut, cut_of_judging,
    forget_checkpoint, make, near_cut, stage_name, states_of_parts,
};
use crate::basics::error::{Error, Result};
use crate::basics::ledger::Ledger;
use crate::basics::seed::Seed;
use crate::data::demonstration::DemoId;
use crate::data::likeness::TrainedOn;
use crate::data::observation_filter::ObservationFilter;
use crate::learning::adapt::{self, Learner, MetaPrior};
use crate::results::artifact::Artifact;
use crate::results::panel::{self, Found, Judge, Opinion, Panel};
use crate::results::report;
use crate::stages::judge::{
    self, Crew, Imitating, Judged, Judging, JudgingState, ScoreTable, ShareOfThreads, Start, Threads, Trial,
};
use crate::stages::meta_train::{self, MetaState, MetaTraining};
use crate::stages::pre_train::{self, PreTrainState, PreTraining};
use crate::stages::select;
use crate::world::environment::EnvVariant;
use crate::world::policy::Policy;

/// DemonstrationSet → MetaPrior, by the run's method.
pub fn prior(run: &mut Run<'_>) -> Result<MetaPrior> {
    if let Some(prior) = Artifact::recall(run.ledger, "")? {
        if let Some(stage) = run.config.method.stage() {
            forget_checkpoint(run.ledger, stage, "");
        }
        return Ok(prior);
    }
    if let Some(part) = run.ledger.part() {
        return Err(Error::bad_input(format!(
            "part {part} of the judge of the paper needs the prior, which is learned once, and the run has none"
        )));
    }
    check_budget(run.set, run.playground, run.config)?;
    let config = run.config;
    let seed = learning_seed(config);
    let hidden = &config.meta_train.discriminator_hidden;
    let untrained = Learner::untrained(run.set, &config.policy, hidden, &seed.of("start"));
    TrainedOn::of(run.set, untrained.policy.filter()).store(run.ledger, "")?;
    match preparation(run) {
        Preparation::MetaTraining(training) => meta_trained(run, untrained, &training, &seed),
        Preparation::PreTraining(training) => pre_trained(run, untrained, training, &seed),
        Preparation::Nothing => {
            untrained.store(run.ledger, "")?;
            Ok(untrained)
        }
    }
}

/// Algorithm 1.
fn meta_trained(
    run: &mut Run<'_>,
    untrained: Learner,
    training: &MetaTraining,
    seed: &Seed,
) -> Result<MetaPrior> {
    let Run { set, playground, config, ledger, observer } = run;
    let start = || Ok(MetaState::from_prior(set, untrained, information(config), &seed.of("start")));
    let (state, mut checkpointing) =
        Checkpointing::begin(*ledger, *observer, playground, meta_train::STAGE, "", start)?;
    let learning = learning_by(config, training);
    let prior = meta_train::meta_train(set, playground, &learning, state, seed, &mut checkpointing)?.prior;
    checkpointing.finish("", &prior)?;
    Ok(prior)
}

/// Imitation of the entire set (§5, Avg Fine-Tune).
fn pre_trained(
    run: &mut Run<'_>,
    untrained: Learner,
    training: PreTraining<'_>,
    seed: &Seed,
) -> Result<MetaPrior> {
    let Run { set, playground, ledger, observer, .. } = run;
    let start = || Ok(PreTrainState::start(untrained, training.inner));
    let (state, mut checkpointing) =
        Checkpointing::begin(*ledger, *observer, playground, pre_train::STAGE, "", start)?;
    let prior = pre_train::pre_train(set, playground, training, state, seed, &mut checkpointing)?;
    checkpointing.finish("", &prior)?;
    Ok(prior)
}

/// DemonstrationSet → ScoreTable, by one judge; that of the paper learns its prior first.
///
/// # Errors
/// Those of judging; `is_bad_config` if somebody else's trainer is to judge and the playground has none, or another than the
/// one that has judged.
pub fn scores(run: &mut Run<'_>, judge: Judge) -> Result<ScoreTable> {
    if let Some(Judged { scores, .. }) = Artifact::recall(run.ledger, judge.name())? {
        let demos = scores.suitabilities.iter().map(|of| of.demo);
        check_known(run.set, demos, &format!("the scores of the judge {}", judge.name()))?;
        asked_trainer::check_same(&scores, run.playground.trainer())?;
        return Ok(scores);
    }
    match judge {
        Judge::Cloning | Judge::Trainer => {
            let filter = filter(run)?;
            judged(run, judge, untrained(run.config, &filter))
        }
        Judge::Paper => {
            let prior = prior(run)?;
            judged(run, judge, Start::Prior(&prior))
        }
    }
}

/// How a judge judges; that of the paper makes as many updates as its method's budget pays for.
pub fn judging(run: &Run<'_>, judge: Judge) -> Judging {
    judged_by(run, judge).judging
}

/// The policy from which the first repeats of a judge start.
///
/// # Errors
/// Bad input if the prior is gone that the judge of the paper started from.
pub fn first_start(run: &Run<'_>, judge: Judge) -> Result<Policy> {
    let seed = judging_seed(run.config, judge);
    let policy = |start: Start<'_>| start.learner(run.set, 0, &seed).policy.clone();
    match judge {
        Judge::Cloning | Judge::Trainer => Ok(policy(untrained(run.config, &filter(run)?))),
        Judge::Paper => {
            let prior = MetaPrior::recall(run.ledger, "")?
                .ok_or_else(|| Error::bad_input("the run folder holds no prior.safetensors any more"))?;
            Ok(policy(Start::Prior(&prior)))
        }
    }
}

/// From what the judge by cloning starts, and what one by a trainer compares with.
fn untrained<'a>(config: &'a Config, filter: &'a ObservationFilter) -> Start<'a> {
    let discriminator_hidden = &config.meta_train.discriminator_hidden;
    Start::Untrained { shape: &config.policy, discriminator_hidden, filter }
}

/// That of the set, or of the one on which the prior was trained that the run was given.
fn filter(run: &Run<'_>) -> Result<ObservationFilter> {
    let prior = MetaPrior::recall(run.ledger, "")?;
    Ok(prior.map_or_else(|| adapt::filter_of(run.set), |prior| prior.policy.filter().clone()))
}

/// Algorithm 2.
fn judged(run: &mut Run<'_>, judge: Judge, start: Start<'_>) -> Result<ScoreTable> {
    let JudgedBy { judging, inner, .. } = &judged_by(run, judge);
    let imitating = match inner.as_deref() {
        Some(inner) => Imitating::Updates(inner),
        None => Imitating::Trainer(asked_trainer::of(run.playground, Asks::Judge)?),
    };
    let near_cut::Judged { demos, cut } = whom(run, judge)?;
    let (part, seed) = (judge.name(), judging_seed(run.config, judge));
    let Run { set, playground, ledger, observer, .. } = run;
    let anew = || Ok(JudgingState::default());
    let others: Vec<OfPart<JudgingState>> = states_of_parts(*ledger, judge::STAGE, part)?;
    let share = ledger.part().map(|part| {
        let variants = playground.specification().variants.len();
        ShareOfThreads { part, demonstrations: set.len(), variants }
    });
    let crew: &dyn Crew = share.as_ref().map_or(&Threads, |share| share);
    let (mut state, mut checkpointing) =
        Checkpointing::begin(*ledger, *observer, playground, judge::STAGE, part, anew)?;
    state = state.if_by(imitating.trainer());
    for other in others {
        checkpointing.was_worked_on_by(&other.spent);
        state.take_over(other.state.if_by(imitating.trainer()));
    }
    let trial = Trial { set, demos: &demos, playground, start, imitating, judging, cut, part, seed: &seed };
    let mut judged = judge::judge(&trial, crew, &mut state, &mut checkpointing)?;
    if inner.is_some() && judged.adapted.len() < judged.scores.suitabilities.len() {
        let demos = worth_a_look(&judged.scores, cut);
        judged = judge::look_at(&trial, &demos, &mut state, &mut checkpointing)?;
    }
    checkpointing.finish_having(state.played(), part, &judged)?;
    Ok(judged.scores)
}

/// Whom a judge judges: all, or those nearest to the cut of the judge by cloning, which then judges first.
fn whom(run: &mut Run<'_>, judge: Judge) -> Result<near_cut::Judged> {
    let (count, cut) = (near_cut::how_many(run.config, run.set, judge), cut_of_judging(run));
    if count == run.set.len() {
        return Ok(near_cut::Judged { demos: run.set.ids(), cut });
    }
    Ok(near_cut::near(&scores(run, Judge::Cloning)?, cut, count))
}

/// Which demonstrations a report looks at, over all goals and under each of them.
fn worth_a_look(scores: &ScoreTable, kept: usize) -> Vec<DemoId> {
    let under = scores.variants().into_iter().map(|variant| select::rank_under(scores, variant));
    let rankings = [select::rank(scores)].into_iter().chain(under);
    let demos = rankings.flat_map(|ranking| report::worth_a_look(&ranking, kept));
    demos.collect::<BTreeSet<_>>().into_iter().collect()
}

/// The random numbers of a judge.
pub fn judging_seed(config: &Config, judge: Judge) -> Seed {
    Seed::new(config.seed).of(&stage_name(judge::STAGE, judge.name()))
}

/// Gives a run about one goal what a run about all of them has found out: the prior, and what each judge found under this
/// goal (Eq. 9 is taken per goal). What the run about one goal has already stays.
pub fn hand_on(from: &dyn Ledger, to: &mut dyn Ledger, goal: EnvVariant) -> Result<()> {
    hand_on_prior(from, to)?;
    for judge in Judge::ALL {
        let name = judge.name();
        if let (Some(judged), None) = (Judged::recall(from, name)?, Judged::recall(to, name)?) {
            judged.under(goal).store(to, name)?;
        }
    }
    Ok(())
}

/// Gives a run the prior of another, with what is known of the demonstrations that this was trained on.
pub fn hand_on_prior(from: &dyn Ledger, to: &mut dyn Ledger) -> Result<()> {
    if let (Some(prior), None) = (MetaPrior::recall(from, "")?, MetaPrior::recall(to, "")?) {
        if let Some(trained_on) = TrainedOn::recall(from, "")? {
            trained_on.store(to, "")?;
        }
        prior.store(to, "")?;
    }
    Ok(())
}

/// What the judges say that are asked; those that have not judged yet do it now.
pub fn panel(run: &mut Run<'_>) -> Result<Panel> {
    make(run, &arrows::all_scores(run.config))?;
    let panel = panel_of(run, run.config.judges.each())?;
    panel.store(run.ledger, "")?;
    Ok(panel)
}

/// What one judge says.
pub fn opinion(run: &mut Run<'_>, judge: Judge) -> Result<Opinion> {
    Ok(panel_of(run, &[judge])?.opinions.remove(0))
}

fn panel_of(run: &mut Run<'_>, judges: &[Judge]) -> Result<Panel> {
    let tables = judges.iter().map(|judge| scores(run, *judge)).collect::<Result<Vec<_>>>()?;
    let found: Vec<Found<'_>> =
        judges.iter().zip(&tables).map(|(&judge, scores)| Found { judge, scores }).collect();
    panel::panel(&found, cut(run), &Seed::new(run.config.seed).of("panel"))
}
