//! Which files a model is made of: an MJCF file may include others, attach other models, and take its meshes, height fields
//! and textures from files, from other folders too.

use std::path::{Path, PathBuf};

use demosift::basics::files;
use demosift::data::demonstration::pointer;
use demosift::{Error, Result};

/// The MJCF file `model` and all that it is made of, directly or not, each once, in order of their paths.
///
/// MuJoCo looks for a file in a folder that depends on what it is and on which file names it; what lies at any of these places
/// is listed.
///
/// # Errors
/// If a file cannot be read, or need not end.
pub(crate) fn files_of(model: &Path) -> Result<Vec<PathBuf>> {
    let root = model.parent().unwrap_or(Path::new("")).to_owned();
    let mut found = vec![resolved(model)?];
    let mut folders = vec![root.clone()];
    let mut named: Vec<String> = Vec::new();
    let mut next = 0;
    while let Some(file) = found.get(next).cloned() {
        next += 1;
        if !is_model(&file) {
            continue;
        }
        let bytes = files::read(&file)?;
        let text = String::from_utf8_lossy(&bytes);
        let beside = file.parent().unwrap_or(Path::new("")).to_owned();
        let Named { files, directories } = Named::of(&text);
        let below = [&root, &beside].map(|at| directories.iter().map(|folder| at.join(folder)).collect());
        for folder in [vec![beside.clone()]].into_iter().chain(below).flatten() {
            if !folders.contains(&folder) {
                folders.push(folder);
            }
        }
        named.extend(files);
        // A folder of one file holds for all that it includes, and of those that include it.
        for candidate in named.iter().flat_map(|name| places(name, &folders)) {
            // MuJoCo would wait for the end of a pipe, and take a pointer of git lfs for a broken mesh.
            pointer::refuse(&candidate)?;
            if candidate.is_file() {
                let candidate = resolved(&candidate)?;
                if !found.contains(&candidate) {
                    found.push(candidate);
                }
            }
        }
    }
    found.sort();
    Ok(found)
}

/// Where a file may lie: by its whole name in each folder, and without the path that a model may ask to be stripped.
fn places(name: &str, folders: &[PathBuf]) -> Vec<PathBuf> {
    let alone = Path::new(name).file_name();
    let names = [Some(Path::new(name)), alone.map(Path::new)].into_iter().flatten();
    names.flat_map(|name| folders.iter().map(move |folder| folder.join(name))).collect()
}

/// Whether a file may name others, as models do and meshes do not.
fn is_model(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ["xml", "mjcf", "urdf"].iter().any(|known| ending.eq_ignore_ascii_case(known)))
}

/// One name for each file, so that none is listed twice.
fn resolved(path: &Path) -> Result<PathBuf> {
    std::fs::canonicalize(path).map_err(|error| Error::io("cannot find the model", path, &error))
}

/// What the text of a model names.
#[derive(Debug, Default, PartialEq)]
struct Named {
    /// The values of `file`, and of `fileup` and the like of a texture.
    files: Vec<String>,
    /// The values of `meshdir`, `texturedir` and `assetdir`.
    directories: Vec<String>,
}

impl Named {
    fn of(text: &str) -> Self {
        let mut named = Self::default();
        for (key, value) in attributes(text) {
            if key.starts_with("file") || key == "filename" {
                named.files.push(plain(value));
            } else if ["meshdir", "texturedir", "assetdir"].contains(&key) {
                named.directories.push(plain(value));
            }
        }
        named
    }
}

/// A value without the letters that XML writes as words.
fn plain(value: &str) -> String {
    [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&apos;", "'"), ("&amp;", "&")]
        .iter()
        .fold(value.to_owned(), |text, (word, letter)| text.replace(word, letter))
}

/// The attributes of all elements of a text with their values, comments left out.
fn attributes(text: &str) -> Vec<(&str, &str)> {
    let mut found = Vec::new();
    let mut rest = text;
    while let Some(start) = rest.find('<') {
        rest = &rest[start + 1..];
        if rest.starts_with("!--") {
            rest = rest.find("-->").map_or("", |end| &rest[end..]);
            continue;
        }
        // Behind the name of the element come attributes, each with its value in quotes, in which a `>` is a letter.
        rest =
            rest.trim_start_matches(|letter: char| !letter.is_whitespace() && letter != '>' && letter != '<');
        while let Some((key, value, behind)) = attribute(rest) {
            found.push((key, value));
            rest = behind;
        }
    }
    found
}

/// The first attribute of what is left of an element, its value, and what is left then.
fn attribute(text: &str) -> Option<(&str, &str, &str)> {
    let text = text.trim_start();
    let end = text.find(|letter: char| letter == '=' || letter.is_whitespace() || "<>".contains(letter))?;
    let (key, rest) = text.split_at(end);
    let rest = rest.trim_start().strip_prefix('=')?.trim_start();
    let quote = rest.chars().next().filter(|first| matches!(first, '"' | '\''))?;
    let (value, rest) = rest[1..].split_once(quote)?;
    Some((key, value, rest))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn all_that_elements_outside_comments_name_counts() {
        let text = r#"<mujoco model="a > b"> <!-- <include file="no.xml"/> > --> <include file="a.xml"/>
            <compiler angle="radian" meshdir="parts" texturedir='skins'/>
            <include
                file = '../b/c.xml' /> <mesh name="m" file="m.stl"/> <texture fileup="u&amp;p.png"/> </mujoco>"#;
        let named = Named::of(text);
        assert_eq!(named.files, ["a.xml", "../b/c.xml", "m.stl", "u&p.png"]);
        assert_eq!(named.directories, ["parts", "skins"]);
        for cut in ["<include", "<include file", "<include file=", "<include file=\"", "<", "<!--", "< <a"] {
            assert_eq!(Named::of(cut), Named::default(), "{cut}");
        }
    }

    #[test]
    fn meshes_textures_and_attached_models_are_files_of_a_model() {
        let folder = std::env::temp_dir().join(format!("demosift-assets-{}", std::process::id()));
        let write = |name: &str, text: &str| {
            let path = folder.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        write(
            "task/model.xml",
            r#"<mujoco><compiler meshdir="../parts" strippath="true"/><asset><mesh file="deep/in/arm.stl"/>
               <hfield name="h" file="hills.png"/><model name="hand" file="../hand/hand.xml"/></asset></mujoco>"#,
        );
        write("hand/hand.xml", r#"<mujoco><compiler assetdir="skins"/><texture file="skin.png"/></mujoco>"#);
        for name in ["parts/arm.stl", "task/hills.png", "hand/skins/skin.png", "hand/skins/other.png"] {
            write(name, name);
        }
        let found = files_of(&folder.join("task/model.xml")).unwrap();
        let names: Vec<_> = found.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        write("parts/arm.stl", "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n");
        let pointer = files_of(&folder.join("task/model.xml")).unwrap_err().to_string();
        assert!(pointer.contains("a pointer of git lfs") && pointer.ends_with("parts/arm.stl"), "{pointer}");
        write("parts/arm.stl", "whole");
        let pipe = std::process::Command::new("mkfifo").arg(folder.join("task/arm.stl")).status().unwrap();
        assert!(pipe.success() && files_of(&folder.join("task/model.xml")).unwrap_err().is_bad_input());
        assert_eq!(names, ["hand.xml", "skin.png", "arm.stl", "hills.png", "model.xml"]);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn files_are_found_through_other_folders_and_in_circles() {
        let folder = std::env::temp_dir().join(format!("demosift-include-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("task")).unwrap();
        std::fs::create_dir_all(folder.join("robot")).unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
        write("task/model.xml", r#"<mujoco><include file="../robot/arm.xml"/></mujoco>"#);
        write("robot/arm.xml", r#"<mujocoinclude><include file="hand.xml"/></mujocoinclude>"#);
        write("robot/hand.xml", r#"<mujocoinclude><include file="arm.xml"/></mujocoinclude>"#);
        let found = files_of(&folder.join("task/model.xml")).unwrap();
        let names: Vec<_> = found.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["arm.xml", "hand.xml", "model.xml"]);
        assert!(files_of(&folder.join("task/none.xml")).unwrap_err().is_io());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
