//! Which demonstrations should your agent learn from?
//!
//! demosift answers by trying: it meta-learns a policy that imitates any demonstration of a noisy set within a few
//! updates, lets it imitate each one, and scores what comes out with the task's own heuristic.
//!
//! Here six demonstrations drive a point mass, which should go east; two of them do.
//!
//! ```
//! use demosift::basics::ledger::InMemory;
//! use demosift::basics::observer::Silent;
//! use demosift::basics::seed::Seed;
//! use demosift::run::experiment::{Run, sift};
//! use demosift::run::preset::Preset;
//! use demosift::world::point_mass::{PointMass, planted_set};
//! use demosift::world::rollout::Playground;
//!
//! // Where each demonstration goes, in degrees away from the goal. Nothing in the set tells.
//! let set = planted_set(&[180.0, 5.0, 120.0, -10.0, -150.0, 90.0], Seed::new(1))?;
//! let mut config = Preset::Quick.config();
//! (config.meta_train.rounds, config.imitate.environment_steps) = (8, 10_000);
//! config.inner.alphas = vec![1.0, 0.5]; // the paper's schedule: half steps after the first
//! config.imitate.update.discriminator.learning_rate = 0.01; // 10,000 steps are few
//!
//! let task = PointMass::new();
//! let sifted = sift(&mut Run {
//!     set: &set,
//!     playground: &Playground::new(&task), // where policies are played and scored
//!     config: &config,
//!     ledger: &mut InMemory::default(), // keeps what is found; a run folder can be one
//!     observer: &mut Silent,            // receives progress
//! })?;
//!
//! // Imitating the second or the fourth demonstration leads to the goal, so these are kept.
//! let mut kept: Vec<usize> = sifted.selection.subset.demos.iter().map(|demo| demo.0).collect();
//! kept.sort();
//! assert_eq!(kept, [1, 3]);
//! // Policies that learned from them surely come nearer to the goal than those that learned from all.
//! let difference = sifted.verdict.difference.expect("both were trained several times");
//! assert!(difference.low > 0.0, "{}", sifted.verdict.sentence);
//! # Ok::<(), demosift::Error>(())
//! ```
//!
//! The modules are bands, each of which uses lower ones only: [`basics`], [`math`], [`data`], [`world`], [`learning`],
//! [`stages`], [`results`] and [`run`], from the lowest to the highest.
//! Read from [`run::experiment::sift`] downward; the algorithms of the paper lie in [`stages`].
//!
//! The method is that of "Learning from noisy demonstration sets via meta-learned suitability assessor"; sections,
//! equations and algorithms in this documentation are those of that paper.

pub mod basics;
pub mod data;
pub mod learning;
pub mod math;
pub mod results;
pub mod run;
pub mod stages;
pub mod world;

pub use basics::error::{Error, Result};
