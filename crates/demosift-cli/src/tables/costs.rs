//! What the stages of a run cost in environment steps, beside the budget that all methods have.

use demosift::stages::demonstrator;
use demosift::stages::meta_train;
use demosift::stages::method::{Account, Costs};
use demosift::stages::pre_train;
use demosift::stages::referee;
use demosift::stages::subset_selection;

use super::{table, wrapped};

/// A stage a row.
pub(crate) fn played(costs: &Costs) -> String {
    if costs.spent.is_empty() {
        return String::new();
    }
    let of_the_method = match costs.spent.iter().any(|(stage, _)| *stage == costs.judging) {
        true => format!(
            " Every method of the paper may spend {} on learning to imitate and judging; {} spent {} of them.",
            costs.budget.quota,
            costs.method,
            costs.of_quota()
        ),
        false => String::new(),
    };
    stages(costs, &format!("{of_the_method}{}{}", account(costs), unlike(costs)))
}

/// What a set that grows pays once, and for each further demonstration.
fn account(costs: &Costs) -> String {
    match costs.account() {
        Some(Account { once: 0, each }) => {
            format!(" By the judge of the paper each demonstration took {each}.")
        }
        Some(Account { once, each }) => {
            format!(
                " By the judge of the paper {once} are paid once, and each demonstration took {each} on top."
            )
        }
        None => String::new(),
    }
}

/// Of which arithmetic the results are, where that is not one.
fn unlike(costs: &Costs) -> String {
    let names: Vec<String> = costs.arithmetic().iter().map(ToString::to_string).collect();
    match names.len() {
        0 | 1 => String::new(),
        _ => format!(
            " It was computed by unlike processors ({}), so another run with this seed may differ; with --portable it does not.",
            names.join(", ")
        ),
    }
}

/// The same of a run that was given its prior, and so has no budget to be held against.
pub(crate) fn played_from_given(costs: &Costs) -> String {
    stages(costs, "")
}

fn stages(costs: &Costs, remark: &str) -> String {
    let rows: Vec<Vec<String>> = costs
        .spent
        .iter()
        .map(|(stage, spent)| vec![in_words(stage), spent.environment_steps.to_string()])
        .collect();
    let what = format!("What was played, in environment steps.{remark}");
    format!("\n{}\n\n{}", wrapped(&what), table(&["stage", "environment steps"], &rows))
}

/// A stage by what it does.
pub(super) fn in_words(stage: &str) -> String {
    match stage {
        meta_train::STAGE => "learning to imitate",
        pre_train::STAGE => "imitating the entire set",
        "judge_cloning" => "judging by cloning",
        "judge_paper" => "judging by the paper's judge",
        "judge_trainer" => "judging by your own trainer",
        subset_selection::STAGE => "weighing",
        referee::STAGE => "final policies, several each",
        "imitate_subset" => "from scratch, the kept",
        "imitate_all" => "from scratch, all",
        "oracle" => "from scratch, each alone",
        "random_subsets" => "from scratch, random subsets",
        demonstrator::STAGE => "training the demonstrator",
        "record" => "recording",
        other if other.starts_with("imitate_subset_keep_") => "from scratch, the kept",
        other => return other.replace("imitate_demonstrations_", "from scratch, ").replace('_', ", "),
    }
    .to_owned()
}
