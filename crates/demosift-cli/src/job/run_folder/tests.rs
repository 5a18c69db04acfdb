use demosift::results::artifact::{self, Artifact as _};
use demosift::stages::method::Spent;
use demosift_gymnasium::trial::Repeats;

use super::*;
use crate::task::simulator::Simulator;

fn scratch(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("demosift-run-{}-{name}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn identity() -> Identity {
    Identity {
        demosift: "1.0.0".to_owned(),
        format: FORMAT_VERSION,
        task: "my_env.py:make".to_owned(),
        task_sha256: Some("ab".to_owned()),
        variant: None,
        simulator: Some(Simulator {
            python: PathBuf::from("python3"),
            heuristic: "return".to_owned(),
            measure: None,
            horizon: 100,
            versions: BTreeMap::from([("numpy".to_owned(), "2.0.0".to_owned())]),
            repeats: Repeats::Exactly,
            bounds: Vec::new(),
            spec: None,
            trusted: false,
        }),
        data: None,
        prior: None,
        configuration_sha256: String::new(),
    }
}

fn part(words: &str) -> Part {
    words.parse().unwrap()
}

/// A training by a trainer as it was before lies under the same name as one by the trainer as it is now.
#[test]
fn of_several_results_of_a_name_the_one_that_fits_is_found() {
    let path = scratch("fits");
    let values = Table::from_iter([("seed".to_owned(), 1.into())]);
    let mut part = RunFolder::join(path.clone(), part("1/2"), &identity(), &values).unwrap();
    let spent = |environment_steps| Spent { environment_steps, ..Spent::default() };
    spent(2).store(&mut part, "x").unwrap();
    let begun = look_into(&path, true).unwrap();
    fs::rename(path.join(PARTS), path.join("elsewhere")).unwrap();
    let mut whole = RunFolder::open(path.clone(), begun.as_ref(), &identity(), &values).unwrap();
    spent(1).store(&mut whole, "x").unwrap();
    let fitting = |ledger: &RunFolder, steps| {
        let fits = |spent: &Spent| spent.environment_steps == steps;
        artifact::recall_fitting(ledger, "x", fits).unwrap().map(|spent| spent.environment_steps)
    };
    assert_eq!([1, 2].map(|steps| fitting(&whole, steps)), [Some(1), None]);
    fs::rename(path.join("elsewhere"), path.join(PARTS)).unwrap();
    for folder in [&whole, &part] {
        assert_eq!([1, 2, 3].map(|steps| fitting(folder, steps)), [Some(1), Some(2), None]);
    }
    drop((whole, part));
    fs::remove_dir_all(&path).unwrap();
}

/// Of two that start together neither finds a run where it looks for one, so what is begun is looked at once more.
#[test]
fn a_part_that_joins_is_held_against_what_another_one_began() {
    let (folder, values) = (scratch("joins"), Table::from_iter([("seed".to_owned(), 1.into())]));
    let of = |change: &dyn Fn(&mut Identity)| {
        let mut identity = identity();
        change(&mut identity);
        identity
    };
    let numpy = |identity: &mut Identity| {
        let simulator = identity.simulator.as_mut().unwrap();
        simulator.versions.insert("numpy".to_owned(), "2.1.0".to_owned());
    };
    RunFolder::join(folder.clone(), part("1/2"), &identity(), &values).unwrap();
    RunFolder::join(folder.clone(), part("2/2"), &identity(), &values).unwrap();
    for (other, wanted) in [
        (of(&numpy), "the version of numpy was 2.0.0 there, and is 2.1.0 now"),
        (of(&|identity| identity.task_sha256 = Some("cd".to_owned())), "SHA-256 of the task's files was ab"),
        (of(&|identity| identity.task = "other.py:make".to_owned()), "the task was my_env.py:make"),
        (of(&|identity| identity.simulator = None), "the task was an environment of --env"),
        (of(&|identity| identity.demosift = "2.0.0".to_owned()), "the version of demosift was 1.0.0"),
    ] {
        let error = RunFolder::join(folder.clone(), part("2/2"), &other, &values).unwrap_err();
        assert!(error.is_bad_config() && error.message().contains(wanted), "{error}");
    }
    fs::remove_dir_all(&folder).unwrap();
}
