//! `--threads`: how many threads learn.

use demosift::{Error, Result};

/// More threads than any machine has processors are a typing mistake, and would be started.
const MOST_THREADS: usize = 4096;

/// Whether so many threads can be meant.
pub(crate) fn check(count: usize) -> Result<()> {
    match count {
        0 => Err(Error::bad_config("--threads 0: must be at least 1")),
        1..=MOST_THREADS => Ok(()),
        _ => Err(Error::bad_config(format!("--threads {count}: must be at most {MOST_THREADS}"))),
    }
}

/// Makes all parallel loops use this many threads.
pub(crate) fn make_all_loops_use(count: Option<usize>) -> Result<()> {
    let Some(count) = count else { return Ok(()) };
    check(count)?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .build_global()
        .map_err(|error| Error::bad_config(format!("--threads {count}: {error}")))
}
