//! A user's own simulator: an environment of Gymnasium, in Python processes, as a task of demosift.
//!
//! The environment lives in the user's own interpreter, one process for each worker, so that it may need whatever it needs:
//! its MuJoCo need not be ours, and what crashes there is an error here.
//! A process is handed one file of Python, which is part of this crate and needs numpy and gymnasium only.
//! The policy is played by this crate, here and stepped over a pipe, or there, where the wheel of demosift can be imported; so
//! what it does has the bits of every other task.
//!
//! | here | is |
//! |---|---|
//! | [`source`] | what the user calls the environment, and what a set says of its own |
//! | `own` | functions of the user's beside an environment: what measures more, and what scores an episode |
//! | `robosuite` | the environment of robosuite that a set of robomimic names |
//! | `process` | one process: frames, a time limit, its last words; and the end of all of them |
//! | [`turn`] | what a reset or a step leads to |
//! | [`whole`] | one episode, played here or there |
//! | `session` | one environment that is open: reset, step, whole episodes |
//! | [`task`] | the environment as a [`Task`](demosift::world::environment::Task) with its workers |
//! | [`trainer`] | a trainer of the user's own as a [`Trainer`](demosift::world::trainer::Trainer), with its policies |
//! | [`trial`] | a few steps by which is seen whether it repeats |
//! | [`units`] | actions in the environment's own unit |
//! | [`pictures`] | what an episode looks like |
//! | [`replay`] | demonstrations that are played again with their recorded actions |
//! | [`check`] | whether it repeats, how fast it is, and whether recorded demonstrations fit it |
//!
//! What an episode leaves behind, step by step: `reward`, `terminated`, and the numbers of `info` that the heuristic reads.
//! The row after the reset has nothing to say and is 0; no heuristic reads it.

pub mod check;
mod own;
pub mod pictures;
mod process;
pub mod replay;
mod robosuite;
mod session;
pub mod source;
pub mod task;
pub mod trainer;
pub mod trial;
pub mod turn;
pub mod units;
pub mod whole;

pub use process::end_all;
