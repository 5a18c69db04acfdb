//! The judgment of a set: the ranking with its doubts, and what the recordings alone say.

use demosift::data::demonstration::{DemoId, DemonstrationSet};
use demosift::results::data_only::Column;
use demosift::results::panel::Judge;
use demosift::results::uncertainty::Uncertainty;
use demosift::stages::judge::ScoreTable;
use demosift::stages::select::{Keep, Ranking, Subset};

use crate::job::own_heuristic::Beside;

use super::{Scale, WIDTH, is_kept, list, percent, table, wrapped};

/// What is shown of a judgment.
pub(crate) struct Judgment<'a> {
    pub(crate) set: &'a DemonstrationSet,
    pub(crate) ranking: &'a Ranking,
    pub(crate) uncertainty: &'a Uncertainty,
    pub(crate) unit: &'a str,
    /// K of the column P(top K), where it is not known yet how many are kept.
    pub(crate) k: usize,
}

/// What was kept, and what was asked for.
#[derive(Clone, Copy)]
pub(crate) struct Kept<'a> {
    pub(crate) subset: &'a Subset,
    pub(crate) keep: Keep,
}

/// What was kept of a ranking that stands on the screen already.
pub(crate) fn kept(judgment: &Judgment<'_>, kept: Kept<'_>) -> String {
    let demos = &kept.subset.demos;
    let one = if demos.len() == 1 { "demonstration" } else { "demonstrations" };
    let mut remarks = vec![format!(
        "The order stays that of the judge by cloning, above. Kept: {one} {} of {}.",
        list(demos),
        judgment.set.len()
    )];
    remarks.extend(about_kept(judgment, kept));
    remarks.iter().map(|remark| format!("{}\n", wrapped(remark))).collect::<Vec<_>>().join("\n")
}

/// The demonstrations from the most to the least suitable with their intervals, and which of them were kept.
pub(crate) fn ranking(judgment: &Judgment<'_>, kept: Option<Kept<'_>>) -> String {
    let Judgment { set, ranking, uncertainty, unit, .. } = judgment;
    let entries = &ranking.entries;
    let scale = Scale::of(entries.iter().flat_map(|entry| [entry.before, entry.after]), unit);
    let k = kept.map_or(judgment.k, |kept| kept.subset.demos.len()).min(set.len());
    let titles = [
        scale.title("after"),
        scale.title("gain"),
        format!("{} interval", percent(uncertainty.level)),
        format!("P(top {k})"),
    ];
    let mut header = vec!["rank", "demonstration", "steps"];
    header.extend(titles.iter().map(String::as_str));
    header.push("group");
    if kept.is_some() {
        header.push("kept");
    }
    let rows: Vec<Vec<String>> = entries
        .iter()
        .zip(&uncertainty.demonstrations)
        .enumerate()
        .map(|(place, (entry, doubt))| {
            let mut row = vec![
                (place + 1).to_string(),
                entry.demo.to_string(),
                set.get(entry.demo).steps().to_string(),
                scale.plain(entry.after),
                scale.signed(entry.gain),
                format!("[{}, {}]", scale.signed(doubt.low), scale.signed(doubt.high)),
                percent(doubt.top.at(k).unwrap_or(f64::NAN)),
                group(uncertainty, entry.demo),
            ];
            row.extend(kept.map(|kept| is_kept(&kept.subset.demos, entry.demo).to_owned()));
            row
        })
        .collect();
    let before = entries.first().map_or(f64::NAN, |entry| entry.before);
    let what = format!(
        "How good the agent is at the task after it imitates each demonstration (higher is better; before, it \
         scores {}):",
        scale.with_unit(before)
    );
    format!("{}\n\n{}{}", wrapped(&what), table(&header, &rows), remarks(judgment, kept))
}

/// How well the demonstrations were imitated, whatever that did for the task.
pub(crate) fn distance(scores: &ScoreTable, judge: Judge) -> String {
    let what = format!(
        "Adapted behaviors distance by {}, the mean over the demonstrations (the lower, the better they were imitated): {:.3}",
        super::panel::in_words(judge),
        scores.adapted_behaviors_distance()
    );
    format!("\n{}\n", wrapped(&what))
}

/// The number of the group that a demonstration belongs to.
fn group(uncertainty: &Uncertainty, demo: DemoId) -> String {
    let place = uncertainty.groups.iter().position(|group| group.contains(&demo));
    place.map_or("-".to_owned(), |place| (place + 1).to_string())
}

/// What the table does not say by itself, a paragraph each.
fn remarks(judgment: &Judgment<'_>, kept: Option<Kept<'_>>) -> String {
    let Judgment { uncertainty, .. } = judgment;
    let mut remarks = vec![if uncertainty.groups.len() > 1 {
        format!(
            "A group holds what cannot be told from its best, by the {} interval of their difference.",
            percent(uncertainty.level)
        )
    } else {
        "This budget can tell no demonstration from the best: their order may be chance.".to_owned()
    }];
    remarks.extend(uncertainty.caveat());
    remarks.extend(kept.map_or_else(Vec::new, |kept| about_kept(judgment, kept)));
    remarks.iter().map(|remark| format!("\n{}\n", wrapped(remark))).collect()
}

/// Why the kept were kept, and which of them did not help.
fn about_kept(judgment: &Judgment<'_>, Kept { subset, keep }: Kept<'_>) -> Vec<String> {
    let mut remarks = match keep {
        Keep::Auto => vec![why_kept(judgment.uncertainty, subset)],
        Keep::Weights => {
            vec!["Kept is what ended up heavy enough when the demonstrations were weighed.".to_owned()]
        }
        Keep::Quarter | Keep::Count(_) => Vec::new(),
    };
    remarks.extend(useless(judgment.ranking, subset));
    remarks
}

/// What `--keep auto` went by.
fn why_kept(uncertainty: &Uncertainty, subset: &Subset) -> String {
    let level = percent(uncertainty.level);
    let improves =
        |demo: &DemoId| uncertainty.of(*demo).is_some_and(|doubt| doubt.improves >= uncertainty.level);
    if !subset.demos.iter().all(improves) {
        return format!(
            "Nothing surely helps: no demonstration makes the agent better with a probability of {level}; kept were those \
             that may be the best."
        );
    }
    let all =
        if subset.demos.len() == uncertainty.demonstrations.len() { " That is all of them." } else { "" };
    format!(
        "Kept is what makes the agent better with a probability of {level} or more, and is not with as much nearer \
         to the median of the set than to its best.{all}"
    )
}

/// Says which of the kept demonstrations did not help.
fn useless(ranking: &Ranking, subset: &Subset) -> Option<String> {
    let entries = ranking.entries.iter().filter(|entry| entry.gain <= 0.0).map(|entry| entry.demo);
    let useless: Vec<DemoId> = entries.filter(|demo| subset.demos.contains(demo)).collect();
    match useless.as_slice() {
        [] => None,
        [demo] => Some(format!(
            "Demonstration {demo} was kept, although imitating it did not make the agent better."
        )),
        demos => Some(format!(
            "Demonstrations {} were kept, although imitating them did not make the agent better.",
            list(demos)
        )),
    }
}

/// What the scorers of the recordings say, in the order of the ranking, with their agreement with it.
pub(crate) fn beside(ranking: &Ranking, beside: &Beside) -> String {
    let columns: Vec<&Column> = beside.columns().collect();
    let unusable = beside.unusable.as_ref().map_or(String::new(), |why| {
        format!("\n{}\n", wrapped(&format!("The demonstrations' own heuristic is not known: {why}")))
    });
    if columns.is_empty() {
        return unusable;
    }
    let tables =
        side_by_side(&columns).map(|columns| opinions(ranking, columns)).collect::<Vec<_>>().join("\n");
    let what = "What the recordings alone say (higher is better by each scorer's lights; none of it enters the \
                ranking), and the rank correlation of each with the gain:";
    format!("\n{}\n\n{tables}{unusable}", wrapped(what))
}

/// As many columns as fit beside each other, table by table.
fn side_by_side<'c, 'b>(columns: &'c [&'b Column]) -> impl Iterator<Item = &'c [&'b Column]> {
    let width = |column: &Column| column.name.chars().count().max(9) + 3;
    let mut start = 0;
    std::iter::from_fn(move || {
        let mut end = start;
        let mut used = "  demonstration".len();
        while end < columns.len() && (end == start || used + width(columns[end]) <= WIDTH) {
            used += width(columns[end]);
            end += 1;
        }
        let found = (end > start).then(|| &columns[start..end]);
        start = end;
        found
    })
}

fn opinions(ranking: &Ranking, columns: &[&Column]) -> String {
    let header: Vec<&str> =
        ["demonstration"].into_iter().chain(columns.iter().map(|column| column.name.as_str())).collect();
    let mut rows: Vec<Vec<String>> = Vec::with_capacity(ranking.entries.len() + 1);
    for (entry, place) in ranking.entries.iter().zip(ranking.places_in_set()) {
        let scores = columns.iter().map(|column| significant(column.scores[place]));
        rows.push([entry.demo.to_string()].into_iter().chain(scores).collect());
    }
    let agreements = columns.iter().map(|column| column.agreement(ranking));
    let written =
        agreements.map(|value| value.map_or_else(|| "-".to_owned(), |value| format!("{value:+.2}")));
    rows.push(["Spearman".to_owned()].into_iter().chain(written).collect());
    table(&header, &rows)
}

/// Three significant digits, or all before the point.
fn significant(value: f64) -> String {
    let magnitude = value.abs();
    let decimals = match magnitude {
        100.0.. => 0,
        10.0.. => 1,
        1.0.. => 2,
        _ if magnitude.fract() == 0.0 => 0,
        _ => 3,
    };
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use demosift::basics::seed::Seed;
    use demosift::results::data_only::DataOnly;
    use demosift::results::uncertainty::{Chances, Doubt};
    use demosift::stages::select::Ranked;
    use demosift::world::point_mass::planted_set;

    fn ranking_of(scores: &[f64]) -> Ranking {
        let ranked = |(demo, score): (usize, &f64)| Ranked {
            demo: DemoId(demo),
            before: -100.0,
            after: -100.0 + score,
            gain: *score,
        };
        Ranking { entries: scores.iter().enumerate().map(ranked).collect() }
    }

    fn uncertainty(scores: &[f64]) -> Uncertainty {
        let doubt = |(demo, score): (usize, &f64)| Doubt {
            demo: DemoId(demo),
            gain: *score,
            low: score - 150.5,
            high: score + 150.5,
            improves: 0.95,
            near_best: 0.5,
            top: Chances::new(&vec![0.5; scores.len()]),
        };
        Uncertainty {
            level: 0.9,
            too_narrow: true,
            repeats: 1,
            evaluations: 5,
            demonstrations: scores.iter().enumerate().map(doubt).collect(),
            top_set: vec![0.2; scores.len()],
            groups: vec![(0..scores.len()).map(DemoId).collect()],
        }
    }

    #[test]
    fn tables_and_remarks_fit_a_terminal_of_100_columns() {
        let set = planted_set(&[0.0, 90.0, 180.0], Seed::new(1)).unwrap();
        let scores = [101.5, 12.0, -3.0];
        let (ranking, uncertainty) = (ranking_of(&scores), uncertainty(&scores));
        let judgment = Judgment { set: &set, ranking: &ranking, uncertainty: &uncertainty, unit: "m", k: 1 };
        let subset = Subset { demos: vec![DemoId(0), DemoId(2)] };
        let said = super::ranking(&judgment, Some(Kept { subset: &subset, keep: Keep::Auto }));
        assert!(said.lines().all(|line| line.chars().count() <= 100), "{said}");
        for wanted in [
            "before, it scores -100.0 m",
            "[-49.0, +252.0]",
            "P(top 2)",
            "can tell no demonstration",
            "imitated once",
            "Kept is what",
        ] {
            assert!(said.replace('\n', " ").contains(wanted), "{wanted}: {said}");
        }
        assert!(said.contains("Demonstration 2 was kept, although"), "{said}");
        let column = |name: &str| Column {
            name: name.to_owned(),
            meaning: String::new(),
            scores: vec![-1234.5, 0.25, 2.0],
        };
        let names = [
            "length",
            "jerk",
            "action range",
            "mutual information",
            "cloning loss",
            "arc length",
            "fast power",
        ];
        let data_only = DataOnly { columns: names.map(column).to_vec() };
        let opinions = Beside { data_only, own: Some(column("heuristic")), unusable: None };
        let said = beside(&ranking, &opinions);
        assert!(said.lines().all(|line| line.chars().count() <= 100), "{said}");
        assert!(said.contains("-1.00") && said.contains("0.250"), "{said}");
        assert!(said.contains("heuristic"), "{said}");
    }
}
