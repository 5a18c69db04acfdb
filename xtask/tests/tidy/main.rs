//! The invariants of ARCHITECTURE.md, read off the files.
//!
//! Each rule has two tests: the tree obeys it, and a planted violation does not get past it.
//! What stands under `#[cfg(test)]`, or in a file `tests.rs` or `.._tests.rs`, is exempt from all of them.

mod layers;
mod rules;
mod sources;

use layers::Table;
use sources::{Source, checkout, files, read, rust_files};
use std::fmt;

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
    rust_files("crates/demosift/src")
}

fn mujoco() -> Vec<Source> {
    rust_files("crates/demosift-mujoco/src")
}

fn crates() -> Vec<Source> {
    rust_files("crates")
}

fn table() -> Table {
    Table::read(&read("ARCHITECTURE.md"))
}

/// Fails with every violation, one a line.
fn tidy(violations: Vec<Violation>) {
    let list: Vec<String> = violations.iter().map(ToString::to_string).collect();
    assert!(list.is_empty(), "\n\n{}\n", list.join("\n"));
}

/// The violations of planted files are found at exactly these places: `file:line`.
fn caught(violations: &[Violation], places: &[&str]) {
    let found: Vec<String> =
        violations.iter().map(|violation| format!("{}:{}", violation.path, violation.line)).collect();
    assert_eq!(found, places);
}

fn planted(module: &str, text: &str) -> Source {
    Source::new(&format!("crates/demosift/src/{module}.rs"), text)
}

fn planted_table() -> Table {
    Table::read(
        "| layer | what | modules | neighbors |\n|---|---|---|---|\n\
         | 0 | words | `error`, `seed` | yes |\n| 4 | playing | `rollout` | no |\n| 5 | rules | `trpo`, `gail` | no |\n| 7 | judging | `judge` | no |",
    )
}

#[test]
fn layer_table_is_complete() {
    tidy(layers::table_is_complete(&table(), &library()));
}

#[test]
fn layer_table_is_complete_catches() {
    let library = ["error", "seed", "rollout", "trpo", "gail", "magic/mod"].map(|module| planted(module, ""));
    caught(
        &layers::table_is_complete(&planted_table(), &library),
        &["crates/demosift/src/magic/mod.rs:1", "ARCHITECTURE.md:1"],
    );
}

#[test]
fn modules_use_lower_layers_only() {
    tidy(layers::uses_go_down(&table(), &library()));
}

#[test]
fn modules_use_lower_layers_only_catches() {
    let library = [
        planted("lib", "pub mod judge;\npub use error::Error;\npub use judge::{Verdict, judge};"),
        planted("error", "use crate::seed::Seed;\n// use crate::judge;\nlet s = \"crate::judge\";"),
        planted("seed", "use crate::{\n    Error,\n    Verdict,\n};\nfn f(x: crate::trpo::Step<'_>) {}"),
        planted(
            "trpo",
            "use crate::{error::{Error, Result as R}, gail::{self, D}, seed::*};\nuse super::gail;",
        ),
        planted("gail", "use crate::error;\n#[cfg(test)]\nmod tests {\n    use crate::judge;\n}"),
        planted("judge", "use crate::trpo;\npub(crate) fn f() {}"),
        planted("rollout/inner", "use super::super::judge::x;\nuse super::other;\nuse crate::error::Error;"),
    ];
    caught(
        &layers::uses_go_down(&planted_table(), &library),
        &[
            "crates/demosift/src/seed.rs:3",
            "crates/demosift/src/seed.rs:5",
            "crates/demosift/src/trpo.rs:1",
            "crates/demosift/src/trpo.rs:1",
            "crates/demosift/src/trpo.rs:2",
            "crates/demosift/src/rollout/inner.rs:1",
        ],
    );
}

#[test]
fn neighbors_use_each_other_in_no_circle() {
    tidy(layers::no_circles(&table(), &library()));
}

#[test]
fn neighbors_use_each_other_in_no_circle_catches() {
    let straight = [planted("error", "use crate::seed::Seed;"), planted("seed", "use std::fmt;")];
    caught(&layers::no_circles(&planted_table(), &straight), &[]);
    let circle = [planted("error", "use crate::seed::Seed;"), planted("seed", "\nuse crate::error;")];
    caught(
        &layers::no_circles(&planted_table(), &circle),
        &["crates/demosift/src/error.rs:1", "crates/demosift/src/seed.rs:2"],
    );
}

#[test]
fn the_mujoco_crate_imports_no_algorithm() {
    tidy(layers::mujoco_imports_no_algorithm(&table(), &library(), &mujoco()));
}

#[test]
fn the_mujoco_crate_imports_no_algorithm_catches() {
    let library = [planted("lib", "pub use error::{Error, Result};")];
    let mujoco = [Source::new(
        "crates/demosift-mujoco/src/lib.rs",
        "use demosift::{Error, rollout};\nuse demosift::seed::Seed;\nuse demosift::trpo::step;\nuse demosift::{\n    error,\n    judge as j,\n};\nuse demosift::Trpo;",
    )];
    caught(
        &layers::mujoco_imports_no_algorithm(&planted_table(), &library, &mujoco),
        &[
            "crates/demosift-mujoco/src/lib.rs:3",
            "crates/demosift-mujoco/src/lib.rs:6",
            "crates/demosift-mujoco/src/lib.rs:8",
        ],
    );
}

#[test]
fn no_crate_names_one_above_it() {
    tidy(rules::library_knows_no_other_crate(&library()));
    tidy(rules::mujoco_knows_no_command(&mujoco()));
}

#[test]
fn no_crate_names_one_above_it_catches() {
    let library = [planted("trpo", "// mujoco_rs\nuse demosift_mujoco::Humanoid;")];
    caught(&rules::library_knows_no_other_crate(&library), &["crates/demosift/src/trpo.rs:2"]);
    let mujoco = [Source::new("crates/demosift-mujoco/src/lib.rs", "use demosift_cli::run;")];
    caught(&rules::mujoco_knows_no_command(&mujoco), &["crates/demosift-mujoco/src/lib.rs:1"]);
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
        Source::new("crates/demosift-cli/src/terminal.rs", talk),
        Source::new("crates/demosift/benches/learner.rs", talk),
        Source::new("crates/demosift-mujoco/build.rs", talk),
        planted("nn/mlp_tests", talk),
        planted("gail", "/// println!()\n#[cfg(test)]\nmod tests {\n    fn f() { println!(); }\n}"),
    ];
    caught(
        &rules::only_the_terminal_prints(&sources),
        &["crates/demosift/src/trpo.rs:2", "crates/demosift-cli/src/main.rs:1"],
    );
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
}

#[test]
fn the_library_has_no_hash_map() {
    tidy(rules::library_has_no_hash_map(&library()));
}

#[test]
fn the_library_has_no_hash_map_catches() {
    let library = [planted("gail", "use std::collections::{BTreeMap, HashMap};")];
    caught(&rules::library_has_no_hash_map(&library), &["crates/demosift/src/gail.rs:1"]);
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
}

#[test]
fn judging_knows_no_provenance() {
    tidy(rules::judging_knows_no_provenance(&library()));
}

#[test]
fn judging_knows_no_provenance_catches() {
    let library = [
        planted("stages/judge", "/// Knows no provenance.\nlet x = read(\"Provenance.json\");"),
        planted("data/demonstration/mod", "struct DemoProvenance;"),
        planted("results/provenance", "pub struct Provenance;"),
        planted("lib", "pub mod provenance;"),
    ];
    caught(
        &rules::judging_knows_no_provenance(&library),
        &["crates/demosift/src/stages/judge.rs:2", "crates/demosift/src/data/demonstration/mod.rs:1"],
    );
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
