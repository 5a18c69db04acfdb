//! Which files a model is made of: an MJCF file may include others, from other folders too.

use std::path::{Path, PathBuf};

use demosift::{Error, Result};

/// The MJCF file `model` and all that it includes, directly or not, each once, in order of their paths.
///
/// MuJoCo looks for an included file beside the file that includes it or beside the model; what lies at either place is listed.
///
/// # Errors
/// If a file cannot be read.
pub(crate) fn files_of(model: &Path) -> Result<Vec<PathBuf>> {
    let root = model.parent().unwrap_or(Path::new(""));
    let mut found = vec![resolved(model)?];
    let mut next = 0;
    while let Some(file) = found.get(next).cloned() {
        next += 1;
        let text = std::fs::read_to_string(&file)
            .map_err(|error| Error::io("cannot read the model", &file, &error))?;
        let beside = file.parent().unwrap_or(Path::new(""));
        for name in included_by(&text) {
            for candidate in [root.join(name), beside.join(name)] {
                if candidate.is_file() {
                    let candidate = resolved(&candidate)?;
                    if !found.contains(&candidate) {
                        found.push(candidate);
                    }
                }
            }
        }
    }
    found.sort();
    Ok(found)
}

/// One name for each file, so that none is listed twice.
fn resolved(path: &Path) -> Result<PathBuf> {
    std::fs::canonicalize(path).map_err(|error| Error::io("cannot find the model", path, &error))
}

/// The file names in the `<include file="..."/>` elements of a text, comments left out.
fn included_by(text: &str) -> Vec<&str> {
    let mut names = Vec::new();
    let mut rest = text;
    while let Some(start) = rest.find('<') {
        rest = &rest[start..];
        let comment = rest.starts_with("<!--");
        let end = if comment { rest.find("-->") } else { rest.find('>') }.unwrap_or(rest.len());
        let element =
            rest[..end].strip_prefix("<include").filter(|rest| rest.starts_with(char::is_whitespace));
        names.extend(element.and_then(file_attribute));
        rest = &rest[end..];
    }
    names
}

/// The value of `file` among the attributes of an element.
fn file_attribute(attributes: &str) -> Option<&str> {
    let value = attributes.trim_start().strip_prefix("file")?.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|first| matches!(first, '"' | '\''))?;
    value[1..].split(quote).next()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn only_include_elements_outside_comments_count() {
        let text = r#"<mujoco> <!-- <include file="no.xml"/> > --> <include file="a.xml"/>
            <include
                file = '../b/c.xml' /> <includes file="no.xml"/> <mesh file="no.stl"/> </mujoco>"#;
        assert_eq!(included_by(text), ["a.xml", "../b/c.xml"]);
        assert!(included_by("<include").is_empty() && included_by("<include file=").is_empty());
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
