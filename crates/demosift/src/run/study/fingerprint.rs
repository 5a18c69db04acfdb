//! What a cell depends on besides its work, so that it is believed only while all of that is the same.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Work;
use crate::basics::files;
use crate::results::panel::Judges;
use crate::run::experiment::{Config, FULL_EFFORT_UP_TO, NEAR_CUT};

/// What a cell was made with.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fingerprint {
    /// The version of demosift.
    pub demosift: String,
    /// Name and variant, and the hash of a user's own files.
    pub task: String,
    /// Hash of the demonstrations, and which episodes of them.
    pub set: String,
    /// Hash of the values that enter the work, as [`hash_of_entering`] makes it.
    pub configuration: String,
}

impl Fingerprint {
    /// What differs, in words.
    pub fn difference(&self, now: &Self) -> Option<&'static str> {
        let pairs = [
            ("another version of demosift", &self.demosift, &now.demosift),
            ("another task", &self.task, &now.task),
            ("other demonstrations", &self.set, &now.set),
            ("another configuration", &self.configuration, &now.configuration),
        ];
        pairs.into_iter().find(|(_, old, now)| old != now).map(|(what, _, _)| what)
    }
}

const NEAR: &str = "near_cut";
const PORTABLE: &str = "portable";
const SCORED_ON: &str = "scored_on";
/// No study asks somebody else's trainer to judge.
const TRAINER_JUDGE: &str = "trainer_judge";

/// The hash of the values that enter some work; imitator and seed stand in the work itself.
pub fn hash_of_entering(work: &Work, config: &Config) -> String {
    let mut values = serde_json::to_value(config).expect("a configuration is plain data");
    if let Value::Object(fields) = &mut values {
        fields.retain(|key, _| enters(work, config.judges, key));
    }
    take_out(&mut values, "/imitate/update", "imitation", |_| true);
    for (table, key, before) in values_before_they_were_there() {
        take_out(&mut values, table, key, |value| *value == before);
    }
    let plays_batches_that_score =
        !matches!(work, Work::Weighing { .. }) && !config.judge.scoring_batches(&config.inner).is_empty();
    take_out(&mut values, "/judge", SCORED_ON, |_| !plays_batches_that_score);
    files::sha256_of(values.to_string().as_bytes())
}

/// Values that there were not always, by their table and name: cells of before are still right where they change nothing of them.
fn values_before_they_were_there() -> [(&'static str, &'static str, Value); 6] {
    [
        ("", NEAR, Value::from(NEAR_CUT)),
        ("", PORTABLE, Value::from(false)),
        ("/cloning_judge", "full_effort_up_to", Value::from(FULL_EFFORT_UP_TO)),
        ("/cloning_judge/judging", SCORED_ON, Value::from("evaluations")),
        ("/inner/discriminator", "most_told", Value::from(1.0)),
        ("/imitate/update/discriminator", "most_told", Value::from(1.0)),
    ]
}

fn take_out(values: &mut Value, table: &str, key: &str, is_meant: impl Fn(&Value) -> bool) {
    if let Some(Value::Object(table)) = values.pointer_mut(table)
        && table.get(key).is_some_and(is_meant)
    {
        table.remove(key);
    }
}

/// Whether some part of the configuration can change what a cell finds; `keep` does, as repeats race for its cut.
fn enters(work: &Work, judges: Judges, key: &str) -> bool {
    const NEVER_JUDGES: [&str; 5] = ["seed", "imitate", "subset_selection", "referee", "judged_for"];
    const NEVER_WEIGHS: [&str; 7] = ["seed", "imitate", "referee", "cloning_judge", "judges", "keep", NEAR];
    const PAPER_ALONE: [&str; 5] = ["method", "inner", "meta_train", "mutual_information", "judge"];
    match (work, judges) {
        _ if key == TRAINER_JUDGE => false,
        // One judge judges everybody.
        (Work::Judging { .. }, Judges::Cloning | Judges::Paper) if key == NEAR => false,
        (Work::Training { .. }, _) => ["policy", "imitate", PORTABLE].contains(&key),
        (Work::Weighing { .. }, _) => !NEVER_WEIGHS.contains(&key),
        (Work::Judging { .. }, _) if NEVER_JUDGES.contains(&key) => false,
        (Work::Judging { .. }, Judges::Cloning) => !PAPER_ALONE.contains(&key),
        (Work::Judging { .. }, Judges::Paper) => key != "cloning_judge",
        (Work::Judging { .. }, Judges::Both | Judges::Trainer) => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::adapt::{InnerUpdate, Rule};
    use crate::run::experiment::TrainerJudge;
    use crate::run::preset::Preset;
    use crate::stages::judge::{Judging, ScoredOn};

    /// What scores enters where batches do, and nowhere else: cells of before stay right where they are scored as then.
    #[test]
    fn what_scores_enters_where_batches_do() {
        let (set, method) = ("set".to_owned(), "method".to_owned());
        let judging = Work::Judging { set: set.clone(), method: method.clone(), seed: 0 };
        let weighing = Work::Weighing { set, method, seed: 0 };
        let by = |judges, imitation| {
            let config = Preset::Quick.config();
            Config { judges, inner: InnerUpdate { imitation, ..config.inner.clone() }, ..config }
        };
        let differs = |work: &Work, config: &Config| {
            let judge = Judging { scored_on: ScoredOn::Evaluations, ..config.judge.clone() };
            hash_of_entering(work, config) != hash_of_entering(work, &Config { judge, ..config.clone() })
        };
        assert!(differs(&judging, &by(Judges::Paper, Rule::Gail)));
        assert!(!differs(&judging, &by(Judges::Paper, Rule::BehavioralCloning)));
        assert!(!differs(&judging, &by(Judges::Cloning, Rule::Gail)));
        assert!(!differs(&weighing, &by(Judges::Paper, Rule::Gail)));
    }

    /// Cells of before a trainer could judge stay right, whatever is said of it.
    #[test]
    fn how_a_trainer_would_judge_enters_no_cell() {
        let (set, method) = ("set".to_owned(), "method".to_owned());
        let judging = Work::Judging { set: set.clone(), method: method.clone(), seed: 0 };
        for work in [judging, Work::Weighing { set, method, seed: 0 }] {
            for judges in [Judges::Cloning, Judges::Paper, Judges::Both] {
                assert!(!enters(&work, judges, TRAINER_JUDGE));
                let config = Config { judges, ..Preset::Quick.config() };
                let repeats = TrainerJudge { repeats: 7, ..TrainerJudge::default() };
                let other = Config { trainer_judge: repeats, ..config.clone() };
                assert_eq!(hash_of_entering(&work, &config), hash_of_entering(&work, &other));
            }
        }
    }
}
