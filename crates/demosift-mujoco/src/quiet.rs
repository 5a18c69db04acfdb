//! Keeps MuJoCo from writing to the terminal and into `MUJOCO_LOG.TXT`: a library prints nothing.
//!
//! What MuJoCo warns of is not lost: warnings of a simulation are counted in its data, and
//! [`MujocoEnvironment`](crate::environment::MujocoEnvironment) reads the counts after every control step.
//! What it says of a model that it rejects is asked for here as well, in full, which the binding cuts after 99 letters.
//! The only unsafe code of the crate.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_int};
use std::ptr;
use std::sync::Once;

use mujoco_rs::mujoco_c::{mj_deleteModel, mj_loadXML};
use mujoco_rs::wrappers::mj_logging::{log_config, set_log_config};

/// Silences MuJoCo, once for the process; every path to a model calls it first.
pub(crate) fn quiet() {
    static DONE: Once = Once::new();
    DONE.call_once(|| {
        let config = log_config().with_logto_console(false).with_logto_file(false);
        // SAFETY: no other thread uses MuJoCo: models are made in `model.rs` only, after this call, which all
        // threads await; and without a model nothing of MuJoCo can be used.
        unsafe { set_log_config(config) };
    });
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
