//! `cargo xtask`: fetches the pinned MuJoCo, then tests, demonstrates, measures, installs or packs demosift.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a terminal is all it has")]

mod browser;
mod free_throw;
mod fuzzing;
mod install;
mod mujoco;
mod python;
mod rendering;
mod steps;
mod wheel;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

const USAGE: &str = "\
usage: cargo xtask COMMAND

  setup   fetch the pinned MuJoCo into .mujoco/lib
  test    setup; check format and lints, run all tests
  demo    setup; build, then sift the eight free throws of the repository
  bench   setup; measure the learner and the simulator
  install [--root DIR] [--debug]
          setup; put the command and its MuJoCo where they work without this checkout: DIR/bin and DIR/lib/demosift;
          DIR is cargo's own folder if it is not given
  wheel [--debug]
          setup; build the wheel for Python, try it in fresh environments, and say how to install it
  fuzz [--seconds N] [TARGET...]
          setup; run each target of fuzz/ for a minute, or those that are named
  torture setup; build, then kill, break and crowd runs, with --full for hours
  schema  setup; write the JSON Schemas of docs/schema from the types
  free-throw  make the taller thrower of Free Throw, and the task without the ball, again from the task";

/// Why a command stopped, and the exit code that says so.
struct Failure {
    message: String,
    code: u8,
}

impl From<String> for Failure {
    fn from(problem: String) -> Self {
        Self { message: format!("error: {problem}"), code: 1 }
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let root = checkout();
    let outcome = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["setup"] => set_up(&root),
        ["test"] => set_up(&root).and_then(|()| {
            browser::set_up();
            python::set_up(&root);
            steps::test(&root)
        }),
        ["demo"] => set_up(&root).and_then(|()| steps::demo(&root)),
        ["bench"] => set_up(&root).and_then(|()| steps::bench(&root)),
        ["install", ref rest @ ..] => set_up(&root).and_then(|()| install::install(&root, rest)),
        ["wheel", ref rest @ ..] => set_up(&root).and_then(|()| wheel::wheel(&root, rest)),
        ["fuzz", ref options @ ..] => set_up(&root).and_then(|()| fuzzing::run(&root, options)),
        ["torture", ref options @ ..] => set_up(&root).and_then(|()| steps::torture(&root, options)),
        ["schema"] => set_up(&root).and_then(|()| steps::schema(&root)),
        ["free-throw"] => free_throw::write(&root).map_err(Failure::from),
        ["help" | "--help" | "-h"] => {
            println!("{USAGE}");
            return ExitCode::SUCCESS;
        }
        _ => Err(Failure { message: USAGE.to_owned(), code: 2 }),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure { message, code }) => {
            eprintln!("{message}");
            ExitCode::from(code)
        }
    }
}

/// What every command does first.
fn set_up(root: &Path) -> Result<(), Failure> {
    mujoco::set_up(root)?;
    rendering::set_up();
    Ok(())
}

/// The folder that holds the workspace.
fn checkout() -> PathBuf {
    let xtask = Path::new(env!("CARGO_MANIFEST_DIR"));
    xtask.parent().expect("xtask lies in the workspace").to_owned()
}
