//! `demosift oracle`: each demonstration alone from scratch, what rankings are compared with.

use demosift::data::demonstration::DemoId;
use demosift::math::agreement;
use demosift::math::statistics;
use demosift::results::artifact::Artifact;
use demosift::results::gain;
use demosift::results::gain::AgainstRandom;
use demosift::run::experiment;
use demosift::run::experiment::Run;
use demosift::run::forecast::Goal;
use demosift::stages::imitate::LearningCurve;
use demosift::stages::select::Ranking;
use demosift::world::heuristic::Score;
use demosift::{Error, Result};
use serde_json::json;

use super::{dry_run, kept_in};
use crate::arguments::OracleArguments;
use crate::job::{Job, Prior};
use crate::tables::{self, Scale};
use crate::terminal;

/// What came of one demonstration alone.
struct Alone {
    demo: DemoId,
    /// Heuristic of the policy at the end of learning, one a repeat.
    scores: Vec<Score>,
    mean: Score,
}

pub(crate) fn run(arguments: &OracleArguments) -> Result<()> {
    if arguments.repeats == 0 {
        return Err(Error::bad_config("--repeats 0: must be at least 1"));
    }
    let mut job = Job::open(&arguments.job, Prior::NotNeeded)?;
    if arguments.job.run.dry_run {
        job.run(|run| kept(run, arguments.random))?;
        let goal = Goal::Oracle { repeats: arguments.repeats, random: arguments.random };
        return dry_run::of_job(&mut job, goal, &arguments.job.run);
    }
    let ids = job.set().ids();
    let (alone, ranking, worth) = job.run(|run| {
        let kept = kept(run, arguments.random)?;
        let (mut alone, mut curves) = (Vec::with_capacity(ids.len()), Vec::new());
        for &demo in &ids {
            let of_demo = (0..arguments.repeats)
                .map(|repeat| experiment::oracle(run, demo, repeat))
                .collect::<Result<Vec<_>>>()?;
            let scores: Vec<Score> = of_demo.iter().map(|curve| curve.end.score).collect();
            alone.push(Alone { demo, mean: statistics::mean(&scores), scores });
            curves.push(of_demo);
        }
        let worth = kept.map(|kept| worth(run, &kept, (&alone, &curves), arguments.random)).transpose()?;
        Ok((alone, Ranking::recall(run.ledger, "")?, worth))
    })?;
    let agreement = ranking.map(|ranking| Agreement::of(&ranking, &alone));
    if arguments.job.run.json {
        let rows: Vec<_> = alone
            .iter()
            .map(|Alone { demo, scores, mean }| json!({ "demo": demo, "scores": scores, "mean": mean }))
            .collect();
        terminal::show_json(&json!({
            "alone": rows,
            "spearman": agreement.as_ref().map(|agreement| agreement.spearman),
            "kendall": agreement.as_ref().map(|agreement| agreement.kendall),
            "hit_rates": agreement.as_ref().map(Agreement::hit_rates_json),
            "kept": worth.as_ref().map(Worth::as_json),
            "unit": job.unit(),
            "variant": job.variant(),
            "run_folder": job.folder().path(),
        }));
        return Ok(());
    }
    terminal::show(&table(alone, job.unit()));
    terminal::show(&match agreement {
        Some(agreement) => agreement.in_words(),
        None => "\nThe run folder holds no ranking to compare with; `demosift select` makes it.\n".to_owned(),
    });
    terminal::show(&worth.map_or(String::new(), |worth| worth.in_words(job.unit())));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(())
}

/// The policy from the kept demonstrations, which random subsets are compared with.
fn kept(run: &Run<'_>, random: usize) -> Result<Option<LearningCurve>> {
    let kept = LearningCurve::recall(run.ledger, "subset")?;
    if random > 0 && kept.is_none() {
        return Err(Error::bad_config("--random compares with the policy from the kept demonstrations, which the run folder does not hold")
            .with_hint("`demosift imitate --out DIR --resume` makes it"));
    }
    Ok(kept)
}

/// What the policy from the kept demonstrations is worth beside others.
struct Worth {
    score: Score,
    /// The best demonstration alone, and how much of the way to its policy that from the kept went.
    best: (DemoId, f64),
    random: Vec<Score>,
    against_random: AgainstRandom,
}

fn worth(
    run: &mut Run<'_>,
    kept: &LearningCurve,
    (alone, curves): (&[Alone], &[Vec<LearningCurve>]),
    random: usize,
) -> Result<Worth> {
    let random = (0..random)
        .map(|number| Ok(experiment::random_subset(run, kept.demos.len(), number)?.end.score))
        .collect::<Result<Vec<Score>>>()?;
    let best =
        alone.iter().rev().max_by(|a, b| a.mean.total_cmp(&b.mean)).expect("a set has demonstrations").demo;
    let shares = curves[best.0].iter().map(|alone| gain::share_of_best(kept, alone));
    let shares: Vec<f64> = shares.filter(|share| share.is_finite()).collect();
    let score = kept.end.score;
    let against_random = gain::against_random(score, &random);
    Ok(Worth { score, best: (best, statistics::mean(&shares)), random, against_random })
}

impl Worth {
    fn in_words(&self, unit: &str) -> String {
        let Self { score, best: (best, share), random, against_random } = self;
        let scale = Scale::of(random.iter().copied().chain([*score]), unit);
        let way = format!(
            "The policy from the kept demonstrations went {} of the way from an untrained policy to that from \
             demonstration {best} alone, the best.",
            tables::percent(*share)
        );
        let beside = format!(
            "It scores {}, which is {} beside the mean of {} random subsets of the same size, and beats {} of them.",
            scale.with_unit(*score),
            scale.signed(against_random.gain),
            random.len(),
            tables::percent(against_random.beaten)
        );
        let said = if random.is_empty() { vec![way] } else { vec![way, beside] };
        said.iter().map(|said| format!("\n{}\n", tables::wrapped(said))).collect()
    }

    fn as_json(&self) -> serde_json::Value {
        json!({
            "score": self.score,
            "best_alone": self.best.0,
            "share_of_best": self.best.1,
            "random": self.random,
            "against_random": (!self.random.is_empty()).then_some(self.against_random),
        })
    }
}

/// How well the suitabilities agree with what the demonstrations taught alone.
struct Agreement {
    spearman: f64,
    kendall: f64,
    /// K, and which share of the ranking's top K are among the top K alone.
    hit_rates: Vec<(usize, f64)>,
}

impl Agreement {
    /// Hit rates are at 2 and at half of the set, as far as these are less than all.
    fn of(ranking: &Ranking, alone: &[Alone]) -> Self {
        let (judged, taught): (Vec<Score>, Vec<Score>) = ranking
            .entries
            .iter()
            .filter_map(|entry| {
                alone.iter().find(|alone| alone.demo == entry.demo).map(|alone| (entry.score, alone.mean))
            })
            .unzip();
        let mut tops = vec![2, judged.len() / 2];
        tops.retain(|k| (1..judged.len()).contains(k));
        tops.sort_unstable();
        tops.dedup();
        Self {
            spearman: agreement::spearman(&judged, &taught),
            kendall: agreement::kendall(&judged, &taught),
            hit_rates: tops.into_iter().map(|k| (k, agreement::hit_rate(&judged, &taught, k))).collect(),
        }
    }

    fn in_words(&self) -> String {
        let Self { spearman, kendall, hit_rates } = self;
        let mut said = format!(
            "\nSpearman's rank correlation with the ranking: {spearman:.2}\nKendall's: {kendall:.2}\n"
        );
        for (k, rate) in hit_rates {
            let share = tables::percent(*rate);
            said += &format!("Of the ranking's first {k}, among the first {k} here: {share}\n");
        }
        said
    }

    fn hit_rates_json(&self) -> serde_json::Value {
        self.hit_rates.iter().map(|(k, rate)| json!({ "k": k, "rate": rate })).collect()
    }
}

fn table(mut alone: Vec<Alone>, unit: &str) -> String {
    alone.sort_by(|a, b| b.mean.total_cmp(&a.mean).then(a.demo.cmp(&b.demo)));
    let scale = Scale::of(alone.iter().flat_map(|alone| alone.scores.iter().copied()), unit);
    let title = scale.title("heuristic");
    let rows: Vec<Vec<String>> = alone
        .iter()
        .enumerate()
        .map(|(place, Alone { demo, scores, mean })| {
            let each: Vec<String> = scores.iter().map(|score| scale.plain(*score)).collect();
            vec![(place + 1).to_string(), demo.to_string(), scale.plain(*mean), each.join(", ")]
        })
        .collect();
    let what = "What a policy learns from scratch from each demonstration alone (higher is better):";
    format!("{what}\n\n{}", tables::table(&["rank", "demonstration", &title, "each seed"], &rows))
}
