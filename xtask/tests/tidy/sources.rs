//! Rust files as the rules see them: without comments, without test modules, with and without the text of strings.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// One Rust file.
pub(crate) struct Source {
    /// Relative to the checkout, with `/`.
    pub(crate) path: String,
    /// The code alone: comments, strings and test modules are blank; every line is where it was.
    pub(crate) code: String,
    /// The same with the strings still there.
    pub(crate) code_and_strings: String,
    /// Lines outside test modules, comments included.
    pub(crate) lines: usize,
}

impl Source {
    pub(crate) fn new(path: &str, text: &str) -> Self {
        let mut code = blank(text, true);
        let mut code_and_strings = blank(text, false);
        let mut lines = text.lines().count();
        for range in test_code(path, &code) {
            lines -= text[range.clone()].matches('\n').count();
            for view in [&mut code, &mut code_and_strings] {
                let blanked = spaces(&view[range.clone()]);
                view.replace_range(range.clone(), &blanked);
            }
        }
        Self { path: path.to_owned(), code, code_and_strings, lines }
    }

    /// Line number, from 1, of a position in the code.
    pub(crate) fn line(&self, position: usize) -> usize {
        1 + self.code[..position].matches('\n').count()
    }

    /// Positions of a whole word in the code.
    pub(crate) fn words<'a>(&'a self, word: &'a str) -> impl Iterator<Item = usize> + 'a {
        self.code.match_indices(word).map(|(position, _)| position).filter(move |&position| {
            let before = self.code[..position].chars().next_back();
            let after = self.code[position + word.len()..].chars().next();
            !before.is_some_and(is_word) && !after.is_some_and(is_word)
        })
    }
}

pub(crate) fn is_word(character: char) -> bool {
    character.is_alphanumeric() || character == '_'
}

/// The folder that holds the workspace.
pub(crate) fn checkout() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the workspace").to_owned()
}

/// A text file of the checkout.
pub(crate) fn read(path: &str) -> String {
    fs::read_to_string(checkout().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// All Rust files under a folder of the checkout, in the order of their paths.
pub(crate) fn rust_files(folder: &str) -> Vec<Source> {
    files(folder, "rs").iter().map(|path| Source::new(path, &read(path))).collect()
}

/// Paths of all files under a folder of the checkout that end so, in order. Hidden and built things are left out.
pub(crate) fn files(folder: &str, extension: &str) -> Vec<String> {
    let mut found = Vec::new();
    collect(&checkout().join(folder), extension, &mut found);
    let mut found: Vec<String> = found
        .iter()
        .map(|path| path.strip_prefix(checkout()).expect("it was found in the checkout"))
        .map(|path| path.to_string_lossy().replace('\\', "/"))
        .collect();
    found.sort();
    found
}

fn collect(folder: &Path, extension: &str, found: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    for entry in entries {
        let path = entry.expect("a folder that opens can be read").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            if !name.starts_with('.') && name != "target" && name != "runs" {
                collect(&path, extension, found);
            }
        } else if path.extension().is_some_and(|own| own == extension) {
            found.push(path);
        }
    }
}

/// The text with comments, and strings if asked, replaced by spaces; byte positions and lines stay.
fn blank(text: &str, strings_too: bool) -> String {
    let mut code = text.to_owned();
    let mut position = 0;
    while position < text.len() {
        let (end, is_comment) = token(text, position);
        let quoted = end - position > 1 && !is_comment;
        if is_comment || (quoted && strings_too) {
            code.replace_range(position..end, &spaces(&text[position..end]));
        }
        position = end;
    }
    code
}

/// Where the comment, the literal or the one character at `start` ends, and whether it is a comment.
fn token(text: &str, start: usize) -> (usize, bool) {
    let rest = &text[start..];
    let in_word = text[..start].chars().next_back().is_some_and(is_word);
    let first = rest.chars().next().expect("the caller stops at the end");
    if rest.starts_with("//") {
        return (start + rest.find('\n').unwrap_or(rest.len()), true);
    }
    if rest.starts_with("/*") {
        return (start + block_comment(rest), true);
    }
    if !in_word && let Some(length) = raw_string(rest) {
        return (start + length, false);
    }
    if first == '"' {
        return (start + quoted(rest), false);
    }
    if let Some(length) = character(rest) {
        return (start + length, false);
    }
    (start + first.len_utf8(), false)
}

fn block_comment(rest: &str) -> usize {
    let (mut depth, mut position) = (0, 0);
    while position < rest.len() {
        let tail = &rest.as_bytes()[position..];
        match tail {
            [b'/', b'*', ..] => (depth, position) = (depth + 1, position + 2),
            [b'*', b'/', ..] => (depth, position) = (depth - 1, position + 2),
            _ => position += 1,
        }
        if depth == 0 {
            break;
        }
    }
    position
}

/// Length of the raw string, such as `r#".."#` or `br".."`, that begins here.
fn raw_string(rest: &str) -> Option<usize> {
    let hashes = rest.strip_prefix("br").or_else(|| rest.strip_prefix('r'))?;
    let body = hashes.trim_start_matches('#');
    let end = format!("\"{}", "#".repeat(hashes.len() - body.len()));
    let inside = body.strip_prefix('"')?;
    let opening = rest.len() - inside.len();
    Some(inside.find(&end).map_or(rest.len(), |closing| opening + closing + end.len()))
}

fn quoted(rest: &str) -> usize {
    let bytes = rest.as_bytes();
    let mut position = 1;
    while position < bytes.len() {
        match bytes[position] {
            b'\\' => position += 2,
            b'"' => return position + 1,
            _ => position += 1,
        }
    }
    rest.len()
}

/// Length of the character literal that begins here; a lifetime is none.
fn character(rest: &str) -> Option<usize> {
    let inside = rest.strip_prefix('\'')?;
    if inside.starts_with('\\') {
        // From the third byte on, so that an escaped quote does not end it.
        return inside.get(2..)?.find('\'').map(|closing| closing + 4);
    }
    let length = inside.chars().next()?.len_utf8();
    inside[length..].starts_with('\'').then_some(length + 2)
}

/// What a file without comments and strings says for tests only.
fn test_code(path: &str, code: &str) -> Vec<Range<usize>> {
    let whole_file = path.ends_with("/tests.rs") || path.ends_with("_tests.rs");
    if whole_file { std::iter::once(0..code.len()).collect() } else { test_items(code) }
}

/// The items under `#[cfg(test)]` in code without comments and strings.
fn test_items(code: &str) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for (start, attribute) in code.match_indices("#[cfg(test)]") {
        if ranges.last().is_some_and(|range| range.contains(&start)) {
            continue;
        }
        let mut depth = 0;
        let mut end = code.len();
        for (offset, character) in code[start + attribute.len()..].char_indices() {
            match character {
                '{' => depth += 1,
                '}' => depth -= 1,
                _ => {}
            }
            if depth == 0 && matches!(character, '}' | ';') {
                end = start + attribute.len() + offset + 1;
                break;
            }
        }
        ranges.push(start..end);
    }
    ranges
}

fn spaces(text: &str) -> String {
    text.bytes().map(|byte| if byte == b'\n' { '\n' } else { ' ' }).collect()
}
