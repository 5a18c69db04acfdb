//! What an experiment comes to, a line for each set and method: agreement with the oracle, what is lost, success, and the adapted
//! behaviors distance.

use demosift::learning::adapt::Rule;
use demosift::run::study::Against;
use demosift::run::study::imitator_name;
use demosift::run::study::summary::Summary;
use demosift::run::study::told::{LostLine, Told};

use crate::tables::differences::marked;
use crate::tables::study::interval_of_correlation;
use crate::tables::{Scale, percent};

pub(crate) const HEADER: [&str; 6] =
    ["set", "method", "Spearman with the oracle", "lost at K", "success at K", "ABD"];

pub(crate) const BELOW: &str = "Spearman is the mean over seeds with its 95 % interval; the oracle's is its own agreement, of one \
     of its seeds with the others, which is the ceiling. What is lost is the score of policies from the truly best K less that of \
     policies from the top K, paired by seed; bold is what does not hold 0. Success is that of the same policies. ABD is the adapted \
     behaviors distance, lower is better; that of cloning cannot be compared with the others.";

/// Of one set, imitator and method.
#[derive(Clone)]
pub(crate) struct Line {
    pub(crate) set: String,
    pub(crate) imitator: Rule,
    method: String,
    spearman: String,
    lost: String,
    success: String,
    distance: String,
    /// The fewest pairs of what is lost.
    pub(crate) pairs: usize,
}

impl Line {
    /// In the order of the header.
    pub(crate) fn row(&self) -> Vec<String> {
        let Self { set, method, spearman, lost, success, distance, .. } = self.clone();
        vec![set, method, spearman, lost, success, distance]
    }

    /// Whether two lines say the same thing, of cells that two experiments share.
    pub(crate) fn is_about_the_same(&self, other: &Self) -> bool {
        (&self.set, self.imitator, &self.method) == (&other.set, other.imitator, &other.method)
    }
}

/// Of each set where policies are held against those from the truly best.
pub(crate) fn lines(told: &Told, summary: &Summary) -> Vec<Line> {
    let mut asked: Vec<(&str, Rule)> = Vec::new();
    for of in &told.lost {
        if !asked.contains(&(of.set.as_str(), of.imitator)) {
            asked.push((of.set.as_str(), of.imitator));
        }
    }
    asked.into_iter().flat_map(|(set, imitator)| of_set(told, summary, set, imitator)).collect()
}

fn of_set(told: &Told, summary: &Summary, set: &str, imitator: Rule) -> Vec<Line> {
    let agreements = summary.sets.iter().filter(|of| of.set == set).flat_map(|of| &of.agreement);
    let agreements: Vec<_> = agreements.filter(|of| of.truth == Against::Oracle(imitator)).collect();
    let lost: Vec<&LostLine> =
        told.lost.iter().filter(|of| of.set == set && of.imitator == imitator).collect();
    let mut methods: Vec<Option<&String>> = Vec::new();
    for of in &lost {
        if !methods.contains(&of.method.as_ref()) {
            methods.push(of.method.as_ref());
        }
    }
    let spearman = |method: Option<&String>| {
        let of = agreements.iter().find(|of| of.method.as_ref() == method);
        of.map_or("-".to_owned(), |of| interval_of_correlation(&of.spearman))
    };
    let pairs = |method: Option<&String>| {
        let of_method = lost.iter().filter(|of| of.method.as_ref() == method);
        of_method.map(|of| of.lost.pairs).min().unwrap_or(0)
    };
    let line = |method: &Option<&String>| {
        let at_each_k = lost.iter().filter(|of| of.method.as_ref() == *method).map(|of| {
            let ends = of.lost.interval.into_iter().flatten();
            let scale = Scale::of([of.lost.mean].into_iter().chain(ends), &of.unit);
            format!(
                "{}: {}",
                of.kept,
                marked(&of.lost, format!("{} {}", scale.signed(of.lost.mean), of.unit).trim_end())
            )
        });
        let policies = told.policies.iter();
        let policies =
            policies.filter(|of| of.set == set && of.imitator == imitator && of.method.as_ref() == *method);
        let successes = policies.filter_map(|of| Some(format!("{}: {}", of.kept, percent(of.success?.mean))));
        let distance = told.distances.iter().find(|of| of.set == set && Some(&of.method) == *method);
        Line {
            set: set.to_owned(),
            imitator,
            method: method.map_or("(whole set)".to_owned(), Clone::clone),
            spearman: method.map_or("-".to_owned(), |method| spearman(Some(method))),
            lost: or_dash(at_each_k.collect()),
            success: or_dash(successes.collect()),
            distance: distance.map_or("-".to_owned(), |of| format!("{:.2}", of.distance.mean)),
            pairs: pairs(*method),
        }
    };
    let oracle = Line {
        set: set.to_owned(),
        imitator,
        method: format!("(oracle by {})", imitator_name(imitator)),
        spearman: spearman(None),
        lost: "-".to_owned(),
        success: "-".to_owned(),
        distance: "-".to_owned(),
        // What is lost is told beside it.
        pairs: methods.iter().map(|method| pairs(*method)).max().unwrap_or(0),
    };
    std::iter::once(oracle).chain(methods.iter().map(line)).collect()
}

fn or_dash(words: Vec<String>) -> String {
    if words.is_empty() { "-".to_owned() } else { words.join(", ") }
}
