//! The invariants of ARCHITECTURE.md, read off the files.
//!
//! Each rule has two tests: the tree obeys it, and offences do not get past it.
//! Some offences are planted in files made for it, and at least one in a real file of the tree, so that no rule is about what is
//! not there.
//! What stands under `#[cfg(test)]`, or in a file `tests.rs` or `.._tests.rs`, is exempt from all of them.

mod bands;
mod modules;
mod packages;
mod rules;
mod sources;

use bands::{Bands, COMMAND, LIBRARY};
use sources::{Source, checkout, files, read, rust_files};
use std::fmt;

const MUJOCO: &str = "crates/demosift-mujoco/src/";
const GYMNASIUM: &str = "crates/demosift-gymnasium/src/";

/// One place that breaks one rule.
pub(crate) struct Violation {
    path: String,
    line: usize,
    rule: &'static str,
    message: String,
}

impl Violation {
    pub(crate) fn new(path: &str, line: usize, rule: &'static str, message: String) -> Self {
        Self { path: path.to_owned(), line, rule, message }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}:{}: {}: {}", self.path, self.line, self.rule, self.message)
    }
}

fn library() -> Vec<Source> {
    rust_files(LIBRARY)
}

fn mujoco() -> Vec<Source> {
    rust_files(MUJOCO)
}

fn gymnasium() -> Vec<Source> {
    rust_files(GYMNASIUM)
}

fn command() -> Vec<Source> {
    rust_files(COMMAND)
}

fn crates() -> Vec<Source> {
    rust_files("crates")
}

fn real_bands() -> Bands {
    Bands::read(&read("ARCHITECTURE.md"))
}

fn bands_of_command() -> Bands {
    Bands::of_command(&read("ARCHITECTURE.md"))
}

/// Fails with every violation, one per line.
fn tidy(violations: Vec<Violation>) {
    let list: Vec<String> = violations.iter().map(ToString::to_string).collect();
    assert!(list.is_empty(), "\n\n{}\n", list.join("\n"));
}

/// The violations of planted files are found at exactly these places: `file:line`.
fn caught(violations: &[Violation], places: &[&str]) {
    assert_eq!(places_of(violations), places);
}

/// An offence in a real file is found, and everything that is found lies in its way.
fn caught_among(violations: &[Violation], place: &str) {
    assert!(places_of(violations).iter().any(|found| found == place), "{:?}", places_of(violations));
}

fn places_of(violations: &[Violation]) -> Vec<String> {
    violations.iter().map(|violation| format!("{}:{}", violation.path, violation.line)).collect()
}

fn planted(module: &str, text: &str) -> Source {
    Source::new(&format!("{LIBRARY}{module}.rs"), text)
}

/// The real files with one line more in one of them, the first below what the file says of itself; and where that is.
fn with_line(mut sources: Vec<Source>, path: &str, line: &str) -> (Vec<Source>, String) {
    let text = read(path);
    let is_header = |line: &&str| line.starts_with("//!") || line.starts_with("#!");
    let above = text.lines().take_while(is_header).count();
    let mut lines: Vec<&str> = text.lines().collect();
    lines.insert(above, line);
    let changed = Source::new(path, &lines.join("\n"));
    let real = sources.iter_mut().find(|source| source.path == path);
    *real.unwrap_or_else(|| panic!("{path} is none of the files")) = changed;
    (sources, format!("{path}:{}", above + 1))
}

fn planted_bands() -> Bands {
    Bands::read(
        "| band | holds |\n|---|---|\n| `basics/` | errors |\n| `world/` | policies |\n| `learning/` | rules |\n| `stages/` | steps |",
    )
}

#[test]
fn the_table_names_the_folders() {
    tidy(bands::table_names_the_folders(&real_bands(), &library()));
    tidy(bands::table_names_the_folders(&bands_of_command(), &command()));
}

#[test]
fn the_table_names_the_folders_catches() {
    let files = [
        "lib",
        "basics/mod",
        "basics/error",
        "world/mod",
        "learning",
        "learning/trpo",
        "magic",
        "magic/wand",
    ];
    caught(
        &bands::table_names_the_folders(&planted_bands(), &files.map(|file| planted(file, ""))),
        &[
            "crates/demosift/src/learning.rs:1",
            "crates/demosift/src/magic.rs:1",
            "crates/demosift/src/magic/wand.rs:1",
            "ARCHITECTURE.md:1",
        ],
    );
    let mut moved = library();
    moved.push(planted("judge", &read("crates/demosift/src/stages/judge.rs")));
    caught(&bands::table_names_the_folders(&real_bands(), &moved), &["crates/demosift/src/judge.rs:1"]);
    let table = read("ARCHITECTURE.md");
    let without: Vec<&str> = table.lines().filter(|line| !line.starts_with("| `math/`")).collect();
    caught_among(
        &bands::table_names_the_folders(&Bands::read(&without.join("\n")), &library()),
        "crates/demosift/src/math/rows.rs:1",
    );
}

#[test]
fn bands_use_lower_ones_only() {
    tidy(bands::uses_go_down(&real_bands(), &library()));
    tidy(bands::uses_go_down(&bands_of_command(), &command()));
}

#[test]
fn bands_use_lower_ones_only_catches() {
    let library = [
        planted(
            "lib",
            "pub mod basics;\npub use basics::error::Error;\npub use stages::judge::{self, Verdict as Said};",
        ),
        planted("basics/mod", "pub mod error;\npub mod seed;\npub use seed::Seed;"),
        planted(
            "basics/error",
            "use crate::basics::seed::Seed;\n// use crate::stages::judge;\nlet s = \"crate::stages\";",
        ),
        planted(
            "basics/seed",
            "use crate::{\n    Error,\n    Said,\n};\nfn f(x: crate::learning::trpo::Step<'_>) {}",
        ),
        planted("learning/mod", "pub(crate) use trpo::step;\npub use crate::stages::judge::judge;"),
        planted(
            "learning/trpo",
            "use crate::{basics::{error::{Error, Result as R}, Seed}, stages::{self, judge::*}};\nuse super::super::stages;",
        ),
        planted(
            "learning/gail",
            "use crate::basics;\n#[cfg(test)]\nmod tests {\n    use crate::stages::judge;\n}",
        ),
        planted("stages/mod", "pub mod judge;"),
        planted(
            "stages/judge",
            "use crate::learning::step;\nuse crate::learning::trpo;\npub(crate) fn f() {}",
        ),
        planted("world/mod", ""),
        planted(
            "world/inner/deep",
            "use super::super::super::stages::judge::x;\nuse super::other;\nuse crate::learning::judge;",
        ),
    ];
    caught(
        &bands::uses_go_down(&planted_bands(), &library),
        &[
            "crates/demosift/src/basics/seed.rs:3",
            "crates/demosift/src/basics/seed.rs:5",
            "crates/demosift/src/learning/mod.rs:2",
            "crates/demosift/src/learning/trpo.rs:1",
            "crates/demosift/src/learning/trpo.rs:1",
            "crates/demosift/src/learning/trpo.rs:2",
            "crates/demosift/src/world/inner/deep.rs:3",
            "crates/demosift/src/world/inner/deep.rs:1",
        ],
    );
}

#[test]
fn bands_use_lower_ones_only_catches_it_in_real_files() {
    for (file, line) in [
        ("stages/judge.rs", "use crate::results::recording::Origin;"),
        ("math/statistics.rs", "use crate::stages::judge::{ScoreTable, judge};"),
        ("data/demonstration/d4rl/states.rs", "use super::super::super::super::world::policy::Policy;"),
    ] {
        let (library, place) = with_line(library(), &format!("{LIBRARY}{file}"), line);
        caught_among(&bands::uses_go_down(&real_bands(), &library), &place);
    }
    for (file, line) in [
        ("files/lock.rs", "use crate::console::terminal;"),
        ("job/fit.rs", "use crate::{answers, job::own_heuristic};"),
        ("tables/panel.rs", "use crate::answers::Spending;"),
    ] {
        let (command, place) = with_line(command(), &format!("{COMMAND}{file}"), line);
        caught_among(&bands::uses_go_down(&bands_of_command(), &command), &place);
    }
    let mut beside = command();
    beside.push(Source::new("crates/demosift-cli/src/planted.rs", ""));
    caught(
        &bands::table_names_the_folders(&bands_of_command(), &beside),
        &["crates/demosift-cli/src/planted.rs:1"],
    );
}

#[test]
fn files_use_each_other_in_no_circle() {
    let crates = [(LIBRARY, library()), (MUJOCO, mujoco()), (GYMNASIUM, gymnasium()), (COMMAND, command())];
    for (folder, sources) in crates {
        tidy(bands::no_circles(folder, &sources));
    }
}

#[test]
fn files_use_each_other_in_no_circle_catches() {
    let circles = |files: &[(&str, &str)]| {
        let sources: Vec<Source> = files.iter().map(|(file, text)| planted(file, text)).collect();
        places_of(&bands::no_circles(LIBRARY, &sources))
    };
    let straight = [("basics/error", "use crate::basics::seed::Seed;"), ("basics/seed", "use std::fmt;")];
    assert!(circles(&straight).is_empty());
    let circle = [("basics/error", "use super::seed::Seed;"), ("basics/seed", "\nuse crate::basics::error;")];
    assert_eq!(
        circles(&circle),
        ["crates/demosift/src/basics/error.rs:1", "crates/demosift/src/basics/seed.rs:2"]
    );
    // A file and its parts may use each other, and its parts count for it beside others.
    let parts = [("a", "use crate::b::B;"), ("b", "mod c;\nuse c::C;"), ("b/c", "use super::B;"), ("d", "")];
    assert!(circles(&parts).is_empty());
    let parts = [("a", "use crate::b::B;"), ("b", "mod c;"), ("b/c", "use super::B;\nuse crate::a;")];
    assert_eq!(circles(&parts), ["crates/demosift/src/a.rs:1", "crates/demosift/src/b/c.rs:2"]);
    // By way of a re-export, and by way of a third.
    let parts = [
        ("m/mod", "pub use one::One;\npub use other::Other;"),
        ("m/one", "use super::Other;"),
        ("m/other", "use super::third;"),
        ("m/third", "use super::One;"),
    ];
    assert_eq!(circles(&parts).len(), 3);
}

#[test]
fn files_use_each_other_in_no_circle_catches_it_in_real_files() {
    for (folder, sources, file, line) in [
        (LIBRARY, library(), "data/demonstration/episode.rs", "use crate::data::demonstration::open::open;"),
        (LIBRARY, library(), "data/demonstration/hdf5.rs", "use super::{d4rl, npz};"),
        (LIBRARY, library(), "run/study/parts.rs", "use super::Study;"),
        (MUJOCO, mujoco(), "task/task_file.rs", "use crate::task::reset::Reset;"),
        (MUJOCO, mujoco(), "task/blueprint.rs", "use crate::environment::MujocoEnvironment;"),
        (COMMAND, command(), "files/writing.rs", "use crate::console::{interruption::GoesOn, terminal};"),
    ] {
        let (sources, place) = with_line(sources, &format!("{folder}{file}"), line);
        caught_among(&bands::no_circles(folder, &sources), &place);
    }
}

#[test]
fn strangers_stay_apart() {
    tidy(bands::strangers_stay_apart(&library()));
}

#[test]
fn strangers_stay_apart_catches() {
    for (file, line) in [
        ("learning/trpo.rs", "use crate::learning::gail::Discriminator;"),
        ("learning/mutual_information/posterior.rs", "use super::super::adapt::Learner;"),
        ("stages/judge/race.rs", "use crate::stages::imitate::imitate;"),
        ("stages/pre_train.rs", "use super::select::Ranking;"),
        ("stages/referee/decision.rs", "use crate::stages::subset_selection::Weighing;"),
        ("results/uncertainty.rs", "use crate::results::recording;"),
    ] {
        let (library, place) = with_line(library(), &format!("{LIBRARY}{file}"), line);
        caught(&bands::strangers_stay_apart(&library), &[&place]);
    }
    let mut renamed = library();
    renamed.retain(|source| !source.path.contains("learning/gail"));
    caught(&bands::strangers_stay_apart(&renamed), &["crates/demosift/src/:1"]);
}

#[test]
fn the_mujoco_crate_imports_no_algorithm() {
    tidy(bands::mujoco_imports_no_algorithm(&real_bands(), &library(), &mujoco()));
    // Nor does the other crate of simulators.
    tidy(bands::mujoco_imports_no_algorithm(&real_bands(), &library(), &gymnasium()));
}

#[test]
fn the_mujoco_crate_imports_no_algorithm_catches() {
    let library = [
        planted(
            "lib",
            "pub mod basics;\npub mod stages;\npub use basics::error::{Error, Result};\npub use stages::judge;",
        ),
        planted("basics/mod", ""),
        planted("basics/error", ""),
        planted("stages/mod", ""),
        planted("stages/judge", ""),
    ];
    let mujoco = [Source::new(
        "crates/demosift-mujoco/src/lib.rs",
        "use demosift::world::rollout;\nuse demosift::Error;\nuse demosift::{\n    basics::error,\n    learning::{\n        trpo,\n    },\n};\nuse demosift::judge;\nuse demosift::unknown;",
    )];
    caught(
        &bands::mujoco_imports_no_algorithm(&planted_bands(), &library, &mujoco),
        &[
            "crates/demosift-mujoco/src/lib.rs:1",
            "crates/demosift-mujoco/src/lib.rs:6",
            "crates/demosift-mujoco/src/lib.rs:9",
            "crates/demosift-mujoco/src/lib.rs:10",
        ],
    );
}

#[test]
fn the_mujoco_crate_imports_no_algorithm_catches_it_in_real_files() {
    let line = "use demosift::{learning::gail::Discriminator, world::policy::Policy};";
    let (mujoco, place) = with_line(mujoco(), &format!("{MUJOCO}environment.rs"), line);
    caught(&bands::mujoco_imports_no_algorithm(&real_bands(), &library(), &mujoco), &[&place]);
}

#[test]
fn what_rules_name_is_there() {
    tidy(rules::named_things_exist(&crates()));
}

#[test]
fn what_rules_name_is_there_catches() {
    let recorder = "crates/demosift/src/results/recording.rs";
    let mut renamed = crates();
    renamed.retain(|source| source.path != recorder);
    renamed.push(Source::new(recorder, &read(recorder).replace("Origin", "Ancestry")));
    caught(&rules::named_things_exist(&renamed), &[&format!("{recorder}:1")]);
}

#[test]
fn the_library_names_no_crate_above_it() {
    tidy(rules::library_knows_no_other_crate(&library()));
}

#[test]
fn the_library_names_no_crate_above_it_catches() {
    let library = [planted("trpo", "// mujoco_rs\nuse demosift_mujoco::Humanoid;")];
    caught(&rules::library_knows_no_other_crate(&library), &["crates/demosift/src/trpo.rs:2"]);
    let (library, place) = in_judging("use demosift_mujoco::registry;");
    caught(&rules::library_knows_no_other_crate(&library), &[&place]);
}

/// The real library with one line more where demonstrations are judged.
fn in_judging(line: &str) -> (Vec<Source>, String) {
    with_line(library(), &format!("{LIBRARY}stages/judge.rs"), line)
}

#[test]
fn all_test_files_are_named() {
    tidy(rules::test_files_are_named(&crates()));
}

#[test]
fn all_test_files_are_named_catches() {
    let planted = |name: &str, text: &str| Source::new(&format!("crates/new/tests/{name}.rs"), text);
    let files = [
        planted("main", "mod one;\n// mod two;\nmod support;"),
        planted("one", ""),
        planted("two", ""),
        planted("support/mod", ""),
        // Without main.rs each file is a program, which cargo finds.
        Source::new("crates/other/tests/three.rs", ""),
    ];
    caught(&rules::test_files_are_named(&files), &["crates/new/tests/two.rs:1"]);
    let mut tests = crates();
    tests.push(Source::new("crates/demosift-cli/tests/planted.rs", ""));
    caught(&rules::test_files_are_named(&tests), &["crates/demosift-cli/tests/planted.rs:1"]);
}

#[test]
fn only_the_terminal_prints() {
    tidy(rules::only_the_terminal_prints(&crates()));
}

#[test]
fn only_the_terminal_prints_catches() {
    let talk = "fn f() {\n    println!(\"x\");\n    writeln!(out, \"x\");\n}\n";
    let sources = [
        planted("trpo", talk),
        Source::new("crates/demosift-cli/src/main.rs", "fn f() { eprintln!() }"),
        Source::new("crates/demosift-cli/src/job.rs", "fn f() { writeln!(std::io::stdout(), \"x\") }"),
        Source::new("crates/demosift-cli/src/console/terminal.rs", talk),
        Source::new("crates/demosift/benches/learner.rs", talk),
        Source::new("crates/demosift-mujoco/build.rs", talk),
        planted("nn/mlp_tests", talk),
        planted("gail", "/// println!()\n#[cfg(test)]\nmod tests {\n    fn f() { println!(); }\n}"),
    ];
    caught(
        &rules::only_the_terminal_prints(&sources),
        &[
            "crates/demosift/src/trpo.rs:2",
            "crates/demosift-cli/src/main.rs:1",
            "crates/demosift-cli/src/job.rs:1",
        ],
    );
    let (library, place) = in_judging("fn planted() { println!(\"judged\"); }");
    caught(&rules::only_the_terminal_prints(&library), &[&place]);
}

#[test]
fn the_library_reads_no_clock_or_environment() {
    tidy(rules::library_reads_no_clock_or_environment(&library()));
}

#[test]
fn the_library_reads_no_clock_or_environment_catches() {
    let library = [
        planted("seed", "use std::time::{Duration, Instant};\nlet v = env!(\"CARGO_PKG_VERSION\");"),
        planted("trpo", "\nlet x = std::env::var(\"X\");\nlet environment = 1;"),
    ];
    caught(
        &rules::library_reads_no_clock_or_environment(&library),
        &["crates/demosift/src/seed.rs:1", "crates/demosift/src/trpo.rs:2"],
    );
    for line in ["use std::time::Instant;", "fn planted() -> bool { std::env::var_os(\"CI\").is_some() }"] {
        let (library, place) = in_judging(line);
        caught(&rules::library_reads_no_clock_or_environment(&library), &[&place]);
    }
}

#[test]
fn the_library_has_no_hash_map() {
    tidy(rules::library_has_no_hash_map(&library()));
}

#[test]
fn the_library_has_no_hash_map_catches() {
    let library = [planted("gail", "use std::collections::{BTreeMap, HashMap};")];
    caught(&rules::library_has_no_hash_map(&library), &["crates/demosift/src/gail.rs:1"]);
    let (library, place) = in_judging("use std::collections::HashSet;");
    caught(&rules::library_has_no_hash_map(&library), &[&place]);
}

#[test]
fn the_library_reads_no_states() {
    tidy(rules::library_reads_no_states(&library()));
}

#[test]
fn the_library_reads_no_states_catches() {
    let library = [
        planted("data/demonstration/d4rl/states", "pub fn read_states() {}"),
        planted("judge", "use crate::demonstration::d4rl;\nlet states = d4rl::read_states(path)?;"),
    ];
    caught(&rules::library_reads_no_states(&library), &["crates/demosift/src/judge.rs:2"]);
    let (library, place) = in_judging("use crate::data::demonstration::open::read_states;");
    caught(&rules::library_reads_no_states(&library), &[&place]);
}

#[test]
fn arguments_have_names() {
    tidy(rules::arguments_have_names(&crates()));
}

#[test]
fn arguments_have_names_catches() {
    let library = [
        planted(
            "trpo",
            "fn f((how, alpha): (&How, f64)) {}\nfn g(sizes: &(usize, usize)) {}\nfn h<F: Fn(u8) -> u8>(\n    x: F,\n    pair: &mut (u8, u8),\n) {}",
        ),
        planted(
            "gail",
            "fn f(x: fn((u8, u8)), y: &dyn Fn((u8, u8)) -> (u8, u8), z: Vec<(u8, u8)>, (): ()) -> (u8, u8) {}\nlet f = |(a, b): (u8, u8)| a;",
        ),
    ];
    caught(
        &rules::arguments_have_names(&library),
        &["crates/demosift/src/trpo.rs:1", "crates/demosift/src/trpo.rs:2", "crates/demosift/src/trpo.rs:3"],
    );
    let (library, place) = in_judging("fn planted((judging, seed): (&Judging, &Seed)) {}");
    caught(&rules::arguments_have_names(&library), &[&place]);
}

#[test]
fn unsafe_stands_in_named_files() {
    tidy(rules::unsafe_stands_in_named_files(&crates()));
}

#[test]
fn unsafe_stands_in_named_files_catches() {
    let sources = [
        Source::new("crates/demosift-mujoco/src/quiet.rs", "unsafe { call() }"),
        Source::new(
            "crates/demosift-mujoco/src/model.rs",
            "// unsafe\n#![allow(unsafe_code)]\nunsafe fn f() {}",
        ),
    ];
    caught(
        &rules::unsafe_stands_in_named_files(&sources),
        &["crates/demosift-mujoco/src/model.rs:3", "crates/demosift-mujoco/src/model.rs:2"],
    );
    let (library, place) = in_judging("unsafe fn planted() {}");
    caught(&rules::unsafe_stands_in_named_files(&library), &[&place]);
}

#[test]
fn judging_knows_no_provenance() {
    tidy(rules::judging_knows_no_provenance(&library()));
}

#[test]
fn judging_knows_no_provenance_catches() {
    let library = [
        planted(
            "stages/judge",
            "/// Knows no provenance, and no Origin.\nlet x = read(\"Provenance.json\");",
        ),
        planted("data/demonstration/mod", "struct DemoProvenance;"),
        planted("results/recording", "pub struct Origin;"),
        planted("results/mod", "pub mod recording;"),
        planted("run/study/make", "\nlet score = recorded.origin.score;"),
    ];
    caught(
        &rules::judging_knows_no_provenance(&library),
        &[
            "crates/demosift/src/run/study/make.rs:2",
            "crates/demosift/src/stages/judge.rs:2",
            "crates/demosift/src/data/demonstration/mod.rs:1",
        ],
    );
    for line in [
        "use crate::results::recording::Origin;",
        "use crate::results::recording::{self, Origin as From};",
        "fn planted(of: &crate::results::recording::Recorded) -> f64 { of.origin.stage_score }",
        "const PLANTED: &str = \"provenance.json\";",
    ] {
        let (library, place) = in_judging(line);
        caught(&rules::judging_knows_no_provenance(&library), &[&place]);
    }
}

#[test]
fn files_are_short() {
    tidy(rules::files_are_short(&crates()));
    tidy(rules::files_are_short(&rust_files("xtask/src")));
}

#[test]
fn files_are_short_catches() {
    let tests = format!("fn f() {{}}\n#[cfg(test)]\nmod tests {{\n{}}}\n", "// line\n".repeat(700));
    let sources = [
        planted("trpo", &"// line\n".repeat(601)),
        planted("gail", &"\n".repeat(600)),
        planted("judge", &tests),
    ];
    caught(&rules::files_are_short(&sources), &["crates/demosift/src/trpo.rs:601"]);
    let (library, _) = in_judging(&"// line\n".repeat(600));
    caught(&rules::files_are_short(&library), &["crates/demosift/src/stages/judge.rs:601"]);
}

#[test]
fn links_in_documents_lead_somewhere() {
    for path in files("", "md") {
        tidy(rules::links_lead_somewhere(&path, &read(&path), &checkout()));
    }
}

#[test]
fn links_in_documents_lead_somewhere_catches() {
    let text = "[a](https://example.org) [b](../Cargo.toml#x)\n[c](#here) [d](nowhere.md)";
    let violations = rules::links_lead_somewhere("docs/planted.md", text, &checkout());
    caught(&violations, &["docs/planted.md:2"]);
    let text = read("ARCHITECTURE.md").replace("(docs/paper.md)", "(docs/papers.md)");
    let violations = rules::links_lead_somewhere("ARCHITECTURE.md", &text, &checkout());
    assert!(!violations.is_empty() && violations.iter().all(|of| of.message.contains("docs/papers.md")));
}

#[test]
fn tests_that_the_paper_page_names_exist() {
    let code: String = crates().iter().map(|source| source.path.as_str()).map(read).collect();
    tidy(rules::named_tests_exist("docs/paper.md", &read("docs/paper.md"), &code));
}

#[test]
fn tests_that_the_paper_page_names_exist_catches() {
    let text = "| a | b |\n|---|---|\n| `x` | `y` |\n\n| paper | test |\n|---|---|\n| Eq. 1 | `eq_1` |\n| Eq. 2 | `eq_2` |\n| Eq. 3 | not yet |\n| Eq. 4 | `eq_…`, `eq_4_…` |";
    caught(&rules::named_tests_exist("paper.md", text, "fn eq_1() {}"), &["paper.md:8", "paper.md:10"]);
    let code: String = crates().iter().map(|source| source.path.as_str()).map(read).collect();
    let renamed = code.replace("fn residual_vanishes_", "fn the_residual_vanishes_");
    let violations = rules::named_tests_exist("docs/paper.md", &read("docs/paper.md"), &renamed);
    assert!(!violations.is_empty() && violations.iter().all(|of| of.message.contains("residual_vanishes_")));
}

#[test]
fn modules_that_documents_name_exist() {
    let library = library();
    for path in files("", "md") {
        tidy(bands::named_modules_exist(&real_bands(), &library, &path, &read(&path)));
    }
}

#[test]
fn modules_that_documents_name_exist_catches() {
    let text =
        read("docs/paper.md").replace("`learning::gail::Discriminator`", "`learning::gale::Discriminator`");
    let violations = bands::named_modules_exist(&real_bands(), &library(), "docs/paper.md", &text);
    assert!(!violations.is_empty() && violations.iter().all(|of| of.message.contains("gale")));
}

#[test]
fn the_reader_of_files_tells_code_from_text() {
    let text = "let a = 'x'; let b = '\"'; // \"one\nlet c: &'static str = r#\"two \" //\"#;\n/* three /* */ four */ let d = '\\'';\nlet e = \"\\\"five\"; six();";
    let source = Source::new("a.rs", text);
    for gone in ["one", "two", "three", "four", "five"] {
        assert!(!source.code.contains(gone), "{gone}: {}", source.code);
    }
    for kept in ["let a", "let b", "static str", "let d", "let e", "six()"] {
        assert!(source.code.contains(kept), "{kept}: {}", source.code);
    }
    assert!(source.code_and_strings.contains("two") && !source.code_and_strings.contains("one"));
    assert_eq!(source.code.len(), text.len());
    assert_eq!(source.line(source.code.find("six").unwrap()), 4);
}
