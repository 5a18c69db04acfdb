//! `demosift task new`: a first task.toml for a model.

use std::path::{Path, PathBuf};

use demosift::basics::files;
use demosift::{Error, Result};
use demosift_mujoco::draft::{self, Wanted};
use demosift_mujoco::model::Model;

use crate::arguments::TaskNewArguments;
use crate::console::terminal;
use crate::files::writing::undisturbed;
use crate::job::demonstrations;

const TASK_FILE: &str = "task.toml";

pub(crate) fn run(arguments: &TaskNewArguments) -> Result<()> {
    let model = Model::from_file(&arguments.model)?;
    let beside = arguments.model.parent().unwrap_or(Path::new(""));
    let folder = arguments.out.as_deref().unwrap_or(beside);
    let file = folder.join(TASK_FILE);
    if file.exists() {
        return Err(Error::bad_input("there is a task file already")
            .at(&file)
            .with_hint("change that one, or give another folder to --out"));
    }
    let opened = match &arguments.data {
        Some(data) => Some(demonstrations::open_unchecked(Some(data), &arguments.storage, None)?),
        None => None,
    };
    let set = opened.as_ref().map(|opened| opened.source.recorded()).transpose()?;
    let rate = opened.as_ref().and_then(|opened| {
        let told = opened.said.set_file.rate.or(opened.source.says.steps_per_sec);
        told.or_else(|| Some(1.0 / demosift::data::demonstration::timing::timing(&opened.source)?.step_secs))
    });
    let wanted = Wanted {
        name: &name_of(&arguments.model),
        model_file: &model_file(&arguments.model, arguments.out.as_deref())?,
        set: set.as_deref(),
        steps_per_sec: rate,
    };
    let draft = draft::draft(&model, &wanted)?;
    std::fs::create_dir_all(if folder.as_os_str().is_empty() { Path::new(".") } else { folder })
        .map_err(|error| Error::io("cannot make the folder", folder, &error))?;
    undisturbed(|| files::write_atomically(&file, draft.text.as_bytes()))?;
    let fits = match draft.fits {
        Some(false) => " It does not have the sizes of the set yet; a comment says where.",
        _ => "",
    };
    terminal::show(&format!(
        "A first task file: {}.{fits} Say what you want where it says TODO.\n",
        file.display()
    ));
    Ok(())
}

fn name_of(model: &Path) -> String {
    let stem =
        model.file_stem().map_or_else(|| "task".to_owned(), |stem| stem.to_string_lossy().into_owned());
    stem.chars().map(|letter| if letter.is_alphanumeric() { letter } else { '_' }).collect()
}

/// The model as the task file names it: by its name where it lies beside it, and else by its whole path.
fn model_file(model: &Path, out: Option<&Path>) -> Result<String> {
    let named: PathBuf = match out {
        None => model.file_name().map_or_else(PathBuf::new, PathBuf::from),
        Some(_) => {
            std::fs::canonicalize(model).map_err(|error| Error::io("cannot find the model", model, &error))?
        }
    };
    let text = named.to_str().ok_or_else(|| Error::bad_input("the path is not UTF-8").at(model))?;
    if text.contains(['"', '\\']) {
        return Err(Error::bad_input("a task file cannot name a model with such letters").at(model));
    }
    Ok(text.to_owned())
}
