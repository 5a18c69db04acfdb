//! The layer table of ARCHITECTURE.md against the paths that the library's files really use.

use crate::Violation;
use crate::sources::{Source, is_word};
use std::collections::{BTreeMap, BTreeSet};

const LIBRARY: &str = "crates/demosift/src/";
const BANDS: [&str; 8] = ["basics", "math", "data", "world", "learning", "stages", "results", "run"];
const TABLE: &str = "ARCHITECTURE.md";
/// The highest layer that the MuJoCo crate may see: everything above is an algorithm.
const PLAYING: usize = 4;

/// The layer table: module to layer.
pub(crate) struct Table {
    layers: BTreeMap<String, usize>,
    /// Layers whose modules may use each other.
    neighborly: BTreeSet<usize>,
}

impl Table {
    /// Reads the rows `| number | what | modules in backticks | yes or no |`.
    pub(crate) fn read(markdown: &str) -> Self {
        let mut table = Self { layers: BTreeMap::new(), neighborly: BTreeSet::new() };
        for line in markdown.lines() {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let ["", number, _, modules, neighbors, ""] = cells[..] else { continue };
            let Ok(layer) = number.parse() else { continue };
            for module in modules.split('`').skip(1).step_by(2) {
                let twice = table.layers.insert(module.to_owned(), layer);
                assert!(twice.is_none(), "{TABLE}: `{module}` stands in the layer table twice");
            }
            if neighbors == "yes" {
                table.neighborly.insert(layer);
            }
        }
        assert!(!table.layers.is_empty(), "{TABLE} has no layer table");
        table
    }

    /// The table's module that holds this path, such as `nn` for `nn::mlp::forward`.
    fn module<'a>(&self, path: &'a str) -> Option<&'a str> {
        std::iter::successors(Some(path), |path| path.rsplit_once("::").map(|(parent, _)| parent))
            .find(|prefix| self.layers.contains_key(*prefix))
    }
}

/// Every module stands in the table, and the table names no module that is not there.
pub(crate) fn table_is_complete(table: &Table, library: &[Source]) -> Vec<Violation> {
    let files: Vec<(&Source, String)> =
        library.iter().filter_map(|source| Some((source, module_of(source)?))).collect();
    let missing =
        files.iter().filter(|(_, module)| table.module(module).is_none()).map(|(source, module)| {
            Violation::new(&source.path, 1, "layer table", format!("`{module}` is missing in {TABLE}"))
        });
    let stale =
        table.layers.keys().filter(|name| !files.iter().any(|(_, module)| module == *name)).map(|name| {
            Violation::new(TABLE, 1, "layer table", format!("`{name}` is no module of the library"))
        });
    missing.chain(stale).collect()
}

/// A module uses lower layers only, and its own layer where the table says so.
pub(crate) fn uses_go_down(table: &Table, library: &[Source]) -> Vec<Violation> {
    let exports = root_exports(library);
    let mut violations = Vec::new();
    for (source, user, used, line) in uses(table, library, &exports) {
        let (from, to) = (table.layers[user], table.layers[&used]);
        let problem = if to > from {
            "a higher layer"
        } else if to == from && !table.neighborly.contains(&from) {
            "a neighbor, in a layer where none knows another"
        } else {
            continue;
        };
        let message = format!("`{user}` (layer {from}) uses `{used}` (layer {to}): {problem}");
        violations.push(Violation::new(&source.path, line, "layers", message));
    }
    violations
}

/// Where neighbors may use each other, they do not do so in a circle.
pub(crate) fn no_circles(table: &Table, library: &[Source]) -> Vec<Violation> {
    let exports = root_exports(library);
    let mut edges: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let uses = uses(table, library, &exports);
    for (_, user, used, _) in &uses {
        edges.entry((*user).to_owned()).or_default().insert(used.clone());
    }
    uses.iter()
        .filter(|(_, user, used, _)| table.layers[*user] == table.layers[used] && reaches(&edges, used, user))
        .map(|(source, user, used, line)| {
            let message = format!("`{user}` uses `{used}`, which uses `{user}`");
            Violation::new(&source.path, *line, "circles", message)
        })
        .collect()
}

/// The MuJoCo crate sees no algorithm: only layers up to playing.
pub(crate) fn mujoco_imports_no_algorithm(
    table: &Table,
    library: &[Source],
    mujoco: &[Source],
) -> Vec<Violation> {
    let exports = root_exports(library);
    let mut violations = Vec::new();
    for source in mujoco {
        for (path, line) in paths_from(source, "demosift") {
            let path = exports.get(&path).unwrap_or(&path);
            let problem = match table.module(path) {
                None => format!("`demosift::{path}` lies in no module of the layer table"),
                Some(module) if table.layers[module] > PLAYING => {
                    format!("`{module}` is layer {}, above {PLAYING}", table.layers[module])
                }
                Some(_) => continue,
            };
            violations.push(Violation::new(&source.path, line, "crate walls", problem));
        }
    }
    violations
}

type Use<'a> = (&'a Source, &'a str, String, usize);

/// Each use of another module of the library: file, the module that uses, the one used, line.
fn uses<'a>(table: &'a Table, library: &'a [Source], exports: &BTreeMap<String, String>) -> Vec<Use<'a>> {
    let mut found = Vec::new();
    for source in library {
        let Some(own_path) = module_of(source) else { continue };
        let Some(user) = table.module(&own_path) else { continue };
        let user = table.layers.get_key_value(user).expect("`module` finds what is in the table").0;
        let absolute = paths_from(source, "crate");
        let relative = paths_from(source, "super").into_iter().map(|(path, line)| {
            let mut base = own_path.rsplit_once("::").map_or("", |(parent, _)| parent);
            let mut path = path.as_str();
            while let Some(rest) = path.strip_prefix("super::") {
                base = base.rsplit_once("::").map_or("", |(parent, _)| parent);
                path = rest;
            }
            (format!("{base}::{path}").trim_start_matches("::").to_owned(), line)
        });
        for (path, line) in absolute.into_iter().chain(relative) {
            let path = exports.get(&path).unwrap_or(&path);
            if let Some(used) = table.module(path).filter(|used| used != user) {
                found.push((source, user.as_str(), used.to_owned(), line));
            }
        }
    }
    found
}

fn reaches(edges: &BTreeMap<String, BTreeSet<String>>, from: &str, to: &str) -> bool {
    let mut seen = BTreeSet::from([from]);
    let mut open = vec![from];
    while let Some(module) = open.pop() {
        if module == to {
            return true;
        }
        let next = edges.get(module).into_iter().flatten();
        open.extend(next.map(String::as_str).filter(|module| seen.insert(module)));
    }
    false
}

/// `nn::mlp` for `crates/demosift/src/nn/mlp.rs`; nothing for the root, which only declares and re-exports.
fn module_of(source: &Source) -> Option<String> {
    let file = source.path.strip_prefix(LIBRARY)?.strip_suffix(".rs")?;
    let module = file.strip_suffix("/mod").unwrap_or(file);
    // A band's own `mod.rs` only declares, as the root does.
    let declares = module == "lib"
        || (file.ends_with("/mod") && module.matches('/').count() == 0 && BANDS.contains(&module));
    (!declares).then(|| module.replace('/', "::"))
}

/// What the library's root re-exports: short name to full path.
fn root_exports(library: &[Source]) -> BTreeMap<String, String> {
    let mut exports = BTreeMap::new();
    for source in library.iter().filter(|source| source.path.ends_with("demosift/src/lib.rs")) {
        for (position, keyword) in source.code.match_indices("pub use ") {
            let mut paths = Vec::new();
            tree(source, position + keyword.len(), "", &mut paths);
            for (path, _) in paths {
                let short = path.rsplit("::").next().unwrap_or(&path).to_owned();
                exports.insert(short, path);
            }
        }
    }
    exports
}

/// All paths that begin with `root::`, without it, braces spelled out, each with its line.
fn paths_from(source: &Source, root: &str) -> Vec<(String, usize)> {
    let mut paths = Vec::new();
    for position in source.words(root) {
        // `super::super::x` is found at its first word.
        if source.code[..position].ends_with("::") {
            continue;
        }
        if source.code[position + root.len()..].starts_with("::") {
            tree(source, position + root.len() + 2, "", &mut paths);
        }
    }
    paths
}

/// Spells out the use tree at `position`; returns where it ends.
fn tree(source: &Source, mut position: usize, prefix: &str, paths: &mut Vec<(String, usize)>) -> usize {
    let code = &source.code;
    let skip_spaces =
        |position: usize| position + code[position..].len() - code[position..].trim_start().len();
    position = skip_spaces(position);
    if code[position..].starts_with('{') {
        position += 1;
        while position < code.len() && !code[position..].starts_with('}') {
            position = skip_spaces(tree(source, position, prefix, paths));
            // Over ` as name`, up to the next branch.
            position += code[position..].find([',', '}']).unwrap_or(code.len() - position);
            position = skip_spaces(position + usize::from(code[position..].starts_with(',')));
        }
        return (position + 1).min(code.len());
    }
    let line = source.line(position);
    let length = code[position..].find(|character| !is_word(character)).unwrap_or(code.len() - position);
    let name = &code[position..position + length];
    let path = if prefix.is_empty() { name.to_owned() } else { format!("{prefix}::{name}") };
    let after = position + length;
    match code[after..].strip_prefix("::") {
        Some(rest) if rest.starts_with(|next| is_word(next) || next == '{' || next == '*') => {
            tree(source, after + 2, &path, paths)
        }
        _ => {
            // The star of `module::*` has no name; what it stands for lies in the module.
            paths.push((path.trim_end_matches(':').to_owned(), line));
            after + usize::from(code[after..].starts_with('*'))
        }
    }
}
