//! Runs the command as a user would, in a folder of its own.

pub(crate) mod schema;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicUsize, Ordering};

use demosift::basics::seal;
use demosift::basics::seed::Seed;
use demosift::data::demonstration::DemonstrationSet;
use demosift::data::demonstration::d4rl::{self, Episode};
use demosift::world::point_mass;

/// Budgets that take a second.
pub(crate) const TINY: &str = "
[inner]
batch_steps = 120
[meta_train]
rounds = 6
checkpoint_every = 2
[judge]
iterations = 2
evaluations = 4
repeats = 2
[cloning_judge.judging]
iterations = 4
averaged = 2
evaluations = 4
repeats = 2
most_repeats = 3
[imitate]
environment_steps = 1800
evaluations = 4
evaluate_every = 2
checkpoint_every = 2
cloning_updates = 6
[imitate.update]
batch_steps = 300
[referee]
cloning = 3
gail = 1
";

/// A recording of the point mass that takes a second.
pub(crate) const RECORD: &str = "record --task point_mass --count 3 --set demonstrator.snapshot_every=1 \
                                 --set demonstrator.batch_steps=300 --set demonstrator.updates=40 --set demonstrator.checkpoint_every=2";

/// A folder that goes away with the test; commands run in it.
pub(crate) struct Scratch(pub(crate) PathBuf);

impl Scratch {
    /// With four demonstrations of the point mass in `set/`, and [`TINY`] in `tiny.toml`.
    pub(crate) fn new(name: &str) -> Self {
        // Tests of two files may take the same name.
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder =
            std::env::temp_dir().join(format!("demosift-cli-{}-{number}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(folder.join("set")).unwrap();
        std::fs::write(folder.join("tiny.toml"), TINY).unwrap();
        let scratch = Self(folder);
        let set = point_mass::planted_set(&[180.0, 0.0, 90.0, 10.0], Seed::new(3)).unwrap();
        write_set(&scratch.0.join("set/demonstrations.hdf5"), &set);
        scratch
    }

    pub(crate) fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_demosift"));
        command.current_dir(&self.0).args(arguments.split_whitespace());
        command
    }

    pub(crate) fn run(&self, arguments: &str) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// The command in a shell that has done something before, such as setting a limit.
    pub(crate) fn within(&self, before: &str, arguments: &str) -> Output {
        let line = format!("{before}; exec '{}' {arguments}", env!("CARGO_BIN_EXE_demosift"));
        Command::new("bash").args(["-c", &line]).current_dir(&self.0).output().unwrap()
    }

    /// Standard output of a command that must succeed.
    #[track_caller]
    pub(crate) fn succeed(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{arguments}: {complaint}");
        // Progress is for terminals; what was left out, or can be done next, is for everybody.
        let is_note = |line: &str| line.starts_with("note: ");
        assert!(complaint.lines().all(is_note), "where nobody looks at a terminal: {complaint}");
        let shown = String::from_utf8(output.stdout).unwrap();
        // All that is shown as JSON is held against its schema; of several answers, the first.
        if arguments.contains("--json") {
            let mut answers = serde_json::Deserializer::from_str(&shown).into_iter();
            answers.next().into_iter().for_each(|answer| schema::assert_answer(arguments, &answer.unwrap()));
        }
        shown
    }

    /// What a command complains of that must fail by a mistake of the user's, in one error that has all of these parts.
    #[track_caller]
    pub(crate) fn refuse(&self, arguments: &str, wanted: &[&str]) -> String {
        let output = self.run(arguments);
        let complaint = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments}: {complaint}");
        assert!(output.stdout.is_empty(), "{arguments}");
        let is_error = |line: &&str| line.starts_with("error: ");
        let first = complaint.lines().find(|line| !line.starts_with("note: "));
        assert!(first.as_ref().is_some_and(is_error), "{complaint}");
        assert_eq!(complaint.lines().filter(is_error).count(), 1, "{complaint}");
        for part in wanted {
            assert!(complaint.contains(part), "{complaint} does not say '{part}'");
        }
        complaint
    }

    /// All files of a folder by name, but those in folders of its own.
    pub(crate) fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        std::fs::read_dir(self.0.join(folder))
            .unwrap()
            .map(|entry| entry.unwrap())
            .filter(|entry| entry.path().is_file())
            .map(|entry| (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap()))
            .collect()
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Changes JSON of a run, as somebody would who also knows its checksum.
pub(crate) fn rewritten(file: &Path, change: impl FnOnce(&mut serde_json::Value)) {
    let bytes = seal::of_json(&std::fs::read(file).unwrap(), "the file").unwrap();
    let mut value = serde_json::from_slice(&bytes).unwrap();
    change(&mut value);
    std::fs::write(file, seal::to_json(&value)).unwrap();
}

/// Takes out of results what a clock said.
pub(crate) fn without_seconds(value: &mut serde_json::Value) {
    match value {
        serde_json::Value::Object(fields) => {
            fields.remove("seconds");
            fields.values_mut().for_each(without_seconds);
        }
        serde_json::Value::Array(values) => values.iter_mut().for_each(without_seconds),
        _ => {}
    }
}

/// A file of the repository.
pub(crate) fn in_repository(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// Two folders hold the same files, byte for byte.
#[track_caller]
pub(crate) fn assert_same_files(left: &BTreeMap<String, Vec<u8>>, right: &BTreeMap<String, Vec<u8>>) {
    assert_eq!(left.keys().collect::<Vec<_>>(), right.keys().collect::<Vec<_>>());
    for (name, bytes) in left {
        assert!(*bytes == right[name], "{name} differs");
    }
}

pub(crate) fn write_set(path: &Path, set: &DemonstrationSet) {
    let episodes: Vec<Episode<'_>> = set
        .iter()
        .map(|(_, demonstration)| Episode {
            observations: demonstration.observations(),
            actions: demonstration.actions(),
            states: None,
            terminated: false,
        })
        .collect();
    d4rl::write(path, &episodes).unwrap();
}

/// Waits for a process to end that lost the one which started it: it is gone then, or dead and waiting for its new parent.
pub(crate) fn wait_until_gone(process: &str) {
    let stat = format!("/proc/{process}/stat");
    let until = std::time::Instant::now() + std::time::Duration::from_secs(60);
    while std::fs::read_to_string(&stat).is_ok_and(|stat| !stat.contains(") Z ")) {
        assert!(std::time::Instant::now() < until, "the process {process} is still there");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
}
