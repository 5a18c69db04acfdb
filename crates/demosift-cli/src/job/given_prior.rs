//! `--prior RUN`: the prior of an earlier run, which other demonstrations of the same task are judged from.

use std::path::Path;

use demosift::basics::counting::counted;
use demosift::basics::files;
use demosift::basics::ledger::Ledger as _;
use demosift::data::demonstration::DemonstrationSet;
use demosift::data::demonstration::episode::RECORDED;
use demosift::learning::adapt::MetaPrior;
use demosift::results::artifact::Artifact as _;
use demosift::run::experiment::Config;
use demosift::{Error, Result};
use toml::Table;

use crate::configuration;
use crate::job::identity::{Identity, PriorOrigin};
use crate::job::run_folder::{self, RunFolder};
use crate::task::Chosen;
use crate::task::simulator::{self, Simulated};

/// The file of a run that holds its prior.
const PRIOR: &str = "prior.safetensors";
/// What may differ from the earlier run: nothing of it moves a score.
const MAY_DIFFER: [&str; 5] = ["judges", "keep", "referee", "imitate", "subset_selection"];

/// An earlier run that has a prior.
#[derive(Debug)]
pub(crate) struct GivenPrior {
    pub(crate) origin: PriorOrigin,
    pub(crate) identity: Identity,
    /// As the run wrote it down.
    pub(crate) values: Table,
    pub(crate) config: Config,
    pub(crate) folder: RunFolder,
    prior: MetaPrior,
}

impl GivenPrior {
    /// Looks into the folder of a run without touching it.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let (identity, folder) = run_folder::of_finished(path)?;
        let values = run_folder::read_configuration(path, &identity)?;
        if path.join(RECORDED).exists() {
            return Err(Error::bad_input("this is the folder of a `record`, which has demonstrations and no prior")
                .at(path)
                .with_hint("give the folder of a run that has one: of `demosift meta-train`, or of judge or sift without --judge cloning"));
        }
        let config: Config = configuration::config_of_job(values.clone()).map_err(|error| error.at(path))?;
        let (Some(prior), Some(bytes)) =
            (MetaPrior::recall(&folder, "").map_err(|error| error.at(path))?, folder.recall(PRIOR)?)
        else {
            return Err(Error::bad_input(format!("the run has no prior: there is no {PRIOR}"))
                .at(path)
                .with_hint("the judge of the paper makes one: `demosift meta-train`, or judge or sift without --judge cloning"));
        };
        let run = std::fs::canonicalize(path).map_err(|error| Error::io("cannot find", path, &error))?;
        let origin = PriorOrigin { run, sha256: files::sha256_of(&bytes) };
        Ok(Self { origin, identity, values, config, folder, prior })
    }

    pub(crate) fn prior(&self) -> &MetaPrior {
        &self.prior
    }

    /// Whether it is about this task, and the same goal of it.
    pub(crate) fn check_task(&self, chosen: &Chosen) -> Result<()> {
        let word = |value: &Option<String>, none: &str| value.clone().unwrap_or_else(|| none.to_owned());
        let pairs = [
            ("task", self.identity.task.clone(), chosen.name.clone()),
            (
                "SHA-256 of the task's files",
                word(&self.identity.task_sha256, "none"),
                word(&chosen.sha256, "none"),
            ),
            ("variant", word(&self.identity.variant, "all of them"), word(&chosen.variant, "all of them")),
        ];
        let of_simulator = simulator::difference(
            self.identity.simulator.as_ref(),
            chosen.simulated.as_ref().map(Simulated::identity).as_ref(),
        );
        let of_simulator =
            of_simulator.map(|(what, old, new)| (what.trim_start_matches("the ").to_owned(), old, new));
        let of_task = pairs.into_iter().find(|(_, old, new)| old != new);
        match of_task.map(|(what, old, new)| (what.to_owned(), old, new)).or(of_simulator) {
            None => Ok(()),
            Some((what, old, new)) => Err(Error::bad_config(format!(
                "the prior cannot be used: the {what} of its run was {old}, and is {new} now"
            ))
            .at(&self.origin.run)
            .with_hint("a prior is good for the task that it was trained in")),
        }
    }

    /// Whether demonstrations have the sizes of those that it was trained on.
    pub(crate) fn check_sizes(&self, set: &DemonstrationSet) -> Result<()> {
        let policy = &self.prior.policy;
        let sizes = [
            ("observation", set.observation_size(), policy.filter().observation_size()),
            ("action", set.action_size(), policy.action_size()),
        ];
        match sizes.into_iter().find(|(_, found, wanted)| found != wanted) {
            None => Ok(()),
            Some((what, found, wanted)) => Err(Error::bad_input(format!(
                "the demonstrations have {} in an {what}, but the prior was trained on {wanted}",
                counted(found, "number")
            ))
            .with_hint(format!("the prior is that of {}", self.origin.run.display()))),
        }
    }

    /// Whether scores from these values can stand beside those of the earlier run.
    pub(crate) fn check_values(&self, values: &Table) -> Result<()> {
        if configuration::is_judged_by_trainer(values) {
            return Err(Error::bad_config(
                "--prior judges from what was learned, and your own trainer (judges = trainer) learns from nothing",
            )
            .with_hint("say --judge cloning, paper or both"));
        }
        let that_move_scores = |values: &Table| -> Table {
            values.clone().into_iter().filter(|(key, _)| !MAY_DIFFER.contains(&key.as_str())).collect()
        };
        let (old, new) = (that_move_scores(&self.values), that_move_scores(values));
        match configuration::first_difference(&old, &new) {
            None => Ok(()),
            Some((key, old, new)) => Err(Error::bad_config(format!(
                "{key} was {old} in the run of the prior, and is {new} now, so that scores could not be compared"
            ))
            .at(&self.origin.run)
            .with_hint("take back the change; the values of that run are taken where none are given")),
        }
    }
}
