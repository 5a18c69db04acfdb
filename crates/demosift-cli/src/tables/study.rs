//! The tables of a study, plain or in Markdown.

use demosift::learning::adapt::Rule;
use demosift::run::study::compact::Compact;
use demosift::run::study::estimate::{Difference, ENOUGH_SEEDS, Estimate};
use demosift::run::study::summary::{Compared, SetSummary, Summary};
use demosift::run::study::{RefereedSummary, Work, imitator_name};
use demosift::stages::referee::ConclusionRates;
use serde::Serialize;

use super::{Scale, percent, rounded, table, wrapped};

/// A table with a line above it, and perhaps words below.
pub(crate) struct Section {
    pub(crate) title: String,
    pub(crate) header: Vec<String>,
    pub(crate) rows: Vec<Vec<String>>,
    pub(crate) below: String,
}

impl Section {
    /// With nothing below.
    pub(crate) fn of(title: &str, header: &[&str], rows: Vec<Vec<String>>) -> Self {
        Self { title: title.to_owned(), header: words(header), rows, below: String::new() }
    }

    /// For a terminal; nothing without rows.
    pub(crate) fn plainly(&self) -> String {
        let Self { title, rows, below, .. } = self;
        if rows.is_empty() {
            return String::new();
        }
        let below = if below.is_empty() { String::new() } else { format!("\n{}\n", said(below, false)) };
        format!("\n{title}\n\n{}{below}", table(&self.words(), rows))
    }

    /// The table in Markdown.
    pub(crate) fn in_markdown(&self) -> String {
        in_markdown(&self.words(), &self.rows)
    }

    /// Without a column that is told elsewhere.
    fn without(mut self, column: &str) -> Self {
        if let Some(at) = self.header.iter().position(|word| word == column) {
            self.header.remove(at);
            self.rows.iter_mut().for_each(|row| drop(row.remove(at)));
        }
        self
    }

    fn words(&self) -> Vec<&str> {
        self.header.iter().map(String::as_str).collect()
    }
}

/// The tables of a study that an experiment's page has too.
pub(crate) fn of_experiment(summary: &Summary) -> [Section; 3] {
    let below = "Seconds are those of one processor.".to_owned();
    [agreement(summary), differences(summary), Section { below, ..costs(summary).without("ABD") }]
}

/// All tables that have a row.
pub(crate) fn in_full(compact: &Compact, summary: &Summary, markdown: bool) -> String {
    let [finished, named] = summary.finished;
    let mut told = format!("Study {}: {finished} of {named} cells are finished.\n", compact.study.name);
    let sections = [
        agreement(summary),
        steadiness(summary),
        differences(summary),
        regret(summary),
        costs(summary),
        pools(compact, summary),
        referees(summary),
    ];
    for section in sections.iter().filter(|section| !section.rows.is_empty()) {
        if !markdown {
            told += &section.plainly();
            continue;
        }
        told += &format!("\n{}\n\n{}", section.title, section.in_markdown());
        if !section.below.is_empty() {
            told += &format!("\n{}\n", said(&section.below, markdown));
        }
    }
    for note in &compact.notes {
        told += &format!("\n{}\n", said(note, markdown));
    }
    for (name, error) in &summary.failures {
        told += &format!("\n{}\n", said(&format!("The cell {name} failed: {error}."), markdown));
    }
    told
}

/// Markdown has one sentence per line, whatever its length.
fn said(words: &str, markdown: bool) -> String {
    if markdown { words.replace(". ", ".\n") } else { wrapped(words) }
}

pub(crate) fn in_markdown(header: &[&str], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | ").replace("~", r"\~"));
    let header: Vec<String> = header.iter().map(|&cell| cell.to_owned()).collect();
    let rule = format!("|{}\n", "---|".repeat(header.len()));
    std::iter::once(line(&header)).chain([rule]).chain(rows.iter().map(|row| line(row))).collect()
}

fn words(header: &[&str]) -> Vec<String> {
    header.iter().map(|&word| word.to_owned()).collect()
}

fn agreement(summary: &Summary) -> Section {
    let header = words(&["set", "truth", "judge", "Spearman", "Kendall", "hit rates at K", "seeds"]);
    let mut rows = Vec::new();
    for set in &summary.sets {
        for of in &set.agreement {
            let judge = of.method.clone().unwrap_or_else(|| "(ceiling)".to_owned());
            let mut row = vec![set.set.clone(), of.truth.to_string(), judge];
            row.extend([interval_of_correlation(&of.spearman), format!("{:.2}", of.kendall.mean)]);
            let hits = set.hits_at.iter().zip(&of.hit_rates);
            row.push(hits.map(|(k, rate)| format!("{k}: {:.2}", rate.mean)).collect::<Vec<_>>().join(", "));
            row.push(of.spearman.seeds.to_string());
            rows.push(row);
        }
    }
    let below = "Spearman is the mean over seeds with its 95 % interval by percentile bootstrap. The ceiling is the oracle \
                 against itself: each of its seeds against the mean of the others, as the judges are; its interval is of few \
                 seeds that depend on each other, and those of the judges take the oracle as it is. A judge that clones \
                 is not held against an oracle by cloning.";
    Section {
        title: "How well each judge agrees with the truth:".to_owned(),
        header,
        rows,
        below: below.to_owned(),
    }
}

fn steadiness(summary: &Summary) -> Section {
    let header = ["set", "truth", "judge", "one seed with another", "one seed", "all together", "seeds"];
    let mut rows = Vec::new();
    for set in &summary.sets {
        for of in &set.steadiness {
            let mut row = vec![set.set.clone(), of.truth.to_string(), of.method.clone()];
            row.extend([of.between_seeds, of.one_seed, of.together].map(|value| format!("{value:.2}")));
            row.push(of.seeds.to_string());
            rows.push(row);
        }
    }
    let below = "Spearman's correlation: of one seed with another, of one seed with the truth, and of the mean score of all \
                 seeds with the truth. Where seeds differ and together agree better, a judge lacks repeats; where they agree \
                 with each other and not with the truth, more of the same does not help.";
    Section {
        title: "How much of it is the luck of a seed:".to_owned(),
        header: words(&header),
        rows,
        below: below.to_owned(),
    }
}

/// A correlation with its interval.
pub(crate) fn interval_of_correlation(of: &Estimate) -> String {
    if of.seeds == 1 {
        return format!("{:.2}", of.mean);
    }
    format!("{:.2} [{:.2}, {:.2}]", of.mean, of.low, of.high)
}

fn differences(summary: &Summary) -> Section {
    let row = |set: &str, of: &Compared| {
        let found = of.difference;
        let judges = format!("{} − {}", of.method, of.other);
        vec![
            set.to_owned(),
            of.truth.to_string(),
            judges,
            difference(&found),
            separable(of),
            found.pairs.to_string(),
        ]
    };
    let of_set = |set: &SetSummary| set.differences.iter().map(|of| row(&set.set, of)).collect::<Vec<_>>();
    let mut rows: Vec<Vec<String>> = summary.sets.iter().flat_map(of_set).collect();
    // Of a single set it is said above.
    let over_sets = summary.over_sets.iter().filter(|of| of.sets > 1);
    rows.extend(over_sets.map(|of| row(&format!("all {}", of.sets), &of.compared)));
    let below = "Differences of Spearman's correlation, paired by seed, with a 95 % interval by Student's t that holds the luck of \
                 the judge's seeds and, by the jackknife, that of the oracle's; over all sets, which count alike, with the degrees of \
                 freedom of Welch and Satterthwaite, and with the pairs of the set that has the fewest. Fewer than ten pairs a set, or \
                 an oracle of one seed, decide nothing.";
    Section {
        title: "Which judge is the better one:".to_owned(),
        header: words(&["set", "truth", "judges", "difference", "verdict", "pairs"]),
        rows,
        below: below.to_owned(),
    }
}

fn difference(of: &Difference) -> String {
    match of.interval {
        Some([low, high]) => format!("{:+.2} [{low:+.2}, {high:+.2}]", of.mean),
        None => format!("{:+.2}", of.mean),
    }
}

fn separable(of: &Compared) -> String {
    let better = if of.difference.mean > 0.0 { &of.method } else { &of.other };
    match of.separable {
        _ if !of.difference.can_decide() => "too few seeds".to_owned(),
        true => format!("{better} is better"),
        false => "not separable".to_owned(),
    }
}

fn regret(summary: &Summary) -> Section {
    let mut rows = Vec::new();
    for set in &summary.sets {
        let scale = Scale::of(set.regret.iter().map(|of| of.regret.mean), &set.unit);
        for of in &set.regret {
            let share = of.share.map_or("-".to_owned(), |share| percent(share.mean));
            rows.push(vec![
                set.set.clone(),
                imitator_name(of.imitator).to_owned(),
                of.k.to_string(),
                of.method.clone(),
                interval(&of.regret, scale),
                share,
                of.regret.seeds.to_string(),
            ]);
        }
    }
    let below = "Regret is how much worse the policy from a judge's top K is at the end of its training than that from the \
                 truly best K, with the same trainings; lower is better. The share is of what the best demonstration alone \
                 is above the mean of all alone. At K = 1 the best is chosen by other \
                 trainings of the oracle than the one that scores it, so a judge can do better than that choice.";
    Section {
        title: "What it costs to believe a judge:".to_owned(),
        header: words(&["set", "imitator", "K", "judge", "regret", "share", "seeds"]),
        rows,
        below: below.to_owned(),
    }
}

fn interval(of: &Estimate, scale: Scale<'_>) -> String {
    if of.seeds == 1 {
        return scale.with_unit(of.mean);
    }
    let ends = format!("{} [{}, {}]", scale.plain(of.mean), scale.plain(of.low), scale.plain(of.high));
    format!("{ends} {}", scale.unit).trim_end().to_owned()
}

fn costs(summary: &Summary) -> Section {
    let mut rows = Vec::new();
    for set in &summary.sets {
        for of in &set.costs {
            let distance = of.adapted_behaviors_distance;
            rows.push(vec![
                set.set.clone(),
                of.method.clone(),
                rounded(of.steps_once),
                rounded(of.steps_each),
                format!("{:.1}", of.seconds_once),
                format!("{:.2}", of.seconds_each),
                distance.map_or("-".to_owned(), |distance| format!("{distance:.2}")),
                of.seeds.to_string(),
            ]);
        }
    }
    Section {
        title: "What judging costs, once and for each demonstration:".to_owned(),
        header: words(&["set", "judge", "steps once", "steps each", "s once", "s each", "ABD", "seeds"]),
        rows,
        below: "Seconds are those of one processor. ABD is the adapted behaviors distance.".to_owned(),
    }
}

fn pools(compact: &Compact, summary: &Summary) -> Section {
    let mut rows = Vec::new();
    for pool in &summary.pools {
        let Some(means) = pool.means() else { continue };
        let unit = compact.study.set(&pool.set).map_or("", |set| set.unit.as_str());
        let scale = Scale::of([means.end.mean, means.chosen.mean], unit);
        rows.push(vec![
            pool.set.clone(),
            pool.subset.clone(),
            imitator_name(pool.imitator).to_owned(),
            interval(&means.end, scale),
            interval(&means.chosen, scale),
            means.success.map_or("-".to_owned(), percent),
            means.true_return.map_or("-".to_owned(), |of| interval(&of, Scale::of([of.mean], ""))),
            rounded(means.environment_steps),
            format!("{:.0}", means.seconds),
            pool.trainings.len().to_string(),
        ]);
    }
    Section {
        title: "What policies learn from subsets:".to_owned(),
        header: words(&[
            "set", "subset", "imitator", "at the end", "the chosen", "success", "true return", "steps", "s", "trainings",
        ]),
        rows,
        below: "Success is that at the end of the training, the true return that of the chosen policy. Steps, evaluations \
                among them, and seconds of a processor are those of one training. Intervals are of 95 %, by Student's t \
                over trainings."
            .to_owned(),
    }
}

fn referees(summary: &Summary) -> Section {
    let row = |of: &RefereedSummary| {
        let ConclusionRates { helps, helps_upper, fewer_helps, cannot_tell, does_not_help, .. } = of.rates;
        let shares = [fewer_helps, cannot_tell, does_not_help].map(in_tenths);
        let helps = format!("{} (below {})", in_tenths(helps), in_tenths(helps_upper));
        let mut row = vec![of.set.clone(), of.kept.clone(), of.with.to_string(), helps];
        row.extend(shares);
        row.push(of.pool.to_string());
        row
    };
    let resamples = summary.referees.first().map_or(0, |of| of.rates.resamples);
    Section {
        title: "What the referee says of trainings that are drawn again:".to_owned(),
        header: words(&[
            "set",
            "kept",
            "trainings",
            "helps",
            "fewer help",
            "cannot tell",
            "does not help",
            "pool",
        ]),
        rows: summary.referees.iter().map(row).collect(),
        below: format!(
            "Each line is of {resamples} decisions on trainings that are drawn from pools, with replacement; the pool is the size \
             of the smallest. In brackets is the upper limit of the rate with 95 % confidence (Clopper and Pearson), which \
             holds for these pools. Where nothing is better, *helps* is an error."
        ),
    }
}

/// A percentage with a tenth.
fn in_tenths(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// Cells of one kind that are still to be made.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct Kind {
    pub(crate) name: String,
    pub(crate) cells: usize,
    pub(crate) environment_steps: u64,
    /// At the pace of the finished cells of this kind, if there are any.
    pub(crate) processor_hours: Option<f64>,
}

/// The kind of some work.
pub(crate) fn kind(work: &Work) -> String {
    match work {
        Work::Judging { method, .. } => format!("judging by {method}"),
        Work::Weighing { method, .. } => format!("weighing by {method}"),
        Work::Training { imitator: Rule::Gail, .. } => "training by gail".to_owned(),
        Work::Training { imitator: Rule::BehavioralCloning, .. } => "training by cloning".to_owned(),
    }
}

/// What a study would do.
pub(crate) fn forecast(kinds: &[Kind], finished: usize, later: usize, notes: &[String]) -> String {
    let rows: Vec<Vec<String>> = kinds
        .iter()
        .map(|of| {
            let hours = of.processor_hours.map_or("-".to_owned(), |hours| format!("{hours:.1}"));
            vec![of.name.clone(), of.cells.to_string(), rounded(of.environment_steps as f64), hours]
        })
        .collect();
    let mut told = format!("{finished} cells are finished.\n");
    if !rows.is_empty() {
        let table = table(&["kind of cell", "cells", "environment steps", "hours"], &rows);
        told += &format!("\nStill to be made:\n\n{table}");
        let known = kinds.iter().filter(|of| of.processor_hours.is_some()).count();
        told += match known {
            0 => "\nHow many hours that is, is known once a cell of each kind is finished.\n",
            _ => "\nHours are those of one processor, at the pace of the finished cells of the same kind.\n",
        };
    }
    if later > 0 {
        told += &format!("\nUp to {later} trainings more depend on what judging finds.\n");
    }
    notes.iter().for_each(|note| told += &format!("\n{}\n", wrapped(note)));
    told
}

const _: () = assert!(ENOUGH_SEEDS == 10, "the words below the tables say ten");
