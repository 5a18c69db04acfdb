//! `demosift judge --prior RUN`: MetaPrior of an earlier run → where new demonstrations stand in its ranking.

use std::path::Path;

use demosift::Result;
use demosift::basics::seed::Seed;
use demosift::data::likeness::{Likeness, TrainedOn};
use demosift::results::artifact::Artifact as _;
use demosift::results::panel::{Judge, Judges, Panel};
use demosift::results::standing::{self, Beside, Kept};
use demosift::run::experiment;
use demosift::run::forecast::Goal;
use demosift::stages::judge::{Judged, ScoreTable};
use demosift::stages::method::{Account, Costs, Spent};
use demosift::stages::select::{self, Subset};
use demosift::world::environment::EnvVariant;

use super::{dry_run, kept_in};
use crate::answers::{self, OfRun};
use crate::arguments::JobArguments;
use crate::console::terminal;
use crate::job::Job;
use crate::job::given_prior::GivenPrior;
use crate::job::run_folder;
use crate::tables::costs;
use crate::tables::standing::{self as tables, Found};

pub(super) fn run(arguments: &JobArguments, prior: &Path) -> Result<()> {
    let given = GivenPrior::open(prior)?;
    let mut job = Job::open_given(arguments, &given)?;
    if arguments.run.dry_run {
        return dry_run::of_job(&mut job, Goal::Scores, &arguments.run);
    }
    let likeness = likeness(&given, &job)?;
    if !arguments.run.json {
        terminal::show(&tables::likeness(&job.set().ids(), likeness.as_deref()));
    }
    let judges = job.run(|run| Ok(run.config.judges.each()))?;
    let mut judged = Vec::new();
    let mut found = Vec::new();
    for &judge in judges {
        let new = job.run(|run| experiment::scores(run, judge))?;
        let of_judge = OfJudge::of(&given, judge, new)?;
        let standings = standings(&given, &job, std::slice::from_ref(&of_judge), judge.into())?;
        if !arguments.run.json {
            terminal::show(&tables::of_judge(judge, &of_judge.new, &standings, job.unit()));
        }
        judged.push(of_judge);
        found.extend(standings);
    }
    let decides = Panel::recall(&given.folder, "")?.map(|panel| panel.decides);
    if decides == Some(Judges::Both) && judged.len() > 1 {
        let together = standings(&given, &job, &judged, Judges::Both)?;
        if !arguments.run.json {
            terminal::show(&tables::together(&together, job.unit()));
        }
        found.extend(together);
    }
    let costs = job.costs()?;
    if arguments.run.json {
        let answer = answers::Standings {
            prior: &given.origin.run,
            decides,
            judges: found.iter().map(answers::StandingsOfJudge::new).collect(),
            likeness: likeness.as_deref(),
            costs: answers::Spending::of(&costs),
        };
        terminal::show_json(&OfRun::new(&job, answer));
        return Ok(());
    }
    terminal::show(&tables::decides(decides, &found));
    terminal::show(&costs::played_from_given(&costs));
    if let Some(account) = account(&given, &costs)? {
        terminal::show(&tables::account(account));
    }
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(())
}

/// What the judge of the paper cost, where the earlier run says what its prior did.
fn account(given: &GivenPrior, costs: &Costs) -> Result<Option<Account>> {
    let once = given.config.method.stage().map(|stage| Spent::recall(&given.folder, stage)).transpose()?;
    Ok(once.flatten().and_then(|once| costs.account_beside(once.environment_steps)))
}

/// How like each new demonstration is to those that the prior was trained on, where these were written down.
fn likeness(given: &GivenPrior, job: &Job) -> Result<Option<Vec<Likeness>>> {
    let filter = given.prior().policy.filter();
    let trained_on = TrainedOn::recall(&given.folder, "")?;
    Ok(trained_on.map(|trained_on| {
        job.set().iter().map(|(_, demonstration)| trained_on.likeness(demonstration, filter)).collect()
    }))
}

/// How many the earlier run keeps, for a goal by itself where it has several; `None` where it has not kept any yet.
fn kept_by_run(given: &GivenPrior, goal: Option<&String>) -> Result<Option<usize>> {
    let subset = match goal.map(|goal| given.folder.path().join(goal)) {
        None => Subset::recall(&given.folder, "")?,
        Some(of_goal) if !of_goal.is_dir() => None,
        Some(of_goal) => Subset::recall(&run_folder::of_finished(&of_goal)?.1, "")?,
    };
    Ok(subset.map(|subset| subset.demos.len()))
}

/// What one judge found of the new demonstrations, and of those of the earlier run.
struct OfJudge {
    new: ScoreTable,
    /// `None` where the earlier run has no scores by this judge.
    earlier: Option<ScoreTable>,
    seed: Seed,
}

impl OfJudge {
    fn of(given: &GivenPrior, judge: Judge, new: ScoreTable) -> Result<Self> {
        let earlier = Judged::recall(&given.folder, judge.name())?.map(|judged| judged.scores);
        Ok(Self { new, earlier, seed: Seed::new(given.config.seed).of(judge.name()) })
    }
}

/// Where each new demonstration stands by these judges together, under each goal; nothing where the earlier run has no scores
/// by one of them.
fn standings(given: &GivenPrior, job: &Job, of: &[OfJudge], judges: Judges) -> Result<Vec<Found>> {
    let earlier: Option<Vec<&ScoreTable>> = of.iter().map(|of| of.earlier.as_ref()).collect();
    let Some(earlier) = earlier.filter(|earlier| !earlier.is_empty()) else { return Ok(Vec::new()) };
    // The judge of the paper may have judged those near the cut of the judge by cloning, which judges all.
    let by_all = Judged::recall(&given.folder, Judge::Cloning.name())?;
    let by_all = by_all.map_or_else(|| earlier[0].clone(), |judged| judged.scores);
    let keep = given.config.keep;
    let several = job.variants().len() > 1;
    let under = |(index, goal): (usize, &String)| {
        let kept = kept_by_run(given, several.then_some(goal))?
            .unwrap_or_else(|| keep.count_before_judging(by_all.demos().len()));
        let variant = EnvVariant(index);
        let under = |tables: &[&ScoreTable]| -> Vec<ScoreTable> {
            tables.iter().map(|table| table.under(variant)).collect()
        };
        let new: Vec<&ScoreTable> = of.iter().map(|of| &of.new).collect();
        let (earlier, new) = (under(&earlier), under(&new));
        let count = select::rank_under(&by_all, variant).of_first(kept, &earlier[0].demos());
        let tables = earlier.iter().zip(&new).zip(of);
        let by_judge: Vec<Beside<'_>> =
            tables.map(|((earlier, new), of)| Beside { earlier, new, seed: &of.seed }).collect();
        let of_all = earlier[0].demos().len() == by_all.demos().len();
        let standings = standing::standings(&by_judge, Kept { keep, count, of_all })?;
        Ok(Found { judges, goal: several.then(|| goal.clone()), standings, keep, kept: count })
    };
    job.variants().iter().enumerate().map(under).collect()
}
