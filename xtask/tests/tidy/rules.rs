//! The rules that need nothing but the words of a file.

use crate::Violation;
use crate::sources::{Source, is_word};
use std::path::Path;

/// Files that may hold unsafe code; each wraps one foreign call for which there is no safe one.
const UNSAFE_FILES: [&str; 3] = [
    "crates/demosift-mujoco/src/quiet.rs",
    "crates/demosift/src/math/nn/product.rs",
    "crates/demosift/benches/learner.rs",
];
const TERMINAL: &str = "crates/demosift-cli/src/console/terminal.rs";
/// The file that talks to another process.
const CHILD: &str = "crates/demosift-gymnasium/src/process.rs";
/// The file that has the last word where MuJoCo ends the process.
const LAST_WORD: &str = "crates/demosift-mujoco/src/quiet.rs";
/// The modules that pass on the simulator's states of recorded episodes.
const STATES_READER: &str = "crates/demosift/src/data/demonstration/";
const MOST_LINES: usize = 600;
/// The file that says where recorded demonstrations came from.
const RECORDER: &str = "crates/demosift/src/results/recording.rs";
/// The type that says it, and the fields that hold it.
const ORIGINS: [&str; 2] = ["Origin", "origin"];
/// What files are called that keep it.
const PROVENANCE: &str = "provenance";
/// Crates above the library.
const ABOVE: [&str; 3] = ["demosift_mujoco", "mujoco_rs", "demosift_gymnasium"];
/// Where the terminal is written to without a macro that prints.
const OUTPUTS: [&str; 2] = ["stdout", "stderr"];
const STATES: &str = "read_states";

/// What is ours among the names that rules forbid or excuse is there: a rule about what is not there forbids nothing.
pub(crate) fn named_things_exist(sources: &[Source]) -> Vec<Violation> {
    let mut wanted = vec![
        (STATES_READER, STATES),
        (RECORDER, ORIGINS[0]),
        (RECORDER, ORIGINS[1]),
        ("crates/", PROVENANCE),
        ("crates/demosift-cli/", ABOVE[0]),
        ("crates/demosift-mujoco/", ABOVE[1]),
        ("crates/demosift-cli/", ABOVE[2]),
        (TERMINAL, OUTPUTS[0]),
        (TERMINAL, OUTPUTS[1]),
        (CHILD, OUTPUTS[0]),
        (LAST_WORD, OUTPUTS[1]),
    ];
    wanted.extend(UNSAFE_FILES.map(|file| (file, "unsafe")));
    let is_there = |place: &str, name: &str| {
        let mut there = sources.iter().filter(|source| source.path.starts_with(place));
        there.any(|source| {
            source.words(name).next().is_some() || source.code_and_strings.contains(&format!("\"{name}"))
        })
    };
    wanted.retain(|(place, name)| !is_there(place, name));
    wanted
        .into_iter()
        .map(|(place, name)| {
            Violation::new(place, 1, "rules", format!("a rule is about `{name}`, which is not there"))
        })
        .collect()
}

/// The library names none of the crates above it.
pub(crate) fn library_knows_no_other_crate(library: &[Source]) -> Vec<Violation> {
    forbidden_words(library, &ABOVE, "crate walls", "the library knows no physics and no command")
}

/// Libraries do not print: one file of the command does. Tests, examples, benchmarks and build scripts may.
pub(crate) fn only_the_terminal_prints(sources: &[Source]) -> Vec<Violation> {
    let quiet = sources.iter().filter(|source| {
        let may = ["/tests/", "/examples/", "/benches/"];
        source.path != TERMINAL
            && !source.path.ends_with("/build.rs")
            && !may.iter().any(|part| source.path.contains(part))
    });
    let mut violations = Vec::new();
    for source in quiet {
        let macros = ["print!", "println!", "eprint!", "eprintln!", "dbg!"];
        let outputs = match source.path.as_str() {
            // The pipes of another process have the same names.
            CHILD => &[][..],
            LAST_WORD => &OUTPUTS[..1],
            _ => &OUTPUTS[..],
        };
        for name in macros.iter().chain(outputs) {
            for position in source.words(name) {
                let message = format!("`{name}`: only {TERMINAL} talks to the terminal");
                violations.push(Violation::new(&source.path, source.line(position), "printing", message));
            }
        }
    }
    violations
}

/// The library's results depend on its arguments alone.
pub(crate) fn library_reads_no_clock_or_environment(library: &[Source]) -> Vec<Violation> {
    let clocks = forbidden_words(
        library,
        &["Instant", "SystemTime"],
        "clocks",
        "the library reads no clock; the observer may",
    );
    let mut violations = clocks;
    for source in library {
        // `env!` is read when it is built, so it is none of the user's environment.
        let words = source.words("env").filter(|&position| !source.code[position..].starts_with("env!"));
        violations.extend(words.map(|position| {
            let message = "`env`: the library reads no environment variable; pass the value".to_owned();
            Violation::new(&source.path, source.line(position), "environment", message)
        }));
    }
    violations
}

/// No order that differs from run to run.
pub(crate) fn library_has_no_hash_map(library: &[Source]) -> Vec<Violation> {
    forbidden_words(
        library,
        &["HashMap", "HashSet"],
        "hash maps",
        "its order differs from run to run; use a BTreeMap or a BTreeSet",
    )
}

/// Unsafe code stands in the files named for it.
pub(crate) fn unsafe_stands_in_named_files(sources: &[Source]) -> Vec<Violation> {
    let others = sources.iter().filter(|source| !UNSAFE_FILES.contains(&source.path.as_str()));
    forbidden_words(
        others,
        &["unsafe", "unsafe_code"],
        "unsafe code",
        &format!("it stands only in {}", UNSAFE_FILES.join(", ")),
    )
}

/// What judges never learns where a demonstration came from, neither by the type that says it nor by the name of a file.
pub(crate) fn judging_knows_no_provenance(library: &[Source]) -> Vec<Violation> {
    let others = || library.iter().filter(|source| source.path != RECORDER);
    let why = format!("only {RECORDER} knows where a demonstration came from");
    let mut violations = forbidden_words(others(), &ORIGINS, "provenance", &why);
    for source in others() {
        for (index, line) in source.code_and_strings.lines().enumerate() {
            if line.to_lowercase().contains(PROVENANCE) {
                let message = format!("`{PROVENANCE}`: {why}");
                violations.push(Violation::new(&source.path, index + 1, "provenance", message));
            }
        }
    }
    violations
}

/// Scores can be worked out from the simulator's states, so no module of the library but their reader asks for them.
pub(crate) fn library_reads_no_states(library: &[Source]) -> Vec<Violation> {
    let others = library.iter().filter(|source| !source.path.starts_with(STATES_READER));
    forbidden_words(others, &[STATES], "states", "a score could be worked out from them; replays are outside")
}

/// What travels together has a name: no function takes a tuple of arguments.
pub(crate) fn arguments_have_names(sources: &[Source]) -> Vec<Violation> {
    let mut violations = Vec::new();
    for source in sources.iter().filter(|source| !source.path.contains("/tests/")) {
        for position in source.words("fn") {
            for parameter in parameters(&source.code[position + "fn".len()..]) {
                let kind = split_outside(parameter, ':').get(1).map_or("", |kind| kind.trim());
                let kind = kind.trim_start_matches('&');
                let kind = if kind.starts_with('\'') { kind.trim_start_matches(|c| c != ' ') } else { kind };
                let kind = kind.trim().trim_start_matches("mut ").trim();
                if kind.starts_with('(') && kind != "()" {
                    let message = format!("`{}`: give what travels together a name", kind.replace('\n', " "));
                    violations.push(Violation::new(
                        &source.path,
                        source.line(position),
                        "arguments",
                        message,
                    ));
                }
            }
        }
    }
    violations
}

/// The parameters of a function, from what follows the word `fn`; none of a function's type, which has no name.
fn parameters(after_fn: &str) -> Vec<&str> {
    let after_name = after_fn.trim_start().trim_start_matches(is_word);
    if after_name.len() == after_fn.trim_start().len() {
        return Vec::new();
    }
    let generics = if after_name.starts_with('<') { enclosed(after_name).len() + 2 } else { 0 };
    match after_name[generics..].starts_with('(') {
        true => split_outside(enclosed(&after_name[generics..]), ','),
        false => Vec::new(),
    }
}

/// What stands within the first bracket and its partner.
fn enclosed(text: &str) -> &str {
    let mut depth = 0;
    for (position, character, is_arrow) in with_arrows(text) {
        depth += step(character, is_arrow);
        if depth == 0 {
            return &text[1..position];
        }
    }
    &text[1..]
}

/// The pieces between separators that stand in no bracket.
fn split_outside(text: &str, separator: char) -> Vec<&str> {
    let (mut depth, mut start, mut pieces) = (0, 0, Vec::new());
    for (position, character, is_arrow) in with_arrows(text) {
        if depth == 0 && character == separator {
            pieces.push(&text[start..position]);
            start = position + 1;
        }
        depth += step(character, is_arrow);
    }
    pieces.push(&text[start..]);
    pieces
}

/// Each character, and whether it is the end of an arrow.
fn with_arrows(text: &str) -> impl Iterator<Item = (usize, char, bool)> {
    let mut before = ' ';
    text.char_indices().map(move |(position, character)| {
        let is_arrow = character == '>' && (before == '-' || before == '=');
        before = character;
        (position, character, is_arrow)
    })
}

fn step(character: char, is_arrow: bool) -> i32 {
    match character {
        '(' | '[' | '{' | '<' => 1,
        ')' | ']' | '}' => -1,
        '>' if !is_arrow => -1,
        _ => 0,
    }
}

/// A file can be read in one sitting.
pub(crate) fn files_are_short(sources: &[Source]) -> Vec<Violation> {
    let long = sources.iter().filter(|source| source.lines > MOST_LINES && !source.path.contains("/tests/"));
    long.map(|source| {
        let message = format!("{} lines without tests; at most {MOST_LINES}", source.lines);
        Violation::new(&source.path, MOST_LINES + 1, "length", message)
    })
    .collect()
}

/// Every relative link of a document leads to a file.
pub(crate) fn links_lead_somewhere(path: &str, markdown: &str, checkout: &Path) -> Vec<Violation> {
    let folder = checkout.join(path).parent().expect("a file lies in a folder").to_owned();
    let mut violations = Vec::new();
    for (index, line) in markdown.lines().enumerate() {
        for (position, opening) in line.match_indices("](") {
            let target = line[position + opening.len()..].split([')', '#', ' ']).next().unwrap_or("");
            if !target.is_empty() && !target.contains("://") && !folder.join(target).exists() {
                violations.push(Violation::new(path, index + 1, "links", format!("`{target}` is not there")));
            }
        }
    }
    violations
}

/// Every test that docs/paper.md names in a row's last column is a test of the crates; `eq_3_…` stands for all that begin so.
pub(crate) fn named_tests_exist(path: &str, markdown: &str, crates: &str) -> Vec<Violation> {
    let mut violations = Vec::new();
    let mut names_tests = false;
    for (index, line) in markdown.lines().enumerate() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let Some(last) = cells.len().checked_sub(2).map(|place| cells[place]) else {
            names_tests = false;
            continue;
        };
        names_tests |= last == "test";
        for name in last.split('`').skip(1).step_by(2).filter(|_| names_tests) {
            let wanted = match name.strip_suffix('…') {
                Some(beginning) => format!("fn {beginning}"),
                None => format!("fn {name}("),
            };
            if !crates.contains(&wanted) {
                violations.push(Violation::new(path, index + 1, "named tests", format!("no test `{name}`")));
            }
        }
    }
    violations
}

fn forbidden_words<'a>(
    sources: impl IntoIterator<Item = &'a Source>,
    words: &[&str],
    rule: &'static str,
    why: &str,
) -> Vec<Violation> {
    let mut violations = Vec::new();
    for source in sources {
        for word in words {
            for position in source.words(word) {
                let message = format!("`{word}`: {why}");
                violations.push(Violation::new(&source.path, source.line(position), rule, message));
            }
        }
    }
    violations
}

/// Where `tests/main.rs` makes one program of a package's tests, it names each file: cargo looks for no other.
pub(crate) fn test_files_are_named(sources: &[Source]) -> Vec<Violation> {
    let mains = sources.iter().filter_map(|main| Some((main.path.strip_suffix("main.rs")?, main)));
    let mains = mains.filter(|(folder, _)| folder.ends_with("/tests/"));
    let unnamed = mains.flat_map(|(folder, main)| {
        let files = sources.iter().filter_map(move |file| {
            let name = file.path.strip_prefix(folder)?.strip_suffix(".rs")?;
            (!name.contains('/') && name != "main").then_some((file, name))
        });
        files.filter(|(_, name)| !main.code.contains(&format!("mod {name};")))
    });
    unnamed
        .map(|(file, name)| {
            let message = format!("its tests do not run: main.rs beside it has no `mod {name};`");
            Violation::new(&file.path, 1, "tests", message)
        })
        .collect()
}
