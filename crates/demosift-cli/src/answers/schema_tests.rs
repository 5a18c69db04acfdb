//! `docs/schema` holds what the types of answers and of the run folder say: made by `cargo xtask schema`, checked here.

use std::fs;
use std::path::{Path, PathBuf};

use demosift::results::artifact::schema::{of, of_results, of_sealed};
use demosift::results::metrics::Measured;
use demosift::results::oracle::Oracle;
use demosift::results::recording::Origin;
use schemars::Schema;

use super::{
    Convert, DryRun, EnvironmentCheck, Export, Goals, Imitate, ImitateNamed, Inspect, Judge, MetaTrain,
    OfRun, PartDone, Play, Record, Referee, ReportMade, Reproduced, Select, Sift, Standings, StudyDryRun,
    StudyShown, TaskCheck, Weigh,
};
use crate::commands::record::Provenance;
use crate::job::identity::Identity;

/// With this variable the files are written and not compared.
const WRITE: &str = "DEMOSIFT_WRITE_SCHEMAS";

/// Each answer, under the name of its command.
fn of_answers() -> Vec<(&'static str, Schema)> {
    vec![
        ("convert", of::<Convert<'_>>("demosift convert")),
        ("dry-run", of::<DryRun<'_>>("--dry-run")),
        ("export", of::<Export<'_>>("demosift export --as json")),
        ("goals", of::<Goals<'_>>("sift, select, referee and imitate of a task with several goals")),
        ("imitate", of::<OfRun<'_, Imitate<'_>>>("demosift imitate")),
        ("imitate-named", of::<OfRun<'_, ImitateNamed<'_>>>("demosift imitate --demonstration-ids")),
        ("inspect", of::<Inspect<'_>>("demosift inspect")),
        ("judge", of::<OfRun<'_, Judge<'_>>>("demosift judge")),
        ("judge-prior", of::<OfRun<'_, Standings<'_>>>("demosift judge --prior")),
        ("meta-train", of::<OfRun<'_, MetaTrain>>("demosift meta-train")),
        ("oracle", of::<OfRun<'_, &Oracle>>("demosift oracle")),
        ("part", of::<PartDone<'_>>("demosift judge, oracle and referee with --part")),
        ("play", of::<Play<'_>>("demosift play")),
        ("record", of::<Record<'_, Provenance, Vec<Origin>>>("demosift record")),
        ("referee", of::<OfRun<'_, Referee<'_>>>("demosift referee")),
        ("report", of::<ReportMade<'_>>("demosift report")),
        ("reproduce", of::<Reproduced<'_>>("demosift reproduce")),
        ("select", of::<OfRun<'_, Select<'_>>>("demosift select")),
        ("sift", of::<OfRun<'_, Sift<'_>>>("demosift sift")),
        ("study", of::<StudyShown<'_>>("demosift study")),
        ("study-dry-run", of::<StudyDryRun<'_>>("demosift study --dry-run")),
        ("task-check", of::<TaskCheck<'_>>("demosift task check")),
        ("task-check-env", of::<EnvironmentCheck<'_>>("demosift task check --env")),
        ("tasks", of::<Vec<String>>("demosift tasks")),
        ("weigh", of::<OfRun<'_, Weigh<'_>>>("demosift weigh")),
    ]
}

/// Each kind of JSON file in a run folder.
fn of_run_folder() -> Vec<(&'static str, Schema)> {
    let mut all = of_results();
    all.push(("measured", of_sealed::<Measured>("measured.json")));
    all.push(("provenance", of_sealed::<Provenance>("provenance.json, unseen_provenance.json")));
    all.push(("run", of_sealed::<Identity>("run.json")));
    all
}

#[test]
fn the_schemas_of_the_documents_are_those_of_the_types() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/schema");
    let answers = of_answers().into_iter().map(|(name, schema)| (format!("{name}.json"), schema));
    let files = of_run_folder().into_iter().map(|(name, schema)| (format!("run-folder/{name}.json"), schema));
    let wanted: Vec<(PathBuf, String)> = answers
        .chain(files)
        .map(|(name, schema)| (root.join(name), serde_json::to_string_pretty(&schema).unwrap() + "\n"))
        .collect();
    if std::env::var_os(WRITE).is_some() {
        fs::create_dir_all(root.join("run-folder")).unwrap();
        wanted.iter().for_each(|(path, text)| fs::write(path, text).unwrap());
    }
    for (path, text) in &wanted {
        let there = fs::read_to_string(path).unwrap_or_default();
        assert!(
            there == *text,
            "{} is not what its type says; `cargo xtask schema` writes it",
            path.display()
        );
    }
    let mut there: Vec<PathBuf> = [root.clone(), root.join("run-folder")]
        .iter()
        .flat_map(|folder| fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()))
        .filter(|path| path.is_file())
        .collect();
    there.retain(|path| !wanted.iter().any(|(known, _)| known == path));
    assert!(there.is_empty(), "no type is behind {there:?}");
}
