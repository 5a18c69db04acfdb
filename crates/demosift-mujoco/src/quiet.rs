//! Keeps MuJoCo from writing to the terminal and into `MUJOCO_LOG.TXT`: a library prints nothing.
//!
//! With one exception: after an error in a simulation or in rendering MuJoCo cannot go on, and its own handler ends the process.
//! So does ours, and says why, in the form that the command gives its errors.
//! An error while a model is loaded is none of these: MuJoCo catches it.
//!
//! What MuJoCo warns of is not lost: warnings of a simulation are counted in its data, and
//! [`MujocoEnvironment`](crate::environment::MujocoEnvironment) reads the counts after every control step.
//! What it says of a model that it rejects is asked for here as well, in full, which the binding cuts after 99 letters.
//! The only unsafe code of the crate.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_int};
use std::io::Write as _;
use std::ptr;
use std::sync::Once;

use mujoco_rs::mujoco_c::{mj_deleteModel, mj_loadXML, mju_setLogHandler};
use mujoco_rs::wrappers::mj_logging::{MjLogMessage, MjtLogLevel};

/// What to do where nothing can be rendered.
pub(crate) const NEEDED_TO_RENDER: &str =
    "rendering needs EGL; on Debian or Ubuntu: apt-get install libegl1 libgl1-mesa-dri libgles2";

/// What the command returns after any error of a simulation.
const FAILURE: i32 = 1;

/// Silences MuJoCo, once for the process; every path to a model calls it first.
pub(crate) fn quiet() {
    static DONE: Once = Once::new();
    DONE.call_once(|| {
        // SAFETY: no other thread uses MuJoCo: models are made in `model.rs` only, after this call, which all
        // threads await; and without a model nothing of MuJoCo can be used.
        unsafe { mju_setLogHandler(Some(listen)) };
    });
}

/// Drops what MuJoCo says, unless it is an error.
unsafe extern "C" fn listen(message: *const MjLogMessage) {
    // SAFETY: MuJoCo hands over a message that lives until this returns.
    let Some(message) = (unsafe { message.as_ref() }) else { return };
    if message.level() == MjtLogLevel::mjLOG_ERROR {
        give_up(message.subject());
    }
}

/// Ends the process: who returned from here would go on in a simulation that is broken, and MuJoCo's own handler ends it as well.
/// Files are written whole or not at all, and a lock whose process is gone is taken over.
#[allow(clippy::disallowed_methods)]
fn give_up(said: &str) -> ! {
    // Names in it come from files, and a terminal obeys some letters.
    let first = said.lines().next().unwrap_or_default().trim().replace(char::is_control, "?");
    // Until the end, so that no other thread says the same.
    let mut out = std::io::stderr().lock();
    let _ = writeln!(out, "error: MuJoCo: {first}");
    let _ = writeln!(out, "hint: {}", way_out(&first));
    std::process::exit(FAILURE)
}

fn way_out(said: &str) -> &'static str {
    let is_about = |words: &[&str]| words.iter().any(|word| said.contains(word));
    if is_about(&["memory", "stack"]) {
        "the model needs more memory than it asks for: set <size memory=\"100M\"/> in it, or leave `memory` out"
    } else if is_about(&["framebuffer", "OpenGL", "EGL"]) {
        NEEDED_TO_RENDER
    } else {
        "MuJoCo cannot go on after this; `demosift task check TASK` may find what is odd in the task or its model"
    }
}

/// Longer than any of MuJoCo's messages, which hold a path or two.
const LONGEST_MESSAGE: usize = 1 << 14;

/// All that MuJoCo says against the MJCF file at this path; `None` if it has nothing to say now.
pub(crate) fn complaint(path: &str) -> Option<String> {
    let path = CString::new(path).ok()?;
    let mut message = vec![0; LONGEST_MESSAGE];
    let (buffer, room) = (message.as_mut_ptr(), LONGEST_MESSAGE as c_int);
    // SAFETY: the path ends with a zero, and the buffer is as long as is said; MuJoCo writes a zero into it, and it is full of
    // zeros before. Without a virtual file system it reads the file itself. A model, which there should be none, is given back.
    let said = unsafe {
        let model = mj_loadXML(path.as_ptr(), ptr::null(), buffer, room);
        if !model.is_null() {
            mj_deleteModel(model);
        }
        CStr::from_ptr(message.as_ptr())
    };
    let said = said.to_string_lossy().trim().to_owned();
    (!said.is_empty()).then_some(said)
}
