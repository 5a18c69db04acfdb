//! `demosift reproduce` as a user sees it: cells, figures, numbers and the page of an experiment, whole and in part.

use std::fs;

use crate::support::{Scratch, in_repository};
use serde_json::Value;

/// One set and one that only lends its prior, two methods, curves, weights and claims: all of it in seconds.
const STUDY: &str = r#"
title = "A tiny experiment"
paper_says = "The one judge is better. So it is."
reading = "Nothing can be read in two seeds."
preset = "standard"
[seeds]
count = 2
[by_preset.quick]
seeds.count = 1
[judging.values]
inner.batch_steps = 120
meta_train.rounds = 2
judge = { iterations = 3, averaged = 1, evaluations = 3, repeats = 1 }
subset_selection = { rounds = 2, meta_updates = 1, iterations = 2, steady_rounds = 2 }
[training.values.imitate]
environment_steps = 900
cloning_updates = 4
evaluate_every = 1
evaluations = 3
update.batch_steps = 300
[[sets]]
name = "four"
task = "point_mass"
data = "set"
bodies = "bodies.json"
recorded_under = "bodies.json"
[[sets]]
name = "lent"
task = "point_mass"
data = "set"
episodes = [0, 1, 2]
seeds = 0
[[sets]]
name = "unseen"
task = "point_mass"
data = "set"
episodes = [3, 1]
prior = "lent"
[[methods]]
name = "MAML"
values = { judges = "paper" }
[[methods]]
name = "cloning"
clones = true
[methods.values]
judges = "cloning"
cloning_judge.judging = { iterations = 2, repeats = 1, most_repeats = 0, evaluations = 3, acting = "mean" }
[curves]
at = [1, "half"]
imitators = ["gail", "behavioral_cloning"]
[weights]
methods = ["MAML"]
sets = ["four"]
[[figures]]
name = "curves"
title = "Curves"
draws = "top_k"
[[figures]]
name = "adaptation"
title = "Adaptation"
draws = "adaptation"
methods = ["MAML"]
[[figures]]
name = "weights"
title = "Weights"
draws = "weights"
methods = ["MAML"]
sets = ["four"]
[[figures]]
name = "bodies"
title = "Bodies"
draws = "bodies"
sets = ["four"]
[[claims]]
says = "MAML chooses better than cloning."
better = "MAML"
than = ["cloning"]
at = [1]
[[claims]]
says = "MAML is nearer."
by = "us"
better = "MAML"
than = ["cloning"]
measure = "distance"
"#;

fn scratch(name: &str) -> Scratch {
    let scratch = Scratch::new(name);
    fs::write(scratch.0.join("tiny.toml"), STUDY).unwrap();
    let origin = |demonstration: usize| {
        let task = if demonstration == 3 { "taller" } else { "point_mass" };
        serde_json::json!({
            "demonstration": demonstration, "task": task, "variant": 0, "updates": 1, "stage_return": 0.0,
            "stage_score": 0.0, "stage_success": null, "score": 0.0, "succeeded": null, "steps": 30,
        })
    };
    let origins: Vec<Value> = (0..4).map(origin).collect();
    let origins = serde_json::json!({ "demonstrations": origins });
    fs::write(scratch.0.join("bodies.json"), origins.to_string()).unwrap();
    scratch
}

fn read(scratch: &Scratch, path: &str) -> String {
    fs::read_to_string(scratch.0.join(path)).unwrap()
}

/// The file of results without what a clock said.
fn results(scratch: &Scratch, path: &str) -> Value {
    let mut found: Value = serde_json::from_str(&read(scratch, path)).unwrap();
    crate::support::without_seconds(&mut found);
    found
}

#[test]
fn an_experiment_becomes_cells_figures_numbers_and_a_page() {
    let scratch = scratch("reproduce-whole");
    let told = scratch
        .succeed("reproduce tiny.toml --out run --page pages/first.md --commit abc123 --machine a-toaster");
    assert!(told.starts_with("A tiny experiment\n"), "{told}");
    for part in [
        "The paper: MAML chooses better than cloning.",
        "Our question: MAML is nearer.",
        "too few seeds",
        "(whole set)",
    ] {
        assert!(told.contains(part), "{told}");
    }
    let page = read(&scratch, "pages/first.md");
    let (head, rest) = page.split_once("\n\n").unwrap();
    assert_eq!(head, "# A tiny experiment");
    assert!(rest.starts_with("**This result is partial.**\n"), "two seeds are no result: {page}");
    for part in [
        "commit abc123, a-toaster",
        "demosift reproduce tiny.toml --preset standard --seeds 2",
        "![Curves](curves.svg)",
        "too few seeds",
        "The one judge is better.\nSo it is.",
    ] {
        assert!(page.contains(part), "{part} in {page}");
    }
    assert!(!page.contains("Nothing can be read"), "too few seeds to read anything: {page}");
    assert!(
        page.lines().all(|line| line.starts_with('|') || !line.contains(". ")),
        "one sentence a line: {page}"
    );
    // Where less is better the other one stands first, as in the difference.
    assert!(page.contains("| cloning − MAML | "), "{page}");
    for part in [
        "## How many of the kept were made by another body\n",
        "## What is kept by weights\n",
        "| s each | seeds |",
        "## Which demonstration comes first\n",
        "## What judging starts from\n",
    ] {
        assert!(page.contains(part), "{part} in {page}");
    }
    // Sets × K of two imitators: what cloning keeps is there for both; lines for top 1, top half, all and weights.
    let csv = read(&scratch, "pages/curves.csv");
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines[0], "row,column,line,environment_steps_or_updates,mean,deviation,seeds");
    for wanted in [
        "\"four, gail\",MAML,top 1,0,",
        "\"four, cloning\",MAML,by weights,",
        "\"unseen, gail\",cloning,all,900,",
    ] {
        assert!(lines.iter().any(|line| line.starts_with(wanted)), "{wanted} in {csv}");
    }
    assert!(lines[1..].iter().all(|line| line.ends_with(",2")), "of both seeds: {csv}");
    assert!(!csv.contains("lent"), "what only lends its prior is not shown");
    for figure in ["curves", "adaptation", "weights", "bodies"] {
        let svg = read(&scratch, &format!("pages/{figure}.svg"));
        assert!(svg.starts_with("<svg ") && svg.contains("over 2 of 2 seeds"), "{figure}: {svg}");
    }
    assert!(read(&scratch, "pages/bodies.svg").contains("another body"));

    // The same again from the file of results alone, without sets, study file and cells.
    let first = scratch.files("pages");
    let moved = scratch.0.join("tiny.json");
    fs::rename(scratch.0.join("pages/tiny.json"), &moved).unwrap();
    scratch.succeed("reproduce tiny.json --page again/first.md --commit abc123 --machine a-toaster");
    crate::support::assert_same_files(&first, &scratch.files("again"));
    scratch.refuse(
        "reproduce tiny.json --page again/first.md --out other",
        &["--out is about making cells, and a file of results is only drawn", "hint: leave it out"],
    );
    let json: Value = serde_json::from_str(&scratch.succeed("reproduce tiny.json --json")).unwrap();
    assert_eq!((json["experiment"].as_str(), json["partial"].as_bool()), (Some("tiny"), Some(true)));
    assert_eq!(json["told"]["seeds"], serde_json::json!([2, 2]));
    assert!(fs::metadata(moved).unwrap().len() < 2_000_000);
    let here = scratch.0.to_string_lossy().into_owned();
    assert!(!read(&scratch, "tiny.json").contains(&here), "results name no path of a machine");

    // All results of a folder, and what they say together.
    fs::create_dir(scratch.0.join("kept")).unwrap();
    fs::copy(scratch.0.join("tiny.json"), scratch.0.join("kept/fig3.json")).unwrap();
    fs::copy(scratch.0.join("tiny.json"), scratch.0.join("kept/fig4.json")).unwrap();
    scratch.refuse(
        "reproduce kept --page x.md",
        &["several experiments have a page each", "hint: give a folder"],
    );
    // A study of ours is told after those of the paper, and what is none is left alone.
    fs::rename(scratch.0.join("kept/fig4.json"), scratch.0.join("kept/ours.json")).unwrap();
    fs::write(scratch.0.join("kept/something.json"), "{}").unwrap();
    scratch.succeed("reproduce kept --summary summary.md --json");
    assert_eq!(read(&scratch, "summary.md").matches("- [A tiny experiment](tiny.md)").count(), 2);
    let summary = read(&scratch, "summary.md");
    for part in [
        "# What of the paper holds here\n",
        "| tiny, in part | MAML chooses better than cloning | 0 | 0 | 0 | 4 | 2 |",
        "- [A tiny experiment](tiny.md)",
    ] {
        assert!(summary.contains(part), "{part} in {summary}");
    }

    // Another study goes on from that file where its cells have what its figures show.
    scratch.succeed("reproduce tiny.toml --out other --from tiny.json");
    assert!(fs::read_dir(scratch.0.join("other/cells")).unwrap().next().is_none(), "nothing was made");
}

#[test]
fn parts_and_threads_change_nothing_and_a_part_writes_no_page_but_where_it_is_asked_for() {
    let scratch = scratch("reproduce-parts");
    scratch.succeed("reproduce tiny.toml --out one --threads 1");
    let part = scratch.succeed("reproduce tiny.toml --out two --part 1/2 --threads 2");
    assert!(!part.is_empty() && scratch.files("two").is_empty(), "{:?}", scratch.files("two").keys());
    scratch.succeed("reproduce tiny.toml --out two --part 1/2 --page part/tiny.md");
    assert!(read(&scratch, "part/tiny.md").contains("**This result is partial.**"));
    assert!(read(&scratch, "part/curves.svg").starts_with("<svg "));
    scratch.succeed("reproduce tiny.toml --out two --part 2/2");
    assert!(scratch.files("two").is_empty(), "{:?}", scratch.files("two").keys());
    scratch.succeed("reproduce tiny.toml --out two");
    assert_eq!(results(&scratch, "two/tiny.json"), results(&scratch, "one/tiny.json"));
    let before = scratch.files("two/cells");
    let svg = read(&scratch, "two/curves.svg");
    assert_eq!(svg, read(&scratch, "one/curves.svg"));
    scratch.succeed("reproduce tiny.toml --out two");
    crate::support::assert_same_files(&before, &scratch.files("two/cells"));

    // The cells are those of a study, whose other tables can be shown too.
    let told = scratch.succeed("study tiny.toml --out two --table");
    assert!(told.contains("ABD"), "{told}");
    // What is asked for only to be shown is not written where nothing is.
    let shown = scratch.succeed("reproduce tiny.toml --out nowhere --table");
    assert!(shown.contains("0 of ") && !scratch.0.join("nowhere").exists(), "{shown}");
}

#[test]
fn a_dry_run_counts_and_a_preset_changes_what_it_says() {
    let scratch = scratch("reproduce-dry");
    let cells = |arguments: &str| -> Vec<u64> {
        let told = scratch.succeed(&format!("reproduce tiny.toml --dry-run --json {arguments}"));
        let json: Value = serde_json::from_str(&told).unwrap();
        json["missing"].as_array().unwrap().iter().map(|kind| kind["cells"].as_u64().unwrap()).collect()
    };
    // Judging two sets by each method, weighing one, and training on the whole of two by each imitator; twice.
    assert_eq!(cells(""), [4, 4, 2, 4, 4]);
    assert_eq!(cells("--preset quick"), [2, 2, 1, 2, 2]);
    assert_eq!(cells("--seeds 3"), [6, 6, 3, 6, 6]);
    assert_eq!(cells("--only unseen/cloning"), [2]);
    let told = scratch.succeed("reproduce tiny.toml --dry-run --only unseen/cloning");
    assert!(told.contains("Only these sets were asked for: unseen."), "{told}");
    // Where the set that lends its prior is judged too, it is not asked for.
    let judged = STUDY.replacen("seeds = 0\n", "", 1);
    assert_ne!(judged, STUDY);
    fs::write(scratch.0.join("tiny.toml"), judged).unwrap();
    assert_eq!(cells("--only unseen/cloning"), [2]);
    fs::write(scratch.0.join("tiny.toml"), STUDY).unwrap();
    assert!(!scratch.0.join("runs").exists());
    let data = in_repository("data");
    let told = scratch.succeed(&format!("reproduce all --dry-run --preset quick --data {}", data.display()));
    for part in [
        "Fig. 3: ",
        "Fig. 4 and 10: ",
        "Table 1: ",
        "judging by MAML + MI",
        "weighing by MAML",
        "trainings more depend",
    ] {
        assert!(told.contains(part), "{told}");
    }
    // But for what it asks besides, it is made of cells that others have counted.
    let (_, table) = told.split_once("Table 1: ").unwrap();
    let (table, _) = table.split_once("Eq. 9: ").unwrap();
    assert!(!table.contains("judging by MAML + MI") && !table.contains("judging by Avg"), "{table}");
    assert!(table.contains("judging by MAML, 15 meta-updates"), "{table}");
}

/// The command fails with one error that says all of `wanted`, and makes no folder.
#[track_caller]
fn refuses(scratch: &Scratch, arguments: &str, wanted: &[&str]) {
    scratch.refuse(arguments, wanted);
    assert!(!scratch.0.join("runs").exists(), "a folder was made");
}

/// A file of results has curves where its own figures show them; which others are drawn is known only when all is judged.
#[test]
fn trainings_without_a_curve_are_taken_over_until_a_figure_shows_them() {
    let scratch = scratch("reproduce-without-curves");
    let all = STUDY.replace("[curves]", "[oracle]\nimitators = [\"gail\"]\nseeds = 2\n[curves]");
    fs::write(scratch.0.join("tiny.toml"), &all).unwrap();
    let figure = "[[figures]]\nname = \"curves\"\ntitle = \"Curves\"\ndraws = \"top_k\"\n";
    fs::write(scratch.0.join("blind.toml"), all.replace(figure, "")).unwrap();
    scratch.succeed("reproduce blind.toml --out blind --only four/curves,oracle --page blind.md");
    let kinds = |json: &str| -> Vec<String> {
        let told: Value = serde_json::from_str(json).unwrap();
        let kinds = told["missing"].as_array().unwrap().iter();
        kinds.map(|kind| kind["name"].as_str().unwrap().to_owned()).collect()
    };
    let dry = scratch
        .succeed("reproduce tiny.toml --out run --from blind.json --only four/oracle --dry-run --json");
    assert!(kinds(&dry).is_empty(), "the oracle is there: {dry}");
    scratch.succeed("reproduce tiny.toml --out run --from blind.json --page page.md");
    let csv = read(&scratch, "curves.csv");
    assert!(csv.lines().skip(1).all(|line| line.ends_with(",2")), "each curve is of both seeds: {csv}");
    assert!(csv.contains("\"four, gail\",cloning,top 1,"), "{csv}");

    // Of several files the one that has the curve gives the cell, and what one lacks another has.
    scratch.succeed("reproduce tiny.toml --out both --from blind.json --from tiny.json");
    assert!(fs::read_dir(scratch.0.join("both/cells")).unwrap().next().is_none(), "nothing was made");
}

#[test]
fn each_mistake_of_a_user_is_told() {
    let scratch = scratch("reproduce-mistakes");
    refuses(
        &scratch,
        "reproduce fig2",
        &[
            "no experiment 'fig2'; there are: fig3, fig4, fig5, fig6, fig7, fig8, fig9, table1, variants, all",
            "hint: or give a study file",
        ],
    );
    refuses(
        &scratch,
        "reproduce fig3",
        &[
            "the folder of the demonstration sets is not there: data",
            "hint: call it in a checkout of demosift",
            "--data DIR",
        ],
    );
    refuses(&scratch, "reproduce fig3 --data set", &["the set 'free_throw_8'", "set/free_throw_8"]);
    refuses(&scratch, "reproduce none.toml", &["the study file does not exist", "none.toml"]);
    refuses(&scratch, "reproduce none.json", &["the file of results does not exist", "none.json"]);
    refuses(&scratch, "reproduce set", &["holds no results of an experiment", "set"]);
    refuses(&scratch, "reproduce tiny.toml --seeds 0", &["--seeds 0: must be at least 1"]);
    refuses(&scratch, "reproduce tiny.toml --only five", &["no set 'five'; it has: four, lent, unseen"]);
    refuses(&scratch, "reproduce tiny.toml --only /papers", &["no method 'papers'", "weights, curves"]);
    let ordinary = in_repository("studies/point_mass.toml");
    refuses(
        &scratch,
        &format!("reproduce {}", ordinary.display()),
        &["this study draws nothing", "hint: make it with demosift study"],
    );
    let data = in_repository("data");
    refuses(
        &scratch,
        &format!("reproduce all --data {} --page all.md", data.display()),
        &["several experiments have a page each", "all.md", "hint: give a folder"],
    );
    for (from, to, wanted) in [
        ("draws = \"top_k\"", "draws = \"top\"", vec!["unknown variant `top`", "hint: docs/studies.md"]),
        (
            "[by_preset.quick]",
            "[by_preset.fast]",
            vec!["no preset 'fast'; there are: quick, standard, paper"],
        ),
        ("prior = \"lent\"", "prior = \"unseen\"", vec!["must be another set"]),
        ("bodies.json", "nobody.json", vec!["does not exist", "nobody.json"]),
        ("methods = [\"MAML\"]\nsets", "methods = [\"both\"]\nsets", vec!["no method 'both'"]),
        ("at = [1, \"half\"]", "at = [1, \"third\"]", vec!["K = third"]),
        (
            "better = \"MAML\"",
            "better = \"MAMA\"",
            vec!["the claim 'MAML chooses better than cloning.'", "no method 'MAMA'"],
        ),
        (
            "inner.batch_steps",
            "inner.batch_step",
            vec!["there is no key inner.batch_step (from judging.values)"],
        ),
    ] {
        assert!(STUDY.contains(from), "{from}");
        fs::write(scratch.0.join("tiny.toml"), STUDY.replacen(from, to, 1)).unwrap();
        refuses(&scratch, "reproduce tiny.toml", &wanted);
    }
}

#[test]
fn a_method_may_learn_its_prior_on_each_set_itself() {
    let scratch = scratch("reproduce_own_prior");
    let judging = STUDY
        .split("[curves]")
        .next()
        .unwrap()
        .replace("name = \"MAML\"", "name = \"MAML\"\nown_prior = true");
    let found = |name: &str, study: &str| {
        fs::write(scratch.0.join(format!("{name}.toml")), study).unwrap();
        scratch.succeed(&format!("study {name}.toml --only unseen/MAML --out {name}"));
        let cell: Value =
            serde_json::from_str(&read(&scratch, &format!("{name}/cells/judging_unseen_MAML_0.json")))
                .unwrap();
        cell["found"]["judging"]["demonstrations"].clone()
    };
    let own = found("own", &judging);
    assert_eq!(own, found("alone", &judging.replace("prior = \"lent\"", "").replace("own_prior = true", "")));
    assert_ne!(own, found("lent", &judging.replace("own_prior = true", "")));
    let combined = format!(
        "{judging}[[methods]]\nname = \"both\"\nrule = \"ranks\"\nof = [\"MAML\"]\nown_prior = true\n"
    );
    fs::write(scratch.0.join("combined.toml"), combined).unwrap();
    refuses(&scratch, "study combined.toml", &["'both' combines others", "no prior of its own"]);
}

#[test]
fn the_experiments_can_be_read_as_studies_too() {
    let scratch = Scratch::new("reproduce-as-study");
    for entry in fs::read_dir(in_repository("reproduce")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            let told = scratch.succeed(&format!("study {} --dry-run", path.display()));
            assert!(told.contains("Nothing was made"), "{told}");
        }
    }
}
