//! `demosift oracle`: each demonstration alone from scratch, what rankings are compared with.

use demosift::artifact::Artifact;
use demosift::demonstration::DemoId;
use demosift::heuristic::Score;
use demosift::select::Ranking;
use demosift::{Error, Result, experiment, metrics};
use serde_json::json;

use super::kept_in;
use crate::arguments::OracleArguments;
use crate::job::Job;
use crate::tables::{self, Scale};
use crate::terminal;

/// What came of one demonstration alone.
struct Alone {
    demo: DemoId,
    /// Heuristic of the policy, one a repeat.
    scores: Vec<Score>,
    mean: Score,
}

pub(crate) fn run(arguments: &OracleArguments) -> Result<()> {
    if arguments.repeats == 0 {
        return Err(Error::bad_config("--repeats 0: must be at least 1"));
    }
    let mut job = Job::open(&arguments.job)?;
    let ids = job.set().ids();
    let (alone, ranking) = job.run(|run| {
        let mut alone = Vec::with_capacity(ids.len());
        for &demo in &ids {
            let scores = (0..arguments.repeats)
                .map(|repeat| experiment::oracle(run, demo, repeat).map(|curve| curve.outcome.score))
                .collect::<Result<Vec<_>>>()?;
            let mean = metrics::mean(&scores);
            alone.push(Alone { demo, scores, mean });
        }
        Ok((alone, Ranking::recall(run.ledger, "")?))
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
            "unit": job.unit(),
            "run_folder": job.folder().path(),
        }));
        return Ok(());
    }
    terminal::show(&table(alone, job.unit()));
    terminal::show(&match agreement {
        Some(agreement) => agreement.in_words(),
        None => "\nThe run folder holds no ranking to compare with; `demosift select` makes it.\n".to_owned(),
    });
    terminal::show(&kept_in(job.folder()));
    Ok(())
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
            spearman: metrics::spearman(&judged, &taught),
            kendall: metrics::kendall(&judged, &taught),
            hit_rates: tops.into_iter().map(|k| (k, metrics::hit_rate(&judged, &taught, k))).collect(),
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
