//! One HTML file that needs no other: the template with its style, its scripts and its data inside.

use std::path::Path;

use demosift::data::demonstration::episode;
use demosift::results::report::Report;
use serde::Serialize;

use super::replay::Replay;

const TEMPLATE: &str = include_str!("page.html");
/// A name and what stands in for `{{NAME}}` in a template, where it is once.
pub(super) type Part = (&'static str, &'static str);

const PARTS: [Part; 8] = [
    ("STYLE", include_str!("page.css")),
    ("THREE", include_str!("three/three.bundle.js")),
    ("CHARTS", include_str!("charts.js")),
    ("SECTIONS", include_str!("sections.js")),
    ("PLAYER", include_str!("player.js")),
    ("REPLAY", include_str!("replay.js")),
    ("FILM", include_str!("film.js")),
    ("LICENSE", include_str!("three/LICENSE-three.txt")),
];

/// What a run was made of.
#[derive(Serialize)]
pub(crate) struct Made<'a> {
    /// The version that wrote the page.
    pub(crate) demosift: &'a str,
    /// The set's name.
    pub(crate) set: String,
    pub(crate) sha256: String,
    /// The one goal that the run is about, where the task has several.
    pub(crate) variant: Option<&'a str>,
    /// The goals that have run folders of their own in this one.
    pub(crate) goals: Vec<Goal>,
    /// As TOML.
    pub(crate) configuration: String,
    pub(crate) unusable: Option<&'a str>,
    /// Episodes of the set that were not taken, in words.
    pub(crate) left_out: Option<&'a str>,
    /// What `set.toml` says of its numbers, a sentence each.
    pub(crate) numbers: &'a [String],
}

/// A goal of a run that has several.
#[derive(Serialize)]
pub(crate) struct Goal {
    pub(crate) name: String,
    /// The link to its page, where there is one.
    pub(crate) page: Option<String>,
}

#[derive(Serialize)]
struct Data<'a> {
    report: &'a Report,
    made: &'a Made<'a>,
    replay: &'a Replay,
}

/// The page; the same run gives the same bytes.
pub(crate) fn html(report: &Report, made: &Made<'_>, replay: &Replay) -> String {
    let title = format!("{}: {} demonstrations", report.task, report.entries.len());
    assembled(TEMPLATE, &PARTS, &title, &Data { report, made, replay })
}

/// A template with its parts, its title and its data inside.
pub(super) fn assembled(template: &str, parts: &[Part], title: &str, data: &impl Serialize) -> String {
    let data = serde_json::to_string(data).expect("plain data always serializes");
    // Inside a script nothing but `<` can end it, and JSON has another way to write it.
    let data = data.replace('<', "\\u003c");
    let mut page = template.to_owned();
    for (name, text) in parts {
        page = page.replacen(&format!("{{{{{name}}}}}"), text, 1);
    }
    // What users write comes last, and of this the data first, so that a title which looks like a place is no place.
    let place = page.find("{{TITLE}}").expect("the template has a title");
    page = page.replacen("{{DATA}}", &data, 1);
    page.replace_range(place..place + "{{TITLE}}".len(), &escaped(title));
    page
}

/// The folder or file that holds the set, without the way to it.
pub(crate) fn name_of_set(path: &Path) -> String {
    let within = |path: &Path, named: &str| path.file_name().is_some_and(|name| name == named);
    let mut named = path;
    if within(named, episode::RECORDED) || within(named, episode::MINARI_HDF5) {
        named = named.parent().unwrap_or(named);
    }
    // Minari keeps its files in a folder of that name, below that of the set.
    if within(named, "data") {
        named = named.parent().unwrap_or(named);
    }
    named.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// A link from a page to a file below its folder, whatever the names of the user's that lead there.
pub(crate) fn link_below(path: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~/".contains(&byte);
    let written = path.bytes().map(|byte| match is_plain(byte) {
        true => char::from(byte).to_string(),
        false => format!("%{byte:02X}"),
    });
    // With a dot before it no name is taken for a scheme such as `javascript:`, or for the root of a disk.
    format!("./{}", written.collect::<String>())
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As WHATWG's URL standard takes it apart again.
    #[test]
    fn a_link_leads_below_its_page_whatever_the_names() {
        for (path, wanted) in [
            ("east/report.html", "./east/report.html"),
            ("javascript:alert(1)/report.html", "./javascript%3Aalert%281%29/report.html"),
            ("//elsewhere/report.html", ".///elsewhere/report.html"),
            ("50% #1?/report.html", "./50%25%20%231%3F/report.html"),
            ("größer/report.html", "./gr%C3%B6%C3%9Fer/report.html"),
            ("a\\b\"'<&/report.html", "./a%5Cb%22%27%3C%26/report.html"),
        ] {
            assert_eq!(link_below(path), wanted);
        }
    }

    #[test]
    fn no_part_ends_its_script_or_names_another_part() {
        for (name, text) in PARTS {
            assert!(
                !text.contains("</script") && !text.contains("<!--") && !text.contains("</style"),
                "{name}"
            );
            assert!(!text.contains("{{DATA}}"), "{name}");
            assert_eq!(TEMPLATE.matches(&format!("{{{{{name}}}}}")).count(), 1, "{name}");
        }
    }

    #[test]
    fn a_set_goes_by_the_name_of_its_folder() {
        assert_eq!(name_of_set(Path::new("/there/free_throw_8/demonstrations.hdf5")), "free_throw_8");
        assert_eq!(name_of_set(Path::new("/there/mine.hdf5")), "mine.hdf5");
        assert_eq!(name_of_set(Path::new("/there/pen/human-v2/data/main_data.hdf5")), "human-v2");
        assert_eq!(name_of_set(Path::new("/there/pen/human-v2/data")), "human-v2");
    }
}
