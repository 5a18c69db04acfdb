//! The form of a study file, as it is written.

use std::path::{Path, PathBuf};

use demosift::basics::files;
use demosift::data::demonstration::episode::Format;
use demosift::learning::adapt::Rule;
use demosift::run::preset::Preset;
use demosift::run::study::{Choice, Claim, CombinationRule, Curves, Figure, TopK, Weights};
use demosift::{Error, Result};
use serde::Deserialize;
use toml::{Table, Value};

use crate::arguments::OnlyThese;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) title: Option<String>,
    pub(super) paper_says: Option<String>,
    pub(super) reading: Option<String>,
    pub(super) preset: Option<String>,
    pub(super) seeds: SeedsEntry,
    pub(super) sets: Vec<SetEntry>,
    pub(super) methods: Vec<MethodEntry>,
    /// Values of all methods, below their own.
    #[serde(default)]
    pub(super) judging: JudgingEntry,
    #[serde(default)]
    pub(super) training: TrainingEntry,
    pub(super) oracle: Option<OracleEntry>,
    pub(super) hits_at: Option<Vec<TopK>>,
    pub(super) regret: Option<RegretEntry>,
    #[serde(default)]
    pub(super) pools: Vec<PoolEntry>,
    #[serde(default)]
    pub(super) referees: Vec<RefereeEntry>,
    pub(super) curves: Option<Curves>,
    pub(super) weights: Option<Weights>,
    #[serde(default)]
    pub(super) figures: Vec<Figure>,
    #[serde(default)]
    pub(super) claims: Vec<Claim>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JudgingEntry {
    #[serde(default)]
    pub(super) values: Table,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SeedsEntry {
    #[serde(default)]
    pub(super) first: u64,
    pub(super) count: usize,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SetEntry {
    pub(super) name: String,
    pub(super) task: String,
    pub(super) variant: Option<String>,
    /// Beside the study file.
    pub(super) data: Option<PathBuf>,
    /// Who published it; then `file` is looked for in the folder of public sets.
    pub(super) source: Option<String>,
    pub(super) file: Option<PathBuf>,
    pub(super) sha256: Option<String>,
    pub(super) format: Option<Format>,
    #[serde(default)]
    pub(super) observation_columns: Vec<String>,
    #[serde(default)]
    pub(super) action_columns: Vec<String>,
    pub(super) episodes: Option<Vec<usize>>,
    pub(super) seeds: Option<usize>,
    pub(super) oracle_seeds: Option<usize>,
    pub(super) regret: Option<bool>,
    pub(super) returns: Option<Vec<f64>>,
    pub(super) stage: Option<PathBuf>,
    /// The set on which each method learns its prior.
    pub(super) prior: Option<String>,
    /// The file that says whose body made each demonstration; only shown.
    pub(super) bodies: Option<PathBuf>,
    /// The file that says under which variant each demonstration was recorded; only shown.
    pub(super) recorded_under: Option<PathBuf>,
    /// The task whose body the agent has, where the task of the set has the same one by another name.
    pub(super) body: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MethodEntry {
    pub(super) name: String,
    pub(super) preset: Option<String>,
    #[serde(default)]
    pub(super) clones: bool,
    #[serde(default)]
    pub(super) own_prior: bool,
    pub(super) values: Option<Table>,
    pub(super) rule: Option<CombinationRule>,
    pub(super) of: Option<Vec<String>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TrainingEntry {
    pub(super) preset: Option<String>,
    #[serde(default)]
    pub(super) values: Table,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OracleEntry {
    pub(super) imitators: Vec<Rule>,
    pub(super) seeds: usize,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RegretEntry {
    pub(super) at: Vec<TopK>,
    pub(super) imitators: Vec<Rule>,
    pub(super) trainings: usize,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PoolEntry {
    pub(super) set: String,
    pub(super) subsets: Vec<Choice>,
    pub(super) imitator: Rule,
    pub(super) trainings: usize,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RefereeEntry {
    pub(super) set: String,
    pub(super) kept: Vec<Choice>,
    /// As `--referee` writes trainings.
    pub(super) pools: String,
    pub(super) with: Vec<String>,
}

/// Where a study is written.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Source<'a> {
    /// In a file.
    At(&'a Path),
    /// It comes with demosift; its sets lie in this folder.
    BuiltIn { name: &'a str, text: &'a str, sets: &'a Path },
}

/// A study, and what of it is asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Asked<'a> {
    pub(crate) source: Source<'a>,
    /// The folder of the public sets.
    pub(crate) public: Option<&'a Path>,
    pub(crate) only: &'a OnlyThese,
    /// In place of that of the file.
    pub(crate) preset: Option<&'a str>,
    /// In place of that of the file.
    pub(crate) seeds: Option<usize>,
}

impl Source<'_> {
    /// That of its file.
    pub(super) fn name(&self) -> String {
        match self {
            Self::At(path) => path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(),
            Self::BuiltIn { name, .. } => (*name).to_owned(),
        }
    }

    /// For errors.
    pub(super) fn path(&self) -> PathBuf {
        match self {
            Self::At(path) => path.to_path_buf(),
            Self::BuiltIn { name, .. } => PathBuf::from(format!("reproduce/{name}.toml")),
        }
    }

    fn text(&self) -> Result<String> {
        match self {
            Self::BuiltIn { text, .. } => Ok((*text).to_owned()),
            Self::At(path) if !path.exists() => Err(Error::bad_input("the study file does not exist")),
            Self::At(path) => files::read_text(path, "the study file"),
        }
    }
}

/// The table of changes by preset.
const BY_PRESET: &str = "by_preset";

/// The file as it is written, with the changes that a preset makes.
pub(super) fn read(asked: &Asked<'_>) -> Result<File> {
    let text = asked.source.text()?;
    let wrong = |error: toml::de::Error| {
        Error::bad_config(format!("this is not a study file: {}", error.to_string().trim_end()))
            .with_hint("docs/studies.md has the form of a study file")
    };
    let whole: Table = toml::from_str(&text).map_err(wrong)?;
    // An error from the text itself says at which line it is.
    let mut file: File = match asked.preset.is_some() || whole.contains_key(BY_PRESET) {
        true => for_preset(whole, asked.preset)?.try_into().map_err(wrong)?,
        false => toml::from_str(&text).map_err(wrong)?,
    };
    if let Some(count) = asked.seeds {
        file.seeds.count = count;
        file.sets.iter_mut().for_each(|set| set.seeds = set.seeds.map(|own| own.min(count)));
    }
    if file.seeds.count == 0 {
        return Err(Error::bad_config("seeds.count = 0, and must be at least 1"));
    }
    Ok(file)
}

/// The file with the changes of the preset that is asked for, or of its own.
fn for_preset(mut whole: Table, asked: Option<&str>) -> Result<Table> {
    let own = whole.get("preset").and_then(Value::as_str);
    let preset = asked.or(own).unwrap_or("standard").to_owned();
    let wrong =
        |what: String| Error::bad_config(what).with_hint("docs/studies.md has the form of a study file");
    let changes = match whole.remove(BY_PRESET) {
        Some(Value::Table(changes)) => changes,
        Some(_) => return Err(wrong(format!("{BY_PRESET} must be a table of tables named after presets"))),
        None => Table::new(),
    };
    for (name, change) in changes {
        known_preset(&name)?;
        match change {
            Value::Table(change) if name == preset => lay_over(&mut whole, change),
            Value::Table(_) => {}
            _ => return Err(wrong(format!("{BY_PRESET}.{name} must be a table"))),
        }
    }
    whole.insert("preset".to_owned(), Value::String(preset));
    Ok(whole)
}

/// Tables of the changes join those that are there; everything else takes its place.
fn lay_over(base: &mut Table, changes: Table) {
    for (key, change) in changes {
        match (base.get_mut(&key), change) {
            (Some(Value::Table(inner)), Value::Table(change)) => lay_over(inner, change),
            (_, change) => {
                base.insert(key, change);
            }
        }
    }
}

/// The preset of this name.
pub(super) fn known_preset(name: &str) -> Result<Preset> {
    Preset::ALL.into_iter().find(|(known, _)| *known == name).map(|(_, preset)| preset).ok_or_else(|| {
        let known: Vec<&str> = Preset::ALL.iter().map(|(known, _)| *known).collect();
        Error::bad_config(format!("there is no preset '{name}'; there are: {}", known.join(", ")))
    })
}
