//! The bands of the library and of the command, a folder each, and what may use what: read off the folders and the paths in the
//! files.

use crate::Violation;
use crate::modules::{Modules, Use, paths};
use crate::sources::{Source, is_word};
use std::collections::{BTreeMap, BTreeSet};

pub(crate) const LIBRARY: &str = "crates/demosift/src/";
pub(crate) const COMMAND: &str = "crates/demosift-cli/src/";
const TABLE: &str = "ARCHITECTURE.md";
/// Below this heading stands the table of the command; that of the library stands above it.
const OF_COMMAND: &str = "## The folders of the command";
/// The highest band that the MuJoCo crate may see: everything above is an algorithm.
const PLAYING: &str = "world";

/// Each improves a policy or makes rewards; `adapt` brings them together.
const RULES: [&str; 4] =
    ["learning::trpo", "learning::gail", "learning::behavioral_cloning", "learning::mutual_information"];
/// The paper's procedures; a value that two of them share lies in a lower band.
const PROCEDURES: [&str; 5] =
    ["stages::meta_train", "stages::pre_train", "stages::judge", "stages::imitate", "stages::demonstrator"];
/// What is made of what procedures found.
const CONCLUSIONS: [&str; 4] =
    ["stages::select", "stages::subset_selection", "stages::method", "stages::referee"];
/// What is said of values, each by itself.
const REMARKS: [&str; 5] =
    ["results::uncertainty", "results::data_only", "results::recording", "results::gain", "results::decline"];
/// Within a band: none of the first may use one of the second.
const APART: [(&[&str], &[&str]); 6] = [
    (&RULES, &RULES),
    (&RULES, &["learning::adapt"]),
    (&PROCEDURES, &PROCEDURES),
    (&PROCEDURES, &CONCLUSIONS),
    (&CONCLUSIONS, &CONCLUSIONS),
    (&REMARKS, &REMARKS),
];

/// The bands of a crate.
pub(crate) struct Bands {
    /// The folder of the crate's root, which ends with `/`.
    root: &'static str,
    /// The lowest first.
    names: Vec<String>,
}

impl Bands {
    /// Those of the library.
    pub(crate) fn read(markdown: &str) -> Self {
        let above = markdown.split_once(OF_COMMAND).map_or(markdown, |(above, _)| above);
        Self::of_table(LIBRARY, above)
    }

    /// Those of the command.
    pub(crate) fn of_command(markdown: &str) -> Self {
        let (_, below) =
            markdown.split_once(OF_COMMAND).unwrap_or_else(|| panic!("no {OF_COMMAND} in {TABLE}"));
        Self::of_table(COMMAND, below)
    }

    /// Reads the rows of the table that begin with a folder's name in backticks, with `/` at its end.
    fn of_table(root: &'static str, markdown: &str) -> Self {
        let folder = |line: &str| {
            let cell = line.strip_prefix("| `")?.split_once("/` |")?.0;
            cell.chars().all(is_word).then(|| cell.to_owned())
        };
        Self { root, names: markdown.lines().filter_map(folder).collect() }
    }

    /// The place of a module's band, from 0.
    fn place(&self, module: &str) -> Option<usize> {
        let band = module.split("::").next().unwrap_or(module);
        self.names.iter().position(|name| name == band)
    }
}

/// The table names each folder of the crate once, and no file but the root lies beside them.
pub(crate) fn table_names_the_folders(bands: &Bands, sources: &[Source]) -> Vec<Violation> {
    let modules = Modules::of(bands.root, sources);
    let beside = modules.files().filter(|(module, _)| !module.is_empty()).filter_map(|(module, source)| {
        let message = match bands.place(module) {
            None => format!("`{module}` lies in no folder that the table of {TABLE} names"),
            Some(_) if module.contains("::") || source.path.ends_with("/mod.rs") => return None,
            Some(_) => format!("the band `{module}` must be a folder with a `mod.rs`"),
        };
        Some(Violation::new(&source.path, 1, "bands", message))
    });
    let stale = bands.names.iter().enumerate().filter_map(|(place, name)| {
        let problem = if !modules.holds(name) {
            "is no folder of the crate"
        } else if bands.names[..place].contains(name) {
            "stands in the table twice"
        } else {
            return None;
        };
        Some(Violation::new(TABLE, 1, "bands", format!("`{name}/` {problem}")))
    });
    beside.chain(stale).collect()
}

/// A band uses lower ones only.
pub(crate) fn uses_go_down(bands: &Bands, sources: &[Source]) -> Vec<Violation> {
    let upward = |used: &Use<'_>| {
        let (from, to) = (bands.place(&used.user)?, bands.place(&used.used)?);
        let message = format!("`{}` uses `{}`, and `{}` lies above", used.user, used.used, bands.names[to]);
        (to > from).then(|| Violation::new(&used.source.path, used.line, "bands", message))
    };
    Modules::of(bands.root, sources).uses().iter().filter_map(upward).collect()
}

/// Files side by side do not use each other in a circle.
///
/// A file and those in the folder of its name are one module to the files beside it; within that module the file and its
/// parts may use each other, and the parts among themselves have no circle either.
pub(crate) fn no_circles(folder: &str, sources: &[Source]) -> Vec<Violation> {
    let modules = Modules::of(folder, sources);
    let uses = modules.uses();
    let beside: Vec<(&Use<'_>, Sides)> =
        uses.iter().filter_map(|used| Some((used, sides(&used.user, &used.used)?))).collect();
    let mut edges: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (_, (user, used)) in &beside {
        edges.entry(user).or_default().insert(used);
    }
    let circles = beside.iter().filter(|(_, (user, used))| reaches(&edges, used, user));
    circles
        .map(|(place, (user, used))| {
            let message = format!("`{user}` uses `{used}`, which uses `{user}`, itself or by others");
            Violation::new(&place.source.path, place.line, "circles", message)
        })
        .collect()
}

/// Modules of one band that are to know nothing of each other do not.
pub(crate) fn strangers_stay_apart(library: &[Source]) -> Vec<Violation> {
    let modules = Modules::of(LIBRARY, library);
    let mut violations: Vec<Violation> = [&RULES[..], &PROCEDURES, &CONCLUSIONS, &REMARKS]
        .concat()
        .into_iter()
        .filter(|name| !modules.holds(name))
        .map(|name| Violation::new(LIBRARY, 1, "apart", format!("`{name}` is no module of the library")))
        .collect();
    let is_in = |module: &str, names: &[&'static str]| {
        names.iter().copied().find(|name| {
            module.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
        })
    };
    for used in modules.uses() {
        for (users, others) in APART {
            if let (Some(user), Some(other)) = (is_in(&used.user, users), is_in(&used.used, others))
                && user != other
            {
                let message = format!("`{user}` uses `{other}`, of which it is to know nothing");
                violations.push(Violation::new(&used.source.path, used.line, "apart", message));
            }
        }
    }
    violations
}

/// Every path of a document that begins with a band leads to a module of it: `stages::judge` in `stages::judge::Start`.
pub(crate) fn named_modules_exist(
    bands: &Bands,
    library: &[Source],
    path: &str,
    markdown: &str,
) -> Vec<Violation> {
    let modules = Modules::of(LIBRARY, library);
    let mut violations = Vec::new();
    for (index, line) in markdown.lines().enumerate() {
        for name in line.split('`').skip(1).step_by(2) {
            let mut words = name.trim_start_matches("demosift::").split("::");
            let (Some(band), Some(second)) = (words.next(), words.next()) else { continue };
            let module: String = second.chars().take_while(|character| is_word(*character)).collect();
            if bands.names.iter().any(|of| of == band) && !modules.holds(&format!("{band}::{module}")) {
                let message = format!("`{name}`: `{band}` has no module `{module}`");
                violations.push(Violation::new(path, index + 1, "named modules", message));
            }
        }
    }
    violations
}

/// The MuJoCo crate sees no algorithm: only bands up to playing.
pub(crate) fn mujoco_imports_no_algorithm(
    bands: &Bands,
    library: &[Source],
    mujoco: &[Source],
) -> Vec<Violation> {
    let modules = Modules::of(LIBRARY, library);
    let highest = bands.place(PLAYING).unwrap_or_else(|| panic!("{TABLE} names no `{PLAYING}/`"));
    let mut violations = Vec::new();
    for source in mujoco {
        for (path, line) in paths(source, "demosift") {
            let problem = match bands.place(&modules.defining(&path)) {
                None => format!("`demosift::{path}` lies in no band"),
                Some(place) if place > highest => format!("`{path}` lies above `{PLAYING}`"),
                Some(_) => continue,
            };
            violations.push(Violation::new(&source.path, line, "crate walls", problem));
        }
    }
    violations
}

/// A module and another beside it.
type Sides = (String, String);

/// The two that lie beside each other, of which one holds the user and the other the used; nothing within one module.
fn sides(user: &str, used: &str) -> Option<Sides> {
    let (mut users, mut useds) = (user.split("::"), used.split("::"));
    let mut common = String::new();
    loop {
        // One of the two holds the other where its words are at an end.
        let (one, other) = (users.next()?, useds.next()?);
        if one.is_empty() || other.is_empty() {
            return None;
        }
        if one != other {
            return Some((format!("{common}{one}"), format!("{common}{other}")));
        }
        common += one;
        common += "::";
    }
}

fn reaches(edges: &BTreeMap<&str, BTreeSet<&str>>, from: &str, to: &str) -> bool {
    let mut seen = BTreeSet::from([from]);
    let mut open = vec![from];
    while let Some(module) = open.pop() {
        if module == to {
            return true;
        }
        let next = edges.get(module).into_iter().flatten();
        open.extend(next.copied().filter(|module| seen.insert(module)));
    }
    false
}
