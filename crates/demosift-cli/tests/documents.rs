//! What the command says of itself, and what the documents say of it.

use crate::support::{Scratch, in_repository, schema};

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
    let code = std::fs::read_to_string(in_repository("crates/demosift-cli/src/answers/mod.rs")).unwrap();
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

/// The JSON files of a run folder and of a recording, and what commands show of them, against the schemas of their kinds.
#[test]
fn every_file_of_a_run_is_as_its_schema_says() {
    let scratch = Scratch::new("schema");
    let job = "--task point_mass --config tiny.toml";
    scratch.succeed(&format!("sift set {job} --keep weights --out run"));
    scratch.succeed("imitate --out run --resume");
    scratch.succeed(&format!("{} --unseen 2 --out recorded", crate::support::RECORD));
    let mut folders = vec!["run", "recorded"];
    let trainer = crate::trainer::trainer("least_squares");
    if let Some(trainer) = &trainer {
        let asked = format!("{job} --judge cloning {trainer} --referee trainer=1");
        scratch.succeed(&format!("sift set {asked} --out trained"));
        folders.push("trained");
    }
    // What is finished is shown again, and `succeed` holds what is shown against the schemas of answers.
    for command in ["sift", "select", "judge", "weigh", "referee", "meta-train", "imitate"] {
        scratch.succeed(&format!("{command} --out run --resume --json"));
    }
    scratch.succeed("imitate --out run --resume --demonstration-ids 0 --json");
    for shown in ["report run", "inspect set", "convert set --to minari copy", "tasks"] {
        scratch.succeed(&format!("{shown} --json"));
    }
    let exported = scratch.succeed("export run --as json");
    schema::assert_valid("export", &serde_json::from_str(&exported).expect("it is JSON"));

    let mut seen = std::collections::BTreeSet::new();
    for folder in folders {
        for (file, bytes) in scratch.files(folder) {
            let Some(name) = file.strip_suffix(".json") else { continue };
            let kind = match name {
                "unseen_provenance" => "provenance",
                _ => ["learning_curve", "scores", "spent", "training"]
                    .into_iter()
                    .find(|kind| name.starts_with(&format!("{kind}_")))
                    .unwrap_or(name),
            };
            let value = serde_json::from_slice(&bytes).expect("it is JSON");
            schema::assert_valid(&format!("run-folder/{kind}"), &value);
            seen.insert(format!("{kind}.json"));
        }
    }
    let schemas = std::fs::read_dir(in_repository("docs/schema/run-folder")).expect("schemas");
    let unseen: Vec<String> = schemas
        .map(|entry| entry.expect("an entry").file_name().into_string().expect("UTF-8"))
        .filter(|name| !seen.contains(name) && (trainer.is_some() || name != "training.json"))
        .collect();
    assert!(unseen.is_empty(), "nothing was held against {unseen:?}");
}

/// They are made from their files of results, whatever the program says on a page today; the README has the table of the paper's
/// claims from there. What commit and machine made the cells, the command cannot know.
#[test]
fn the_pages_of_experiments_are_what_their_results_make() {
    let kept = in_repository("docs/results");
    let scratch = Scratch::new("pages");
    std::fs::create_dir(scratch.0.join("results")).unwrap();
    for file in std::fs::read_dir(&kept).unwrap().map(|entry| entry.unwrap().path()) {
        if file.extension().is_some_and(|extension| extension == "json") {
            std::fs::copy(&file, scratch.0.join("results").join(file.file_name().unwrap())).unwrap();
        }
    }
    scratch.succeed("reproduce results --page made --summary made/README.md");
    let told_by_command = |bytes: &[u8]| -> Vec<String> {
        let text = String::from_utf8_lossy(bytes).into_owned();
        text.lines().filter(|line| !line.starts_with("# demosift ")).map(str::to_owned).collect()
    };
    let made = scratch.files("made");
    assert!(made.len() > 20, "{:?}", made.keys());
    for (name, bytes) in &made {
        let there = std::fs::read(kept.join(name)).unwrap_or_default();
        assert!(
            told_by_command(bytes) == told_by_command(&there),
            "docs/results/{name} is not what its results make: draw it again with demosift reproduce (docs/studies.md)"
        );
    }
    let summary = String::from_utf8(made["README.md"].clone()).unwrap();
    let claims: Vec<&str> = summary
        .lines()
        .skip_while(|line| !line.starts_with("| experiment | claim | agree |"))
        .take_while(|line| line.starts_with('|'))
        .collect();
    let readme = std::fs::read_to_string(in_repository("README.md")).unwrap();
    assert!(
        claims.len() > 4 && readme.contains(&claims.join("\n")),
        "README.md has not the table {claims:#?}"
    );
}
