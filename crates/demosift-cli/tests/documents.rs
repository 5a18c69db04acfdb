//! What the command says of itself, and what the documents say of it.

use crate::support::{Scratch, in_repository};

/// The name of a field that a line of a struct declares.
fn field_of(line: &str) -> Option<&str> {
    let line = line.strip_prefix("    ")?.trim_start_matches("pub(crate) ");
    let (name, _) = line.strip_suffix(',')?.split_once(": ")?;
    let is_of_name = |character: char| character.is_ascii_lowercase() || "_0123456789".contains(character);
    name.chars().all(is_of_name).then_some(name)
}

/// Read off the file that declares them, so that a new field cannot be forgotten.
#[test]
fn every_field_of_an_answer_stands_in_the_document() {
    let code = std::fs::read_to_string(in_repository("crates/demosift-cli/src/answers.rs")).unwrap();
    let document = std::fs::read_to_string(in_repository("docs/json.md")).unwrap();
    let flattened = ["found", "selected", "columns", "column", "forecast"];
    let fields: Vec<&str> =
        code.lines().filter_map(field_of).filter(|name| !flattened.contains(name)).collect();
    assert!(fields.len() > 60, "{fields:?}");
    let missing: Vec<_> = fields.iter().filter(|name| !document.contains(&format!("`{name}`"))).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// The version of the workspace, the one place that says it; and the MuJoCo that the tests were made with.
#[test]
fn the_command_and_its_runs_say_the_version() {
    let manifest = std::fs::read_to_string(in_repository("Cargo.toml")).unwrap();
    let version =
        manifest.lines().find_map(|line| line.strip_prefix("version = ")).unwrap().trim_matches('"');
    let scratch = Scratch::new("version");
    assert_eq!(scratch.succeed("--version"), format!("demosift {version} (MuJoCo 3.17.0)\n"));
    scratch.succeed("judge set --task point_mass --judge cloning --config tiny.toml --out run");
    let run = std::fs::read_to_string(scratch.0.join("run/run.json")).unwrap();
    let run: serde_json::Value = serde_json::from_str(&run).unwrap();
    assert_eq!(run["demosift"], version);
}
