//! The page of `inspect`: what the recordings alone say of each episode, in one HTML file that needs no other.

use std::path::Path;

use demosift::data::demonstration::inspection::Look;
use demosift::{Error, Result};
use serde::Serialize;

use super::page::{Part, assembled};
use crate::job::run_folder::write_if_new;

const TEMPLATE: &str = include_str!("looks.html");
const PARTS: [Part; 3] = [
    ("STYLE", include_str!("page.css")),
    ("CHARTS", include_str!("charts.js")),
    ("LOOKS", include_str!("looks.js")),
];
/// What no other page has; a page of before may be written again, and nothing else.
const MARK: &str = "<meta name=\"generator\" content=\"demosift inspect\">";

/// What was looked at.
#[derive(Serialize)]
pub(crate) struct Made<'a> {
    /// The version that wrote the page.
    pub(crate) demosift: &'a str,
    /// The set's name.
    pub(crate) set: String,
    pub(crate) format: String,
    pub(crate) observation_size: usize,
    pub(crate) action_size: usize,
    /// Episodes that were not taken, in words.
    pub(crate) left_out: Option<String>,
    /// What `set.toml` says of the numbers, a sentence each.
    pub(crate) numbers: &'a [String],
    /// Why nobody can learn from the set, if that is so, and what can be done.
    pub(crate) why_not: Option<&'a str>,
    pub(crate) way_out: Option<&'a str>,
    /// Whether it fits the task that was named, in words.
    pub(crate) fits: Option<String>,
}

#[derive(Serialize)]
struct Data<'a> {
    looks: &'a [Look],
    made: &'a Made<'a>,
}

/// Writes the page into a new file, or over a page of before.
///
/// # Errors
/// `is_bad_input` if the file is something else; `is_io` if it cannot be written.
pub(crate) fn write(path: &Path, looks: &[Look], made: &Made<'_>) -> Result<()> {
    if path.exists() && !std::fs::read_to_string(path).is_ok_and(|text| text.contains(MARK)) {
        return Err(Error::bad_input(
            "there is something else of this name already; wanted the name of a new file, or of a page of before",
        )
        .at(path));
    }
    let title = format!("{}: {} episodes", made.set, looks.len());
    write_if_new(path, assembled(TEMPLATE, &PARTS, &title, &Data { looks, made }).as_bytes())
}
