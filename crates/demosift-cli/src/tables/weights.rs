//! The trends of the weights (Fig. 9).

use demosift::stages::subset_selection::{Weighing, WeighingEnd};

use super::{is_kept, table, wrapped};

/// So many rounds fit beside each other.
const MOST_COLUMNS: usize = 10;

/// The weight of each demonstration after each round, the heaviest first, and why it ended.
pub(crate) fn trends(weighing: &Weighing) -> String {
    let Some(last) = weighing.rounds.last() else { return String::new() };
    let rounds = shown(weighing.rounds.len());
    let titles: Vec<String> = rounds.iter().map(|round| format!("round {}", round + 1)).collect();
    let mut header = vec!["demonstration"];
    header.extend(titles.iter().enumerate().map(|(place, title)| match place {
        0 => title.as_str(),
        _ => title.trim_start_matches("round "),
    }));
    header.push("kept");
    let mut weights: Vec<_> = last.weights.iter().collect();
    weights.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let rows: Vec<Vec<String>> = weights
        .into_iter()
        .map(|(demo, _)| {
            let trend = rounds.iter().map(|round| format!("{:.2}", weighing.rounds[*round].weights.of(demo)));
            let mut row = vec![demo.to_string()];
            row.extend(trend);
            row.push(is_kept(&weighing.demos, demo).to_owned());
            row
        })
        .collect();
    let count = weighing.rounds.len();
    let why = match weighing.end {
        WeighingEnd::Converged => format!("It ended after {count} rounds, as the subset no longer changed."),
        WeighingEnd::RoundLimit => format!(
            "It ended after {count} rounds, as many as were allowed: {}, and --set subset_selection.rounds={} would go further.",
            if weighing.demos.len() == last.weights.iter().count() {
                "the weight of none fell below the threshold, so all are kept"
            } else {
                "the same subset had not come out often enough in a row"
            },
            2 * count
        ),
    };
    format!(
        "How much each demonstration came to count, from 1 at first:\n\n{}\n{}\n",
        table(&header, &rows),
        wrapped(&why)
    )
}

/// All rounds, or some of them from the first to the last.
fn shown(count: usize) -> Vec<usize> {
    if count <= MOST_COLUMNS {
        return (0..count).collect();
    }
    (0..MOST_COLUMNS).map(|column| column * (count - 1) / (MOST_COLUMNS - 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_and_the_last_round_are_always_shown() {
        assert_eq!(shown(3), [0, 1, 2]);
        for count in 11..60 {
            let rounds = shown(count);
            assert_eq!((rounds[0], rounds[9], rounds.len()), (0, count - 1, 10));
            assert!(rounds.is_sorted_by(|a, b| a < b));
        }
    }
}
