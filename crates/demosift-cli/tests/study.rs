//! `demosift study` as a user sees it: it goes on where it stopped, on any number of threads, and tells each mistake.

use std::fs;
use std::time::Duration;

use crate::support::{Scratch, in_repository};
use serde_json::Value;

/// Two sets, two methods and what combines them, all of it in seconds; `ADD` is where tests add something.
const STUDY: &str = r#"
preset = "quick"
ADD
[seeds]
count = 2
[[sets]]
name = "four"
task = "point_mass"
data = "set"
returns = [1, 4, 2, 3]
[[sets]]
name = "two"
task = "point_mass"
data = "set"
episodes = [2, 1]
returns = [1, 4, 2, 3]
[[methods]]
name = "paper"
[methods.values]
judges = "paper"
inner.batch_steps = 120
meta_train.rounds = 2
judge = { iterations = 2, evaluations = 3 }
[[methods]]
name = "cloning"
clones = true
[methods.values]
judges = "cloning"
cloning_judge.judging = { iterations = 2, repeats = 1, most_repeats = 0, evaluations = 3, acting = "mean" }
[[methods]]
name = "mean of ranks"
rule = "ranks"
of = ["paper", "cloning"]
[training.values.imitate]
environment_steps = 600
cloning_updates = 4
evaluations = 3
update.batch_steps = 300
[oracle]
imitators = ["gail", "behavioral_cloning"]
seeds = 2
[regret]
at = [1, 2]
imitators = ["gail"]
trainings = 2
[[pools]]
set = "four"
subsets = ["kept-by mean of ranks 2", "all", "random 2", [0, 3]]
imitator = "gail"
trainings = 2
"#;

fn scratch(name: &str) -> Scratch {
    let scratch = Scratch::new(name);
    write_study(&scratch, "");
    scratch
}

fn write_study(scratch: &Scratch, add: &str) {
    fs::write(scratch.0.join("tiny.toml"), STUDY.replace("ADD", add)).unwrap();
}

/// The results of a folder without what a clock said.
fn results(scratch: &Scratch, out: &str) -> Value {
    let mut found: Value =
        serde_json::from_slice(&fs::read(scratch.0.join(out).join("study.json")).unwrap()).unwrap();
    crate::support::without_seconds(&mut found);
    found
}

fn cells(scratch: &Scratch, out: &str) -> Vec<String> {
    let Ok(entries) = fs::read_dir(scratch.0.join(out).join("cells")) else { return Vec::new() };
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".json"))
        .collect();
    names.sort();
    names
}

#[test]
fn it_goes_on_after_a_kill_and_threads_and_parts_change_nothing() {
    let scratch = scratch("study-goes-on");
    let told = scratch.succeed("study tiny.toml --threads 1 --out one");
    let whole = results(&scratch, "one");
    let all = cells(&scratch, "one");
    assert!(told.contains(&format!("{0} of {0} cells are finished", all.len())), "{told}");
    assert_eq!(whole["cells"].as_array().unwrap().len(), all.len());
    assert_eq!(whole["pools"].as_array().unwrap().len(), 4);
    assert_eq!(whole["pools"][2]["trainings"].as_array().unwrap().len(), 2);

    // Killed after some cells, wherever that happens to be.
    let mut child = scratch.command("study tiny.toml --threads 2 --out two").spawn().unwrap();
    while cells(&scratch, "two").len() < 5 && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let before = scratch.files("two/cells");
    scratch.succeed("study tiny.toml --threads 2 --out two");
    assert_eq!(results(&scratch, "two"), whole);
    let after = scratch.files("two/cells");
    for (name, bytes) in before.iter().filter(|(name, _)| name.ends_with(".json") && !name.starts_with('.')) {
        assert!(after[name] == *bytes, "{name} was made again");
    }

    for part in ["1/2", "2/2", "1/2"] {
        scratch.succeed(&format!("study tiny.toml --out parts --part {part}"));
        // Nobody knows which part would be the last to write.
        assert!(scratch.files("parts").is_empty(), "{:?}", scratch.files("parts").keys());
    }
    scratch.succeed("study tiny.toml --out parts");
    assert_eq!(results(&scratch, "parts"), whole);
    // Nothing is left to do, and the results are the same bytes.
    let bytes = fs::read(scratch.0.join("one/study.json")).unwrap();
    scratch.succeed("study tiny.toml --out one --write copy.json");
    assert_eq!(fs::read(scratch.0.join("one/study.json")).unwrap(), bytes);
    assert_eq!(fs::read(scratch.0.join("copy.json")).unwrap(), bytes);
    let here = scratch.0.to_string_lossy().into_owned();
    assert!(!String::from_utf8(bytes).unwrap().contains(&here), "results name no path of a machine");
}

#[test]
fn tables_are_made_from_the_file_of_results_alone() {
    let scratch = scratch("study-tables");
    let told = scratch.succeed("study tiny.toml --out run --write results.json");
    let shown = scratch.succeed("study results.json --table");
    assert_eq!(
        told.replace("Study tiny", "").split("\nThe folder").next(),
        Some(shown.replace("Study tiny", "").as_str())
    );
    for part in
        ["(ceiling)", "too few seeds", "oracle by gail", "oracle by cloning", "kept-by mean of ranks 2"]
    {
        assert!(shown.contains(part), "{shown}");
    }
    let markdown = scratch.succeed("study results.json --markdown");
    assert!(
        markdown.contains("| set | truth | judge | Spearman |") && markdown.contains("|---|"),
        "{markdown}"
    );
    assert!(markdown.lines().all(|line| line.matches(". ").count() == 0), "one sentence a line: {markdown}");
    let json: Value = serde_json::from_str(&scratch.succeed("study results.json --json")).unwrap();
    assert_eq!(json["summary"]["sets"][0]["set"], "four");
    // From the study file, what is finished so far is shown and nothing made.
    let shown = scratch.succeed("study tiny.toml --table --out nowhere");
    assert!(shown.starts_with("Study tiny: 0 of ") && !scratch.0.join("nowhere").exists(), "{shown}");
}

#[test]
fn cells_of_other_columns_of_the_same_file_are_not_believed() {
    let scratch = scratch("study-columns");
    let with = |columns: &str| {
        let set = format!("data = \"set\"\nobservation_columns = {columns}\nreturns");
        let study = STUDY.replace("ADD", "").replacen("data = \"set\"\nreturns", &set, 1);
        fs::write(scratch.0.join("tiny.toml"), study).unwrap();
    };
    with("[\"observations[0:2]\", \"observations[2:4]\"]");
    scratch.succeed("study tiny.toml --out run --only four/cloning");
    with("[\"observations[2:4]\", \"observations[0:2]\"]");
    let shown = scratch.succeed("study tiny.toml --out run --only four/cloning --table").replace('\n', " ");
    assert!(shown.contains("2 cells are not believed, since they are of other demonstrations"), "{shown}");
}

/// Of a set whose prior is learned on one that is not there.
#[test]
fn a_set_without_its_lender_is_left_out_in_words() {
    let scratch = scratch("study-lender");
    let public = "source = \"somebody\"\nfile = \"far.hdf5\"\nsha256 = \"00\"";
    let study = STUDY.replace("ADD", "").replacen("data = \"set\"", public, 1).replacen(
        "name = \"two\"",
        "name = \"two\"\nprior = \"four\"",
        1,
    );
    let other = "[[sets]]\nname = \"other\"\ntask = \"point_mass\"\ndata = \"set\"\n[[methods]]";
    fs::write(scratch.0.join("tiny.toml"), study.replacen("[[methods]]", other, 1)).unwrap();
    let told = scratch.succeed("study tiny.toml --dry-run --only other,two,four").replace('\n', " ");
    for part in ["The set four is left out", "The set two is left out: its prior is learned on four"] {
        assert!(told.contains(part), "{part} in {told}");
    }
}

#[test]
fn cells_of_something_else_are_not_believed_and_kept() {
    let scratch = scratch("study-anew");
    scratch.succeed("study tiny.toml --out run --only four/cloning");
    let before = scratch.files("run/cells");
    let changed = STUDY.replace("ADD", "").replace("acting = \"mean\"", "acting = \"sampled\"");
    fs::write(scratch.0.join("tiny.toml"), changed).unwrap();
    let shown = scratch.succeed("study tiny.toml --out run --only four/cloning --table").replace('\n', " ");
    assert!(shown.contains("2 cells are not believed, since they are of another configuration"), "{shown}");

    let output = scratch.run("study tiny.toml --out run --only four/cloning");
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(
        output.status.success() && said.contains("2 cells of run are of another configuration"),
        "{said}"
    );
    assert_eq!(cells(&scratch, "run").len(), 2);
    for (name, bytes) in &scratch.files("run/cells/set_aside") {
        assert!(before[&name.replace("_1.json", ".json")] == *bytes, "{name}");
    }
    // What trainings are made with did not change, nor what the paper's method is.
    write_study(&scratch, "");
    scratch.succeed("study tiny.toml --out run --only four/oracle");
    let changed = STUDY.replace("ADD", "").replace("rounds = 2", "rounds = 3");
    fs::write(scratch.0.join("tiny.toml"), changed).unwrap();
    let json = scratch.succeed("study tiny.toml --out run --only four/oracle --dry-run --json");
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (json["finished"].as_u64(), json["missing"].as_array().unwrap().len()),
        (Some(16), 0),
        "{json}"
    );
}

#[test]
fn results_of_before_are_taken_over_as_far_as_they_are_of_the_same() {
    let scratch = scratch("study-from");
    scratch.succeed("study tiny.toml --out run");
    let whole = results(&scratch, "run");
    scratch.succeed("study tiny.toml --out again --from run/study.json");
    assert_eq!(results(&scratch, "again"), whole);
    assert!(cells(&scratch, "again").is_empty(), "nothing was made");

    // Only the judge of the paper has other values; neither the other judge nor a training knows them.
    let changed = STUDY.replace("ADD", "").replace("rounds = 2", "rounds = 3");
    fs::write(scratch.0.join("tiny.toml"), changed).unwrap();
    scratch.succeed("study tiny.toml --out third --from again/study.json --only /paper,cloning,oracle");
    let made = cells(&scratch, "third");
    assert_eq!(made.len(), 4, "{made:?}");
    assert!(made.iter().all(|name| name.starts_with("judging_") && name.contains("_paper_")), "{made:?}");
    refuses(
        &scratch,
        "study tiny.toml --from nowhere.json",
        &["the file of results does not exist", "nowhere.json"],
    );
    refuses(&scratch, "study tiny.toml --from tiny.toml", &["this is not the file of a study"]);
    refuses(&scratch, "study run/study.json --from run/study.json", &["a file of results is only shown"]);
}

#[test]
fn a_cell_that_fails_is_told_and_stops_no_other() {
    let scratch = scratch("study-fails");
    let diverging = STUDY
        .replace("ADD", "")
        .replace("judges = \"cloning\"", "judges = \"cloning\"\ncloning_judge.cloning.learning_rate = 1e30");
    fs::write(scratch.0.join("tiny.toml"), diverging).unwrap();
    let told = scratch.succeed("study tiny.toml --out run --only four").replace("\n", " ");
    assert!(told.contains("The cell judging_four_cloning_0 failed: "), "{told}");
    assert!(told.contains("oracle by gail"), "{told}");
    let before = scratch.files("run/cells");
    scratch.succeed("study tiny.toml --out run --only four");
    crate::support::assert_same_files(&before, &scratch.files("run/cells"));
}

#[test]
fn a_dry_run_counts_cells_and_steps_and_touches_nothing() {
    let scratch = scratch("study-dry");
    let told = scratch.succeed("study tiny.toml --out run --dry-run");
    for part in ["judging by cloning", "judging by paper", "training by gail", "trainings more depend"] {
        assert!(told.contains(part), "{told}");
    }
    assert!(!scratch.0.join("run").exists());
    let json = scratch.succeed("study tiny.toml --out run --dry-run --json --only two/cloning,oracle");
    let json: Value = serde_json::from_str(&json).unwrap();
    let cells: Vec<u64> =
        json["missing"].as_array().unwrap().iter().map(|kind| kind["cells"].as_u64().unwrap()).collect();
    // Two judgments; two demonstrations by two imitators with two seeds.
    assert_eq!(cells, [2, 4, 4], "{json}");
    // Cloning plays its evaluations only: 3 episodes before and 2 x 3 after, of 30 steps.
    assert_eq!(json["missing"][0]["environment_steps"], 2 * 9 * 30);
}

#[test]
fn a_public_set_is_left_out_in_words_or_must_be_the_right_one() {
    let scratch = scratch("study-public");
    let public = |sha256: &str| {
        let from = "name = \"two\"\ntask = \"point_mass\"\ndata = \"set\"";
        let to = format!(
            "name = \"two\"\ntask = \"point_mass\"\nsource = \"some/body\"\nfile = \"demonstrations.hdf5\"\nsha256 = \"{sha256}\""
        );
        let text = STUDY.replace("ADD", "").replace(from, &to);
        fs::write(scratch.0.join("tiny.toml"), text).unwrap();
    };
    public("0123");
    let told = scratch.succeed("study tiny.toml --out run --dry-run").replace('\n', " ");
    assert!(
        told.contains("The set two is left out: it is of some/body") && told.contains("no --data DIR"),
        "{told}"
    );
    let told = scratch.succeed("study tiny.toml --out run --dry-run --data .").replace('\n', " ");
    assert!(told.contains("demonstrations.hdf5 of some/body is not in the folder of --data"), "{told}");
    refuses(
        &scratch,
        "study tiny.toml --data set",
        &["the set 'two': the SHA-256 is ", "must be 0123", "demonstrations.hdf5"],
    );
    let path = scratch.0.join("set/demonstrations.hdf5");
    public(&demosift::basics::files::sha256(&[path]).unwrap());
    let told = scratch.succeed("study tiny.toml --out run --dry-run --data set");
    assert!(!told.contains("left out"), "{told}");
    refuses(
        &scratch,
        "study tiny.toml --only two",
        &["nothing is left of the study", "hint: give the folder"],
    );
}

/// The command fails with one error that says all of `wanted`, and makes no folder.
#[track_caller]
fn refuses(scratch: &Scratch, arguments: &str, wanted: &[&str]) {
    scratch.refuse(arguments, wanted);
    assert!(!scratch.0.join("runs").exists(), "a folder was made");
}

#[test]
fn each_mistake_of_a_user_is_told() {
    let scratch = scratch("study-mistakes");
    refuses(&scratch, "study none.toml", &["the study file does not exist", "none.toml"]);
    refuses(&scratch, "study none.json --table", &["the file of results does not exist", "none.json"]);
    refuses(&scratch, "study tiny.toml --only five", &["no set 'five'; it has: four, two"]);
    refuses(
        &scratch,
        "study tiny.toml --only /papers",
        &["no method 'papers'; it has: paper, cloning, mean of ranks, oracle"],
    );
    refuses(&scratch, "study tiny.toml --part 3/2", &["must be from 1 to 2"]);
    refuses(&scratch, "study tiny.toml --part 2", &["wanted which part of how many, such as 1/2"]);
    refuses(&scratch, "study tiny.toml --threads 0", &["--threads 0: must be at least 1"]);
    fs::write(scratch.0.join("file"), "").unwrap();
    refuses(&scratch, "study tiny.toml --out file", &["is a file; wanted a folder"]);
    fs::write(scratch.0.join("results.json"), "{\"version\": 7}").unwrap();
    refuses(&scratch, "study results.json", &["has format version 7; this demosift reads versions 2 to 3"]);
    refuses(&scratch, "study results.json --part 1/2", &["only shown", "hint: give the study file"]);
    for (from, to, wanted) in [
        ("preset = \"quick\"", "presets = 1", vec!["unknown field `presets`", "hint: docs/studies.md"]),
        (
            "preset = \"quick\"",
            "preset = \"fast\"",
            vec!["there is no preset 'fast'; there are: quick, standard, paper"],
        ),
        ("count = 2", "count = 0", vec!["seeds.count = 0"]),
        ("data = \"set\"", "data = \"sets\"", vec!["the set 'four'", "sets"]),
        ("data = \"set\"", "dat = \"set\"", vec!["unknown field `dat`"]),
        ("data = \"set\"\n", "\n", vec!["the set 'four': it must have data"]),
        ("task = \"point_mass\"", "task = \"point_maze\"", vec!["point_maze"]),
        ("returns = [1, 4, 2, 3]", "returns = [1, 4]", vec!["its return has 2 numbers", "each of the 4"]),
        ("returns = [1, 4, 2, 3]", "stage = \"no.json\"", vec!["stages does not exist", "no.json"]),
        ("episodes = [2, 1]", "episodes = [2, 4]", vec!["episodes names 4, and there are 0 to 3"]),
        ("episodes = [2, 1]", "episodes = [2, 2]", vec!["episodes names 2 twice"]),
        ("name = \"two\"", "name = \"four\"", vec!["two sets called 'four'"]),
        (
            "meta_train.rounds = 2",
            "meta_train.round = 2",
            vec!["the method 'paper'", "there is no key meta_train.round"],
        ),
        (
            "evaluations = 3, acting",
            "evaluations = 0, acting",
            vec!["the method 'cloning'", "cloning_judge.judging.evaluations = 0"],
        ),
        (
            "cloning_updates = 4",
            "cloning_update = 4",
            vec!["there is no key imitate.cloning_update (from training.values)"],
        ),
        (
            "judges = \"paper\"",
            "judges = \"both\"",
            vec!["the method 'paper'", "judges = both, and a method asks one"],
        ),
        (
            "meta_train.rounds = 2",
            "meta_train.rounds = 2\nportable = true",
            vec![
                "portable = true stands in some values of the study and not in all",
                "[judging] and [training]",
            ],
        ),
        ("rule = \"ranks\"\n", "\n", vec!["the method 'mean of ranks' has one of rule and of"]),
        (
            "\"cloning\"]\n[training",
            "\"clone\"]\n[training",
            vec!["combines 'clone', and can combine: paper, cloning"],
        ),
        ("\"gail\", \"behavioral_cloning\"", "\"gale\"", vec!["gale"]),
        ("at = [1, 2]", "at = [1, \"third\"]", vec!["K = third, and must be half, quarter or a number"]),
        ("\"random 2\"", "\"random\"", vec!["the subset 'random' is none"]),
        ("\"random 2\"", "\"random 4\"", vec!["K = 4 of 4 demonstrations"]),
        ("[0, 3]", "[0, 9]", vec!["the ids [0, 9]; there are 0 to 3"]),
        ("kept-by mean of ranks 2", "kept-by nobody 2", vec!["no method 'nobody'"]),
        ("set = \"four\"", "set = \"five\"", vec!["no set 'five'; it has: four, two"]),
    ] {
        let text = STUDY.replace("ADD", "");
        assert!(text.contains(from), "{from}");
        fs::write(scratch.0.join("tiny.toml"), text.replacen(from, to, 1)).unwrap();
        refuses(&scratch, "study tiny.toml", &wanted);
    }
}

#[test]
fn the_studies_of_the_repository_can_be_read() {
    let scratch = Scratch::new("study-repository");
    for entry in fs::read_dir(in_repository("studies")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            let told = scratch.succeed(&format!("study {} --dry-run", path.display()));
            assert!(told.contains("Nothing was made"), "{told}");
        }
    }
}
