//! The configuration in layers: preset, the task's own values, `--config FILE`, then `--set key=value`.
//!
//! The preset holds every key there is. A layer may change values, but not bring keys that no one would read.

pub(crate) mod asked_again;
pub(crate) mod resolved;

use std::path::Path;

use demosift::basics::files;
use demosift::results::panel::Judge;
use demosift::run::experiment::{Config, TrainerJudge};
use demosift::run::preset::Preset;
use demosift::{Error, Result};
use serde::de::DeserializeOwned;
use toml::{Table, Value};

/// The table that `record` alone reads.
pub(crate) const DEMONSTRATOR: &str = "demonstrator";
const DEMONSTRATOR_VALUES: &str = include_str!("demonstrator.toml");

/// The table of the user's own trainer; the library does not read it.
pub(crate) const TRAINER: &str = "trainer";
/// The table of how it judges.
const TRAINER_JUDGE: &str = "trainer_judge";
/// The key of who judges, and its word for the trainer.
const JUDGES: &str = "judges";

/// Values and where they come from.
#[derive(Clone, Debug)]
pub(crate) struct Layer {
    /// For errors, such as `--set` or a file.
    pub(crate) source: String,
    pub(crate) values: Table,
}

impl Layer {
    /// One `--set key=value`; a value that is not TOML is a string.
    pub(crate) fn from_assignment(assignment: &str) -> Result<Self> {
        let source = format!("--set {assignment}");
        let wrong = || {
            Error::bad_config(format!("{source}: wanted key=value"))
                .with_hint("for example --set judge.iterations=3")
        };
        let (key, text) = assignment.split_once('=').ok_or_else(wrong)?;
        let mut path: Vec<&str> = key.split('.').map(str::trim).collect();
        let last = path.pop().filter(|last| !last.is_empty()).ok_or_else(wrong)?;
        let value =
            format!("value = {text}").parse::<Table>().ok().and_then(|mut table| table.remove("value"));
        let mut values = Table::from_iter([(
            last.to_owned(),
            value.unwrap_or_else(|| Value::String(text.trim().to_owned())),
        )]);
        for part in path.into_iter().rev() {
            values = Table::from_iter([(part.to_owned(), Value::Table(values))]);
        }
        Ok(Self { source, values })
    }

    /// A file that the user wrote.
    pub(crate) fn from_file(path: &Path) -> Result<Self> {
        if !path.exists() {
            return Err(Error::bad_input("the configuration file does not exist").at(path));
        }
        let text = files::read_text(path, "the configuration")?;
        Self::from_text(&path.display().to_string(), &text)
    }

    pub(crate) fn from_text(source: &str, text: &str) -> Result<Self> {
        let values = text.parse::<Table>().map_err(|error| {
            Error::bad_config(format!("{source} is not TOML: {}", error.to_string().trim_end()))
        })?;
        Ok(Self { source: source.to_owned(), values })
    }

    /// One value at the top, such as that of `--seed`.
    pub(crate) fn from_option(option: &str, key: &str, number: u64) -> Result<Self> {
        let number = i64::try_from(number)
            .map_err(|_| Error::bad_config(format!("{option} {number}: must be at most {}", i64::MAX)))?;
        let values = Table::from_iter([(key.to_owned(), Value::Integer(number))]);
        Ok(Self { source: option.to_owned(), values })
    }
}

/// All values of a preset for a task, whose own values may differ by preset in tables of that name.
pub(crate) fn preset(preset: Preset, task_values: Layer) -> Result<Table> {
    let mut values = Table::try_from(preset.config()).expect("a configuration is plain data");
    let demonstrator = Layer::from_text("the demonstrator's values", DEMONSTRATOR_VALUES)?;
    values.insert(DEMONSTRATOR.to_owned(), Value::Table(demonstrator.values));
    let Layer { source, values: mut common } = task_values;
    let mut chosen = Table::new();
    for (name, known) in Preset::ALL {
        match common.remove(name) {
            Some(Value::Table(table)) if known == preset => chosen = table,
            _ => {}
        }
    }
    apply(&mut values, &Layer { source: source.clone(), values: common })?;
    apply(&mut values, &Layer { source, values: chosen })?;
    Ok(values)
}

/// Makes place for what is asked of a trainer, so that a layer may change it; see [`of_job`].
pub(crate) fn with_trainings_by_trainer(values: &mut Table) {
    if let Some(Value::Table(referee)) = values.get_mut("referee") {
        referee.entry(TRAINER).or_insert(Value::Integer(0));
    }
    let how = Table::try_from(TrainerJudge::default()).expect("numbers are plain data");
    values.entry(TRAINER_JUDGE).or_insert(Value::Table(how));
}

/// Whether the user's own trainer judges.
pub(crate) fn is_judged_by_trainer(values: &Table) -> bool {
    values.get(JUDGES).and_then(Value::as_str) == Some(Judge::Trainer.name())
}

/// Changes the values of `base` to those of a layer; a key that `base` lacks, or a value of another type, is an error.
pub(crate) fn apply(base: &mut Table, layer: &Layer) -> Result<()> {
    merge(base, &layer.values, &layer.source, "")
}

fn merge(base: &mut Table, changes: &Table, source: &str, parent: &str) -> Result<()> {
    for (key, change) in changes {
        let name = if parent.is_empty() { key.clone() } else { format!("{parent}.{key}") };
        if !base.contains_key(key) {
            return Err(unknown(&name, base, source, parent));
        }
        match (&mut base[key], change) {
            (Value::Table(inner), Value::Table(changes)) => merge(inner, changes, source, &name)?,
            (value @ Value::Float(_), Value::Integer(number)) => *value = Value::Float(*number as f64),
            // What is a word or a number, such as `keep`, is written as a string.
            (value @ Value::String(_), Value::Integer(number)) => *value = Value::String(number.to_string()),
            (value, change) if value.same_type(change) => *value = change.clone(),
            (value, change) => {
                let example = if value.is_table() { String::new() } else { format!(" such as {value}") };
                return Err(Error::bad_config(format!(
                    "{name} = {change} (from {source}) is of type {}, and must be of type {}{example}",
                    change.type_str(),
                    value.type_str()
                )));
            }
        }
    }
    Ok(())
}

fn unknown(name: &str, base: &Table, source: &str, parent: &str) -> Error {
    let known: Vec<&str> = base.keys().map(String::as_str).collect();
    let place = if parent.is_empty() { "at the top".to_owned() } else { format!("in {parent}") };
    Error::bad_config(format!(
        "there is no key {name} (from {source}); {place} there are: {}",
        known.join(", ")
    ))
}

/// What a job depends on: everything but the demonstrator's training. Of a trainer that is not asked it says nothing.
pub(crate) fn of_job(mut values: Table) -> Table {
    values.remove(DEMONSTRATOR);
    if let Some(Value::Table(referee)) = values.get_mut("referee")
        && referee.get(TRAINER) == Some(&Value::Integer(0))
    {
        referee.remove(TRAINER);
    }
    if !is_judged_by_trainer(&values) {
        values.remove(TRAINER_JUDGE);
    }
    values
}

/// The same as the library takes it.
pub(crate) fn config_of_job(mut values: Table) -> Result<Config> {
    values.remove(TRAINER);
    typed(values)
}

/// What a recording depends on: the demonstrator's training and the seed.
pub(crate) fn of_recording(values: Table) -> Table {
    values.into_iter().filter(|(key, _)| key == DEMONSTRATOR || key == "seed").collect()
}

/// The values as the library takes them.
pub(crate) fn typed<T: DeserializeOwned>(values: Table) -> Result<T> {
    Value::Table(values)
        .try_into()
        .map_err(|error| Error::bad_config(format!("the configuration: {}", error.to_string().trim_end())))
}

/// The first key whose value differs, with both values.
pub(crate) fn first_difference(old: &Table, new: &Table) -> Option<(String, String, String)> {
    let mut keys: Vec<&String> = old.keys().chain(new.keys()).collect();
    keys.sort();
    keys.dedup();
    keys.into_iter().find_map(|key| match (old.get(key), new.get(key)) {
        (Some(Value::Table(old)), Some(Value::Table(new))) => {
            first_difference(old, new).map(|(inner, old, new)| (format!("{key}.{inner}"), old, new))
        }
        (old, new) if old == new => None,
        (old, new) => {
            let show = |value: Option<&Value>| value.map_or("not there".to_owned(), ToString::to_string);
            Some((key.clone(), show(old), show(new)))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use demosift::stages::demonstrator::DemonstratorTraining;
    use demosift::stages::select::Keep;

    fn plain(chosen: Preset) -> Table {
        preset(chosen, Layer::from_text("nothing", "").unwrap()).unwrap()
    }

    #[test]
    fn every_preset_is_a_whole_configuration() {
        for (_, chosen) in Preset::ALL {
            let text = toml::to_string_pretty(&of_job(plain(chosen))).unwrap();
            let config: Config = typed(text.parse().unwrap()).unwrap();
            assert_eq!(config, chosen.config());
            let _: DemonstratorTraining =
                typed(of_recording(plain(chosen)).remove(DEMONSTRATOR).unwrap().try_into().unwrap()).unwrap();
        }
    }

    #[test]
    fn later_layers_win_and_integers_become_floats() {
        let task = "[policy]\nhidden = [8]\n[quick.judge]\nrepeats = 7\n[paper.judge]\nrepeats = 9";
        let mut values = preset(Preset::Quick, Layer::from_text("task", task).unwrap()).unwrap();
        for assignment in ["inner.trust_region.max_kl=1", "judge.acting=mean", "judge.evaluations = 3"] {
            apply(&mut values, &Layer::from_assignment(assignment).unwrap()).unwrap();
        }
        let config: Config = typed(of_job(values)).unwrap();
        assert_eq!(config.policy.hidden, [8]);
        assert_eq!((config.judge.repeats, config.judge.evaluations), (7, 3));
        assert_eq!(config.inner.trust_region.max_kl, 1.0);
    }

    #[test]
    fn what_to_keep_is_a_word_or_a_number() {
        for (assignment, wanted) in
            [("keep=3", Keep::Count(3)), ("keep=auto", Keep::Auto), ("keep=\"weights\"", Keep::Weights)]
        {
            let mut values = plain(Preset::Quick);
            apply(&mut values, &Layer::from_assignment(assignment).unwrap()).unwrap();
            assert_eq!(typed::<Config>(of_job(values)).unwrap().keep, wanted);
        }
        let mut values = plain(Preset::Quick);
        apply(&mut values, &Layer::from_assignment("keep=most").unwrap()).unwrap();
        let error = typed::<Config>(of_job(values)).unwrap_err().to_string();
        assert!(error.contains("must be auto, weights, quarter, or a number"), "{error}");
    }

    #[test]
    fn a_wrong_key_or_value_is_named_with_what_would_be_right() {
        for (assignment, wanted) in [
            (
                "judge.iteratons=3",
                "there is no key judge.iteratons (from --set judge.iteratons=3); in judge there are: ",
            ),
            ("judge.iteratons=3", "iterations"),
            ("nonsense=1", "at the top there are: "),
            ("judge.iterations=\"3\"", "is of type string, and must be of type integer such as "),
            ("judge=3", "is of type integer, and must be of type table"),
            ("judge.iterations", "wanted key=value"),
        ] {
            let error = Layer::from_assignment(assignment)
                .and_then(|layer| apply(&mut plain(Preset::Standard), &layer))
                .unwrap_err();
            assert!(error.is_bad_config());
            assert!(error.to_string().contains(wanted), "{error}");
        }
    }

    /// Each key of a configuration with its value; `parent` stands before it.
    fn keys(values: &Table, parent: &str) -> Vec<(String, String)> {
        let named = |key: &String| format!("{parent}{key}");
        let of = |(key, value): (&String, &Value)| match value {
            Value::Table(inner) => keys(inner, &format!("{}.", named(key))),
            value => vec![(named(key), value.to_string())],
        };
        values.iter().flat_map(of).collect()
    }

    /// The rows of the tables of a document: under `default` keys stand with all that is before them, under another column, such
    /// as `inner`, without its name. A default is one value, or one for each preset.
    fn documented(document: &str) -> Vec<(String, Vec<String>)> {
        let mut rows = Vec::new();
        let mut head: Vec<&str> = Vec::new();
        for line in document.lines() {
            let Some(line) = line.strip_prefix("| ") else {
                if !line.starts_with('|') {
                    head.clear();
                }
                continue;
            };
            let cells: Vec<&str> = line.trim_end_matches('|').split('|').map(str::trim).collect();
            if head.is_empty() {
                head = cells;
                continue;
            }
            for (column, cell) in head.iter().zip(&cells).skip(2) {
                let parent = if *column == "default" { String::new() } else { format!("{column}.") };
                let key = format!("{parent}{}", cells[0]).replace('`', "");
                rows.push((key, cell.split(" / ").map(str::to_owned).collect()));
            }
        }
        rows
    }

    #[test]
    fn each_key_stands_in_the_document_with_its_value_in_each_preset() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/configuration.md");
        let rows = documented(&std::fs::read_to_string(path).unwrap());
        for (place, (name, chosen)) in Preset::ALL.into_iter().enumerate() {
            let mut values = plain(chosen);
            with_trainings_by_trainer(&mut values);
            let wanted = keys(&values, "");
            let said: Vec<(String, String)> = rows
                .iter()
                .map(|(key, defaults)| (key.clone(), defaults.get(place).unwrap_or(&defaults[0]).clone()))
                .collect();
            let missing: Vec<_> = wanted.iter().filter(|row| !said.contains(row)).collect();
            assert!(missing.is_empty(), "{name}: the document does not say {missing:?}");
            let wrong: Vec<_> = said.iter().filter(|row| !wanted.contains(row)).collect();
            assert!(wrong.is_empty(), "{name}: the document is wrong about {wrong:?}");
        }
    }

    #[test]
    fn the_first_difference_has_both_values() {
        let (mut old, mut new) = (plain(Preset::Quick), plain(Preset::Quick));
        assert_eq!(first_difference(&old, &new), None);
        apply(&mut old, &Layer::from_assignment("judge.repeats=3").unwrap()).unwrap();
        apply(&mut new, &Layer::from_assignment("judge.repeats=5").unwrap()).unwrap();
        let wanted = ("judge.repeats".to_owned(), "3".to_owned(), "5".to_owned());
        assert_eq!(first_difference(&old, &new), Some(wanted));
    }
}
