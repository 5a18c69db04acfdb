//! The modules of a crate, read off its files, and what each uses of the others.
//!
//! A path leads to the file that defines what it names: re-exports are followed, wherever they stand.

use crate::sources::{Source, is_word};
use std::collections::BTreeMap;

/// A crate's files as modules.
pub(crate) struct Modules<'a> {
    /// Path below the root, such as `math::nn::mlp`, to its file; the root itself is "".
    files: BTreeMap<String, &'a Source>,
    /// What a module re-exports: the path by which it is known to the path that it stands for.
    exports: BTreeMap<String, String>,
}

/// One place at which a file uses another one of its crate.
pub(crate) struct Use<'a> {
    /// The file that uses.
    pub(crate) source: &'a Source,
    /// Line, from 1.
    pub(crate) line: usize,
    /// The module that uses.
    pub(crate) user: String,
    /// The module that is used.
    pub(crate) used: String,
}

/// A path as it is written, without the word at which it begins.
struct Written {
    path: String,
    /// The last word, or what `as` makes of it.
    name: String,
    line: usize,
}

impl<'a> Modules<'a> {
    /// The modules of the crate whose root lies in this folder, which ends with `/`.
    pub(crate) fn of(folder: &str, sources: &'a [Source]) -> Self {
        let files: BTreeMap<String, &Source> =
            sources.iter().filter_map(|source| Some((module_of(folder, &source.path)?, source))).collect();
        let mut modules = Self { files, exports: BTreeMap::new() };
        let exports: Vec<(String, String)> =
            modules.files.iter().flat_map(|(module, source)| modules.exports_of(module, source)).collect();
        modules.exports.extend(exports);
        modules
    }

    /// Every module with its file, the root ("") among them.
    pub(crate) fn files(&self) -> impl Iterator<Item = (&str, &'a Source)> {
        self.files.iter().map(|(module, source)| (module.as_str(), *source))
    }

    /// Whether there is such a module.
    pub(crate) fn holds(&self, module: &str) -> bool {
        self.files.contains_key(module)
    }

    /// The module that defines what a path below the root names.
    pub(crate) fn defining(&self, path: &str) -> String {
        let mut path = path.to_owned();
        // A chain of re-exports is no longer than there are files.
        for _ in 0..self.files.len() {
            let Some((known, rest)) = prefixes(&path).find(|(prefix, _)| self.exports.contains_key(*prefix))
            else {
                break;
            };
            path = format!("{}{rest}", self.exports[known]);
        }
        let module = prefixes(&path).map(|(prefix, _)| prefix).find(|prefix| self.holds(prefix));
        module.unwrap_or_default().to_owned()
    }

    /// Every place at which a module uses another one.
    pub(crate) fn uses(&self) -> Vec<Use<'a>> {
        let mut uses = Vec::new();
        for (module, source) in &self.files {
            for root in ["crate", "super"] {
                for written in paths_from(source, root) {
                    let path = match root {
                        "crate" => written.path,
                        _ => above(module, &format!("super::{}", written.path)),
                    };
                    let used = self.defining(&path);
                    if used != *module {
                        uses.push(Use { source, line: written.line, user: module.clone(), used });
                    }
                }
            }
        }
        uses
    }

    fn exports_of(&self, module: &str, source: &Source) -> Vec<(String, String)> {
        let mut exports = Vec::new();
        for position in source.words("use") {
            if !is_public(&source.code[..position]) {
                continue;
            }
            let mut written = Vec::new();
            tree(source, position + "use".len(), "", &mut written);
            for Written { path, name, .. } in written {
                let first = path.split("::").next().unwrap_or_default();
                let path = match first {
                    "crate" => path["crate".len()..].trim_start_matches("::").to_owned(),
                    "self" => join(module, path["self".len()..].trim_start_matches("::")),
                    "super" => above(module, &path),
                    _ if self.holds(&join(module, first)) => join(module, &path),
                    // Of another crate.
                    _ => continue,
                };
                exports.push((join(module, &name), path));
            }
        }
        exports
    }
}

/// All paths of a file that begin with `root::`, without it, braces spelled out: as (path, line).
pub(crate) fn paths(source: &Source, root: &str) -> Vec<(String, usize)> {
    paths_from(source, root).into_iter().map(|written| (written.path, written.line)).collect()
}

/// `math::nn::mlp` for `math/nn/mlp.rs` below the folder, and "" for its root.
fn module_of(folder: &str, path: &str) -> Option<String> {
    let file = path.strip_prefix(folder)?.strip_suffix(".rs")?;
    let module = file.strip_suffix("/mod").unwrap_or(file);
    Some(if ["lib", "main"].contains(&module) { String::new() } else { module.replace('/', "::") })
}

fn join(module: &str, path: &str) -> String {
    if module.is_empty() { path.to_owned() } else { format!("{module}::{path}") }
}

/// What `super::x` means in a module.
fn above(module: &str, path: &str) -> String {
    let (mut base, mut path) = (module, path);
    while let Some(rest) = path.strip_prefix("super::") {
        base = base.rsplit_once("::").map_or("", |(parent, _)| parent);
        path = rest;
    }
    join(base, path)
}

/// A path and what contains it, with the rest that was cut off: `a::b`, then `a` with `::b`.
fn prefixes(path: &str) -> impl Iterator<Item = (&str, &str)> {
    let ends = path.match_indices("::").map(|(end, _)| end).chain([path.len()]);
    ends.collect::<Vec<_>>().into_iter().rev().map(|end| path.split_at(end))
}

/// Whether the code ends with `pub`, `pub(crate)` or the like.
fn is_public(before: &str) -> bool {
    let before = before.trim_end();
    let before = match before.strip_suffix(')') {
        Some(inside) => inside.rsplit_once('(').map_or("", |(before, _)| before),
        None => before,
    };
    before.ends_with("pub")
}

fn paths_from(source: &Source, root: &str) -> Vec<Written> {
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
fn tree(source: &Source, mut position: usize, prefix: &str, paths: &mut Vec<Written>) -> usize {
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
    let name = word_at(code, position);
    let path = if prefix.is_empty() { name.to_owned() } else { format!("{prefix}::{name}") };
    let after = position + name.len();
    match code[after..].strip_prefix("::") {
        Some(rest) if rest.starts_with(|next| is_word(next) || next == '{' || next == '*') => {
            tree(source, after + 2, &path, paths)
        }
        _ => {
            // The star of `module::*` has no name; what it stands for lies in the module, as `self` does.
            let path = path.trim_end_matches("::self").trim_end_matches("::");
            let renamed =
                code[after..].trim_start().strip_prefix("as ").map(|rest| word_at(rest.trim_start(), 0));
            let name = renamed.unwrap_or_else(|| path.rsplit("::").next().unwrap_or(path));
            paths.push(Written { path: path.to_owned(), name: name.to_owned(), line });
            after + usize::from(code[after..].starts_with('*'))
        }
    }
}

fn word_at(code: &str, position: usize) -> &str {
    let rest = &code[position..];
    &rest[..rest.find(|character| !is_word(character)).unwrap_or(rest.len())]
}
