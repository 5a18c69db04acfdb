//! The paper's experiments, as study files that come with demosift.

use demosift::{Error, Result};

/// All of them at once.
pub(crate) const ALL: &str = "all";

/// An experiment by its name, with its study file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Experiment {
    pub(crate) name: &'static str,
    pub(crate) text: &'static str,
}

/// In the order of the paper; those that share cells with earlier ones find them.
pub(crate) const EXPERIMENTS: [Experiment; 9] = [
    Experiment { name: "fig3", text: include_str!("../../reproduce/fig3.toml") },
    Experiment { name: "fig4", text: include_str!("../../reproduce/fig4.toml") },
    Experiment { name: "fig5", text: include_str!("../../reproduce/fig5.toml") },
    Experiment { name: "fig6", text: include_str!("../../reproduce/fig6.toml") },
    Experiment { name: "fig7", text: include_str!("../../reproduce/fig7.toml") },
    Experiment { name: "fig8", text: include_str!("../../reproduce/fig8.toml") },
    Experiment { name: "fig9", text: include_str!("../../reproduce/fig9.toml") },
    Experiment { name: "table1", text: include_str!("../../reproduce/table1.toml") },
    Experiment { name: "variants", text: include_str!("../../reproduce/variants.toml") },
];

/// The experiments that a name means.
///
/// # Errors
/// `is_bad_input`; lists the names.
pub(crate) fn named(name: &str) -> Result<Vec<Experiment>> {
    // It is drawn beside fig4, from the same cells.
    let name = if name == "fig10" { "fig4" } else { name };
    match EXPERIMENTS.iter().find(|experiment| experiment.name == name) {
        Some(experiment) => Ok(vec![*experiment]),
        None if name == ALL => Ok(EXPERIMENTS.to_vec()),
        None => {
            let known: Vec<&str> = EXPERIMENTS.iter().map(|experiment| experiment.name).collect();
            Err(Error::bad_input(format!(
                "there is no experiment '{name}'; there are: {}, {ALL}",
                known.join(", ")
            ))
            .with_hint("or give a study file, NAME.toml, or a file of results, NAME.json"))
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use demosift::run::study::Finished;

    use super::*;
    use crate::arguments::OnlyThese;
    use crate::study::study_file::{self, Asked, Source};
    use crate::study::study_folder;

    fn data() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data")
    }

    /// They keep their cells in one folder, so a name must mean the same cell in each.
    #[test]
    fn experiments_that_share_a_cell_make_it_alike() {
        for preset in ["quick", "standard", "paper"] {
            let mut known = BTreeMap::new();
            let mut shared = 0;
            for experiment in EXPERIMENTS {
                let source = Source::BuiltIn { name: experiment.name, text: experiment.text, sets: &data() };
                let only = OnlyThese::default();
                let asked = Asked { source, public: None, only: &only, preset: Some(preset), seeds: Some(1) };
                let opened = study_file::open(&asked).unwrap();
                let set = |name: &str| {
                    let place = opened.study.sets.iter().position(|set| set.name == name).unwrap();
                    &opened.sets[place]
                };
                for work in opened.study.work(&Finished::default()) {
                    let lender = opened.study.lender(&work).map(set);
                    let of = study_folder::fingerprint(&work, set(work.set()), lender);
                    shared += usize::from(known.contains_key(&work.name()));
                    let before = known.entry(work.name()).or_insert_with(|| of.clone());
                    assert_eq!(*before, of, "{} in {} by {preset}", work.name(), experiment.name);
                }
            }
            assert!(shared > 20, "{shared}");
        }
    }

    #[test]
    fn every_experiment_says_what_it_draws_and_decides() {
        for Experiment { name, text } in EXPERIMENTS {
            let source = Source::BuiltIn { name, text, sets: &data() };
            let only = OnlyThese::default();
            let asked = Asked { source, public: None, only: &only, preset: None, seeds: None };
            let study = study_file::open(&asked).unwrap().study;
            for set in study.sets.iter().filter(|set| !set.bodies.is_empty()) {
                let others = set.by_others();
                assert!(others.contains(&true) && others.contains(&false), "{name}: {}", set.name);
            }
            let drawn = study.drawn;
            assert!(drawn.title.is_some() && drawn.paper.is_some(), "{name}");
            assert_eq!(drawn.preset.as_deref(), Some("standard"), "{name}");
            assert!(!drawn.figures.is_empty() || name == "table1", "{name}");
            assert!(!drawn.claims.is_empty() || ["fig5", "variants"].contains(&name), "{name}");
        }
    }
}
