//! Files that other tools wrote (`formats/make.py`, `docs/formats.md`) are read, damaged ones are refused, and what is written is
//! read again.

use std::fs;
use std::path::{Path, PathBuf};

use demosift::Error;
use demosift::data::demonstration::choice::Choice;
use demosift::data::demonstration::episode::{Columns, Format, Source};
use demosift::data::demonstration::listing::Used;
use demosift::data::demonstration::open;
use demosift::data::demonstration::{self, lerobot, minari, robomimic};
use demosift::data::trajectory::StateLog;

const LENGTHS: [usize; 3] = [4, 3, 5];

/// Each file or folder of `formats/`, with the columns that make an observation and the final observations it keeps.
const FIXTURES: [(&str, Format, &[&str], bool); 13] = [
    ("lerobot_v3", Format::LeRobotV3, &["observation.state"], false),
    ("lerobot_v2", Format::LeRobotV2, &["observation.state"], false),
    ("minari_hdf5", Format::MinariHdf5, &["observations"], true),
    ("minari_parquet", Format::MinariParquet, &["observations"], true),
    ("minari_parquet_dict", Format::MinariParquet, &["observations/position", "observations/velocity"], true),
    ("robomimic.hdf5", Format::Robomimic, &["obs/joint", "obs/wrist"], true),
    ("imitation.npz", Format::ImitationNpz, &["obs"], true),
    ("baselines.npz", Format::BaselinesNpz, &["obs"], false),
    ("stable_baselines.npz", Format::StableBaselinesNpz, &["obs"], false),
    ("maniskill.h5", Format::ManiSkill, &["obs"], true),
    ("aloha", Format::Aloha, &["observations/qpos"], false),
    ("lerobot_v3_zstd", Format::LeRobotV3, &["observation.state"], false),
    ("lerobot_v2_zstd", Format::LeRobotV2, &["observation.state"], false),
];

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/formats").join(name)
}

/// A folder that goes away with the test.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("demosift-formats-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    /// A copy of a fixture.
    fn copy(&self, name: &str) -> PathBuf {
        let to = self.0.join(name);
        copy(&fixture(name), &to);
        to
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn copy(from: &Path, to: &Path) {
    if !from.is_dir() {
        fs::copy(from, to).unwrap();
        return;
    }
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        copy(&entry.path(), &to.join(entry.file_name()));
    }
}

fn read(path: &Path) -> demosift::Result<Source> {
    open::open(path, None, &Columns::default())
}

/// Number `column` of the observation before step `step` of an episode, as `make.py` has it.
fn observation(episode: usize, step: usize, column: usize) -> f32 {
    (episode as f64 + 0.1 * step as f64 + column as f64).sin() as f32
}

fn action(episode: usize, step: usize, column: usize) -> f32 {
    ((episode as f64 + 0.1 * step as f64 + column as f64).cos() / 2.0) as f32
}

#[track_caller]
fn assert_close(found: f32, wanted: f32) {
    assert!((found - wanted).abs() < 1e-6, "{found} is not {wanted}");
}

#[test]
fn what_other_tools_wrote_is_read() {
    for (name, format, observations, keeps_last) in FIXTURES {
        let source = read(&fixture(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(source.format, format, "{name}");
        assert_eq!(source.columns.observations, observations, "{name}");
        assert_eq!(source.dropped_steps, 0, "{name}");
        let lengths: Vec<usize> = source.episodes.iter().map(|episode| episode.actions.len()).collect();
        // What baselines writes has one length.
        let wanted = if format == Format::BaselinesNpz { [4, 4, 4] } else { LENGTHS };
        assert_eq!(lengths, wanted, "{name}");
        for (index, episode) in source.episodes.iter().enumerate() {
            assert_eq!((episode.observations.width(), episode.actions.width()), (3, 2), "{name}");
            assert_eq!(episode.label.trim_start_matches("demo_"), index.to_string());
            for step in 0..lengths[index] {
                (0..3).for_each(|j| {
                    assert_close(episode.observations.row(step)[j], observation(index, step, j))
                });
                (0..2).for_each(|k| assert_close(episode.actions.row(step)[k], action(index, step, k)));
            }
            assert_eq!(episode.last_observation.is_some(), keeps_last, "{name}");
            for (j, &found) in episode.last_observation.iter().flatten().enumerate() {
                assert_close(found, observation(index, lengths[index], j));
            }
        }
        let set = source.set().unwrap();
        assert_eq!((set.len(), set.observation_size(), set.action_size()), (3, 3, 2), "{name}");
        assert_eq!(source, open::open(&fixture(name), Some(format), &Columns::default()).unwrap());
        assert!(!open::files(&fixture(name), None).unwrap().is_empty());
        assert_eq!(demonstration::open::read_states(&fixture(name), None).unwrap(), None, "{name}");
    }
}

#[test]
fn parts_of_a_data_set_lead_to_it() {
    let whole = read(&fixture("minari_hdf5")).unwrap();
    for part in ["minari_hdf5/data", "minari_hdf5/data/main_data.hdf5"] {
        assert_eq!(read(&fixture(part)).unwrap(), whole, "{part}");
    }
    assert_eq!(read(&fixture("minari_parquet/data")).unwrap(), read(&fixture("minari_parquet")).unwrap());
}

#[test]
fn columns_are_read_in_the_order_in_which_they_are_named() {
    for (name, observations, actions) in [
        ("robomimic.hdf5", ["obs/wrist", "obs/joint"], "actions"),
        ("minari_parquet_dict", ["observations/velocity", "observations/position"], "actions"),
    ] {
        let columns = Columns {
            observations: observations.map(str::to_owned).to_vec(),
            actions: vec![actions.to_owned()],
        };
        let source = open::open(&fixture(name), None, &columns).unwrap();
        assert_eq!(source.columns, columns);
        let first = source.episodes[1].observations.row(2);
        for (&found, j) in first.iter().zip([1, 2, 0]) {
            assert_close(found, observation(1, 2, j));
        }
        let wrong = Columns { observations: vec!["obs/elbow".to_owned()], ..Columns::default() };
        let error = open::open(&fixture(name), None, &wrong).unwrap_err();
        assert_says(&error, &["elbow", name]);
    }
}

fn columns(observations: &[&str], actions: &[&str]) -> Columns {
    let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
    Columns { observations: owned(observations), actions: owned(actions) }
}

#[test]
fn integers_halves_truth_and_columns_of_one_dimension_are_numbers() {
    let path = fixture("kinds.hdf5");
    let named = columns(&["half", "one", "flags[1]"], &["integers[:1]", "flags[0:1]"]);
    let source = open::open(&path, None, &named).unwrap();
    assert_eq!(source.episodes.len(), 3);
    for (index, episode) in source.episodes.iter().enumerate() {
        for step in 0..4 {
            let (observed, acted) = (episode.observations.row(step), episode.actions.row(step));
            let place = (4 * index + step) as f32;
            assert!((observed[0] - observation(index, step, 0)).abs() < 1e-3, "as good as a half is");
            let (ends, goes_on) = if step == 3 { (1.0, 0.0) } else { (0.0, 1.0) };
            assert_eq!((&observed[3..], acted), (&[place, goes_on][..], &[2.0 * place - 12.0, ends][..]));
        }
    }
    for (name, wanted) in [("words", "text; wanted numbers"), ("image", "dimensions are not read")] {
        let error = open::open(&path, None, &columns(&[name], &["one"])).unwrap_err();
        assert_says(&error, &[name, wanted]);
    }
    let error = open::open(&path, None, &columns(&["half[1:4]"], &["one"])).unwrap_err();
    assert_says(&error, &["'half[1:4]' is no part of 'half', which has 3 numbers a step", "half[0:3]"]);
    let held = open::columns(&path, &source).unwrap();
    let used = |name: &str| held.iter().find(|column| column.name == name).unwrap().used;
    assert_eq!(
        ["half", "integers", "image", "words", "timeouts"].map(used),
        [Used::Observation, Used::Action, Used::Image, Used::NoNumbers, Used::Not]
    );
}

#[test]
fn a_bad_row_of_lerobot_costs_its_episode_alone() {
    let scratch = Scratch::new("ragged");
    let path = scratch.copy("lerobot_ragged");
    // What macOS leaves beside a file is no table.
    fs::write(path.join("data/chunk-000/._file-000.parquet"), b"x").unwrap();
    let source = read(&path).unwrap();
    let faults: Vec<&str> = source.episodes.iter().filter_map(|one| one.unreadable.as_deref()).collect();
    assert_eq!(faults.len(), 3);
    for (fault, wanted) in faults.iter().zip([
        "at step 2 'action' is empty or lacks a number",
        "at step 1 'action' has 1 number, and 2 in most rows",
        "step 2 has frame_index 3; wanted 2",
    ]) {
        assert!(fault.contains(wanted) && fault.contains("file-000.parquet"), "{fault}");
    }
    assert_says(&source.set().unwrap_err(), &["episode 1: at step 2", "--skip-bad", "--without 1,2,3"]);
    let skip = Choice { skip_bad: true, ..Choice::default() };
    let chosen = open::open_chosen(&path, None, &Columns::default(), &skip).unwrap();
    assert_eq!((chosen.left_out.len(), chosen.set().unwrap().len()), (3, 2));
    let read = chosen.episodes[1].actions.row(3)[1];
    assert!((read - (4.0_f32 + 0.3 + 1.0).cos() / 2.0).abs() < 1e-6, "{read}");
}

/// h5py follows them, and the reader that is used here does not.
#[test]
fn links_of_hdf5_are_told_from_damage() {
    for name in ["link_column.hdf5", "link_episode.hdf5"] {
        let error = read(&fixture(name)).unwrap_err();
        assert_says(&error, &["soft link, which is not followed", name, "expand_soft=True"]);
        assert!(!error.to_string().contains("damaged"), "{error}");
    }
    // External links make h5py write a group that seems to hold nothing.
    let scratch = Scratch::new("links");
    let path = scratch.0.join("external.hdf5");
    let mut file = hdf5_pure::FileBuilder::new();
    let data = file.create_group("data");
    file.add_group(data.finish());
    file.write(&path).unwrap();
    let wanted = &["'data' holds no episode", "links are not followed", "expand_external=True"];
    assert_says(&read(&path).unwrap_err(), wanted);
}

#[test]
fn npz_of_other_byte_orders_and_column_by_column_holds_the_same() {
    let plain = read(&fixture("orders.npz")).unwrap();
    for name in ["obs_big", "obs_columns", "obs_both"] {
        let columns = Columns { observations: vec![name.to_owned()], actions: Vec::new() };
        let other = open::open(&fixture("orders.npz"), None, &columns).unwrap();
        assert_eq!(other.episodes, plain.episodes, "{name}");
    }
}

/// In each place where a data set describes itself.
#[test]
fn what_describes_a_set_is_named_in_plain_words() {
    let scratch = Scratch::new("described");
    let with = |set: &str, file: &str, change: &dyn Fn(String) -> String| {
        let path = scratch.copy(set);
        let text = fs::read_to_string(path.join(file)).unwrap();
        fs::write(path.join(file), change(text)).unwrap();
        read(&path)
    };
    let info = "meta/info.json";
    let pointer = |_: String| "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n".to_owned();
    for (set, file) in [
        ("lerobot_v3", info),
        ("minari_hdf5", "data/metadata.json"),
        ("minari_parquet", "data/metadata.json"),
    ] {
        assert_says(&with(set, file, &pointer).unwrap_err(), &["pointer of git lfs", "git lfs pull", file]);
        let marked = with(set, file, &|text| format!("\u{feff}{text}"));
        assert!(marked.is_ok() || set != "lerobot_v3", "{marked:?}");
    }
    let fps = |value: &'static str| {
        move |text: String| {
            let (before, rest) = text.split_once("\"fps\":").unwrap();
            format!("{before}\"fps\": {value}{}", &rest[rest.find([',', '}']).unwrap()..])
        }
    };
    for (value, said) in [("\"30\"", "expected a number"), ("1e400", "number out of range"), ("[30]", "list")]
    {
        let error = with("lerobot_v3", info, &fps(value)).unwrap_err();
        assert_says(&error, &["does not describe a LeRobot data set", said, info]);
        assert!(!error.to_string().contains("f64") && !error.to_string().contains("sequence"), "{error}");
    }
    for value in ["0", "-5"] {
        let source = with("lerobot_v3", info, &fps(value)).unwrap();
        assert_eq!(source.says.steps_per_sec, None);
        assert!(
            source.not_read[0].contains(&format!("says fps = {value}, which is no rate")),
            "{:?}",
            source.not_read
        );
    }
}

#[test]
fn groups_of_other_names_are_told_how_to_be_named() {
    let root = Scratch::new("names");
    let path = root.0.join("demo.hdf5");
    let mut file = hdf5_pure::FileBuilder::new();
    let mut data = file.create_group("data");
    let demo = data.create_group("demo0");
    data.add_group(demo.finish());
    file.add_group(data.finish());
    file.write(&path).unwrap();
    let error = open::open(&path, Some(Format::Robomimic), &Columns::default()).unwrap_err();
    assert_says(&error, &["wanted groups demo_0, demo_1, …, and there are: demo0", "g.move(name"]);
}

#[test]
fn what_is_not_read_of_hdf5_is_named_with_the_line_that_mends_it() {
    for (name, wanted) in [
        ("blosc.hdf5", "compressed by blosc"),
        ("bitshuffle.hdf5", "compressed by bitshuffle"),
        ("newest.hdf5", "newest layout of HDF5 2.0"),
    ] {
        let error = read(&fixture(name)).unwrap_err();
        assert_says(&error, &[wanted, name, "h5repack", "h5py.File", "attrs.update"]);
        assert!(!error.to_string().contains("damaged"), "{error}");
    }
}

/// h5py and hdf5plugin wrote the same numbers under each name.
#[test]
fn what_zstd_and_lz4_compress_is_what_stands_beside_it_without_a_filter() {
    let observed = |group: &str, name: &str| {
        let columns = Columns { observations: vec![format!("{group}/{name}")], actions: Vec::new() };
        open::open(&fixture("packed.hdf5"), None, &columns).unwrap_or_else(|error| panic!("{name}: {error}"))
    };
    for group in ["observed", "other_end"] {
        let plain = observed(group, "plain");
        assert_eq!(plain.episodes.len(), 3, "where an episode ends is compressed too");
        assert!(plain.episodes[0].observations.flat()[..3].iter().all(|value| *value != 0.0));
        assert_eq!(plain.episodes[2].observations.row(39), [0.25; 3]);
        for name in ["zstd", "shuffled_zstd", "lz4", "lz4_blocks", "checked"] {
            assert_eq!(observed(group, name).episodes, plain.episodes, "{group}/{name}");
        }
    }
    let ones = read(&fixture("zstd.hdf5")).unwrap();
    assert!(
        ones.episodes.iter().all(|episode| episode.observations.flat().iter().all(|value| *value == 1.0))
    );
}

#[test]
fn damage_under_a_filter_is_told() {
    let scratch = Scratch::new("packed");
    let bytes = fs::read(fixture("packed.hdf5")).unwrap();
    let path = scratch.0.join("packed.hdf5");
    let columns = Columns { observations: vec!["observed/shuffled_zstd".to_owned()], actions: Vec::new() };
    for place in (0..bytes.len()).step_by(bytes.len() / 300) {
        let mut damaged = bytes.clone();
        damaged[place] ^= 0x55;
        fs::write(&path, &damaged).unwrap();
        check(open::open(&path, None, &columns), &format!("byte {place}"));
        fs::write(&path, &bytes[..place]).unwrap();
        check(open::open(&path, None, &columns), &format!("cut at {place}"));
    }
}

#[test]
fn a_pointer_of_git_lfs_is_told_from_damage_by_every_reader() {
    let scratch = Scratch::new("pointer");
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";
    for (name, format, ..) in FIXTURES {
        let path = scratch.copy(name);
        for file in open::files(&path, Some(format)).unwrap() {
            let whole = fs::read(&file).unwrap();
            fs::write(&file, pointer).unwrap();
            let found = read(&path).and_then(|source| source.set().map(|_| source));
            assert_says(&found.unwrap_err(), &["pointer of git lfs"]);
            fs::write(&file, whole).unwrap();
        }
    }
}

#[test]
fn a_robomimic_file_tells_its_environment_and_the_states_of_its_episodes() {
    let path = fixture("robomimic.hdf5");
    let named = robomimic::environment(&path, &[]).unwrap();
    assert!(named.arguments.contains(r#""env_name": "Fixture""#) && named.longest == 5, "{named:?}");
    let observed = |key: &str, part| robomimic::Observed { key: key.to_owned(), part };
    assert_eq!(named.observed, [observed("joint", None), observed("wrist", None)]);
    let columns = ["wrist[0:1]", "obs/joint"].map(str::to_owned);
    let named = robomimic::environment(&path, &columns).unwrap();
    assert_eq!(named.observed, [observed("wrist", Some((0, Some(1)))), observed("joint", None)]);
    let error = robomimic::environment(&path, &["states".to_owned()]).unwrap_err();
    assert_says(&error, &["'states' is none of the observations", "obs/<name>", "robomimic.hdf5"]);
    let error = robomimic::environment(&fixture("minari_hdf5/data/main_data.hdf5"), &[]).unwrap_err();
    assert_says(&error, &["names no environment", "no group 'data'"]);

    let mut source = read(&path).unwrap();
    source.ids.remove(0);
    let states = robomimic::read_states(&path, &source, 1).unwrap();
    let lengths: Vec<usize> =
        states.iter().map(|one| one.as_ref().map_or(0, |one| one.states.len())).collect();
    assert_eq!(lengths, [0, 3, 0], "the first of those that are meant");
    let second = states[1].as_ref().unwrap();
    assert_eq!((second.model.as_deref(), second.states[0].len()), (Some("<mujoco/>"), 4));
    let shortened: Vec<f32> = second.actions.iter().flatten().map(|number| *number as f32).collect();
    assert_eq!(shortened, source.episodes[1].actions.flat());
}

#[test]
fn names_of_robomimic_without_their_group_are_its_columns() {
    let short = columns(&["wrist[1]", "joint"], &[]);
    let source = open::open(&fixture("robomimic.hdf5"), None, &short).unwrap();
    assert_eq!(source.columns.observations, ["obs/wrist[1]", "obs/joint"]);
    assert_close(source.episodes[1].observations.row(2)[0], observation(1, 2, 2));
    let last = source.episodes[1].last_observation.as_deref().unwrap();
    assert_close(last[0], observation(1, 3, 2));
    assert!(source.not_read[0].contains("obs/camera_image (an image)"), "{:?}", source.not_read);
}

#[test]
fn sets_of_other_tools_that_are_not_read_are_named_with_the_way_out() {
    let scratch = Scratch::new("others");
    let file = |name: &str, text: &str| {
        let path = scratch.0.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
        path.parent().unwrap().to_owned()
    };
    let arrow = file("arrow/metadata.json", r#"{"data_format": "arrow", "total_episodes": 1}"#);
    assert_says(&read(&arrow).unwrap_err(), &["stored as Arrow files", "hdf5"]);
    let missing = file("missing/metadata.json", r#"{"data_format": "hdf5", "total_episodes": 1}"#);
    assert_says(&read(&missing).unwrap_err(), &["main_data.hdf5", "missing", "whole folder"]);
    let hugging = file("hugging/dataset_info.json", "{}");
    assert_says(&read(&hugging).unwrap_err(), &["`datasets` package", "serialize.load"]);
    assert_says(&read(&file("zarr/.zgroup", "{}")).unwrap_err(), &["zarr", "docs/formats.md"]);
    let error = read(&fixture("aloha/episode_0.hdf5")).unwrap_err();
    assert_says(&error, &["one episode", "the folder of all"]);
}

#[track_caller]
fn assert_says(error: &Error, wanted: &[&str]) {
    assert!(error.is_bad_input(), "{error}");
    let message = format!("{error} / {}", error.hint().unwrap_or_default());
    for part in wanted {
        assert!(message.contains(part), "'{message}' does not say '{part}'");
    }
}

#[test]
fn what_is_none_is_said_to_be_none() {
    let scratch = Scratch::new("none");
    let file = |name: &str, bytes: &[u8]| {
        let path = scratch.0.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, bytes).unwrap();
        path
    };
    let random: Vec<u8> =
        (0..5000_u32).map(|index| (index.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    for (path, wanted) in [
        (scratch.0.join("absent"), &["does not exist", "absent"][..]),
        (file("empty", b""), &["empty", "copied"]),
        (file("random", &random), &["not an HDF5 file", "npz"]),
        (file("words.csv", b"step,action\n"), &["not an HDF5 file"]),
        (file("cut.npz", b"PK\x03\x04"), &["npz", "damaged or truncated"]),
        (
            fixture("lerobot_v3/data/chunk-000/file-000.parquet"),
            &["one parquet file", "the folder of the whole set"],
        ),
        (fixture("lerobot_v3/data"), &["no demonstrations.hdf5", "meta/info.json"]),
    ] {
        assert_says(&read(&path).unwrap_err(), wanted);
    }
    for (text, wanted) in [
        ("", &["does not describe", "info.json"][..]),
        ("{\"codebase_version\": \"v1.6\"}", &["'v1.6'", "v3.0, v2.1 or v2.0"]),
        ("{\"codebase_version\": \"v3.0\"}", &["no folder 'data'"]),
    ] {
        file("lerobot/meta/info.json", text.as_bytes());
        assert_says(&read(&scratch.0.join("lerobot")).unwrap_err(), wanted);
    }
}

#[test]
fn a_data_set_that_lacks_files_is_not_taken_for_a_smaller_one() {
    let scratch = Scratch::new("lacks");
    let path = scratch.copy("lerobot_v2");
    fs::remove_file(path.join("data/chunk-000/episode_000002.parquet")).unwrap();
    assert_says(&read(&path).unwrap_err(), &["says 3 episodes, and the tables hold 2", "whole folder"]);
    let path = scratch.copy("minari_parquet");
    fs::remove_file(path.join("data/1/part-0.parquet")).unwrap();
    assert_says(&read(&path).unwrap_err(), &["no parquet file", "data/1"]);
    fs::remove_dir_all(path.join("data/2")).unwrap();
    fs::remove_dir_all(path.join("data/1")).unwrap();
    assert_says(&read(&path).unwrap_err(), &["says 3 episodes, and the data set holds 1", "whole folder"]);
    let path = scratch.copy("minari_hdf5");
    let file = path.join("data/metadata.json");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, text.replace("\"total_steps\": 12", "\"total_steps\": 13")).unwrap();
    assert_says(&read(&path).unwrap_err(), &["says 13 steps, and the data set holds 12"]);
}

/// A robomimic file of one step whose next observations have this shape.
fn robomimic_with_next(path: &Path, next: &[f64], shape: &[u64]) {
    let mut file = hdf5_pure::FileBuilder::new();
    let mut data = file.create_group("data");
    for name in ["demo_0", "demo_1"] {
        let mut demo = data.create_group(name);
        demo.create_dataset("actions").with_f64_data(&[0.5]).with_shape(&[1, 1]);
        for (group, values, shape) in [("obs", &[1.0, 2.0][..], &[1, 2][..]), ("next_obs", next, shape)] {
            let mut group = demo.create_group(group);
            group.create_dataset("arm").with_f64_data(values).with_shape(shape);
            demo.add_group(group.finish());
        }
        data.add_group(demo.finish());
    }
    file.add_group(data.finish());
    file.write(path).unwrap();
}

#[test]
fn next_observations_that_are_none_are_refused() {
    let scratch = Scratch::new("next");
    let path = scratch.0.join("next.hdf5");
    robomimic_with_next(&path, &[1.0, 2.0, 3.0], &[1, 3]);
    assert_says(&read(&path).unwrap_err(), &["'next_obs/arm' has shape [1, 3]", "'obs/arm' [1, 2]"]);
    robomimic_with_next(&path, &[1.0, f64::NAN], &[1, 2]);
    let episodes = read(&path).unwrap().episodes;
    let error = minari::write(&scratch.0.join("out"), &episodes, "demosift/test-v0", None).unwrap_err();
    assert_says(&error, &["final observation of episode demo_0", "finite"]);
    robomimic_with_next(&path, &[3.0, 4.0], &[1, 2]);
    assert_eq!(read(&path).unwrap().episodes[0].last_observation, Some(vec![3.0, 4.0]));
}

#[test]
fn a_table_without_rows_is_not_believed_its_width() {
    let scratch = Scratch::new("wide");
    let path = scratch.0.join("wide.hdf5");
    let mut file = hdf5_pure::FileBuilder::new();
    for name in ["observations", "actions"] {
        file.create_dataset(name).with_f32_data(&[]).with_shape(&[0, 1 << 50]);
    }
    file.create_dataset("timeouts").with_u8_data(&[]).with_shape(&[0]);
    file.write(&path).unwrap();
    assert_says(&read(&path).unwrap_err(), &["[0, 1125899906842624]", "more than a recording"]);
}

/// Each file that a fixture consists of, cut short and with bytes turned over: an error or harmless, never a panic.
#[test]
fn damage_anywhere_is_an_error_or_harmless_but_never_a_panic() {
    let scratch = Scratch::new("damage");
    for (name, format, ..) in FIXTURES {
        let path = scratch.copy(name);
        for file in open::files(&path, Some(format)).unwrap() {
            let whole = fs::read(&file).unwrap();
            for len in (0..whole.len()).step_by(whole.len() / 40 + 1) {
                fs::write(&file, &whole[..len]).unwrap();
                check(open::open(&path, Some(format), &Columns::default()), &format!("{name} cut at {len}"));
                check(read(&path), &format!("{name} cut at {len}"));
            }
            for (at, flip) in
                (0..whole.len()).step_by(whole.len() / 900 + 1).zip([0xff, 0x01, 0x80, 0x10].iter().cycle())
            {
                let mut bytes = whole.clone();
                bytes[at] ^= flip;
                fs::write(&file, &bytes).unwrap();
                check(
                    open::open(&path, Some(format), &Columns::default()),
                    &format!("{name} turned over at {at}"),
                );
            }
            fs::write(&file, &whole).unwrap();
        }
    }
    // Where Linux tells, nothing asked for more memory than all these files together could need.
    if let Ok(status) = fs::read_to_string("/proc/self/status") {
        let most = status
            .lines()
            .find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse().ok());
        assert!(most.is_some_and(|kilobytes: u64| kilobytes < 400_000), "{most:?} kB were in use");
    }
}

#[track_caller]
fn check(found: demosift::Result<Source>, what: &str) {
    match found {
        Ok(source) => drop(source.set()),
        Err(error) => assert!(error.is_bad_input() && error.to_string().contains(": /"), "{what}: {error}"),
    }
}

#[test]
fn what_is_written_is_read_again() {
    let scratch = Scratch::new("written");
    let original = read(&fixture("minari_hdf5")).unwrap();
    let states: Vec<StateLog> = LENGTHS
        .iter()
        .map(|&len| StateLog { qpos: (0..2 * len).map(|at| at as f64 / 3.0).collect(), qvel: vec![0.1; len] })
        .collect();

    let path = scratch.0.join("lerobot");
    let described =
        lerobot::Described { steps_per_sec: 50, tasks: vec!["reach".to_owned()], ..Default::default() };
    lerobot::write(&path, &original.episodes, Some(&states), &described).unwrap();
    let again = read(&path).unwrap();
    assert_eq!(again.format, Format::LeRobotV3);
    assert_eq!(again.set().unwrap(), original.set().unwrap());
    assert_eq!(demonstration::open::read_states(&path, None).unwrap().unwrap(), states, "in full precision");

    let path = scratch.0.join("minari");
    minari::write(&path, &original.episodes, "demosift/test-v0", None).unwrap();
    assert_eq!(read(&path).unwrap(), original, "final observations too");
    let error = minari::write(&path, &original.episodes, "demosift/test-v0", None).unwrap_err();
    assert_says(&error, &["already", "new folder"]);

    // Without a final observation the last action has no successor, so Minari cannot hold it.
    let path = scratch.0.join("shorter");
    minari::write(&path, &again.episodes, "demosift/test-v0", None).unwrap();
    for (shorter, episode) in read(&path).unwrap().episodes.iter().zip(&again.episodes) {
        let steps = episode.actions.len() - 1;
        assert_eq!(shorter.actions, episode.actions.head(steps));
        assert_eq!(shorter.observations, episode.observations.head(steps));
        assert_eq!(shorter.last_observation.as_deref(), Some(episode.observations.row(steps)));
    }
}

/// What stands in for a video, as nobody looks into them.
fn film(camera: &str, episode: usize) -> Vec<u8> {
    format!("not really a film: {camera}, episode {episode}").into_bytes()
}

/// The set of `formats/` that LeRobot wrote, as one of version 2.1 with two cameras.
fn with_cameras(scratch: &Scratch) -> PathBuf {
    let path = scratch.copy("lerobot_v2");
    let info = path.join("meta/info.json");
    let mut described: serde_json::Value = serde_json::from_slice(&fs::read(&info).unwrap()).unwrap();
    for camera in ["observation.images.top", "observation.images.wrist"] {
        described["features"][camera] = serde_json::json!({ "dtype": "video", "shape": [4, 6, 3], "names": ["height", "width", "channels"] });
        for episode in 0..LENGTHS.len() {
            let file = path.join(format!("videos/chunk-000/{camera}/episode_{episode:06}.mp4"));
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, film(camera, episode)).unwrap();
        }
    }
    fs::write(info, described.to_string()).unwrap();
    path
}

#[test]
fn videos_go_with_the_episodes_that_are_written() {
    let scratch = Scratch::new("videos");
    let path = with_cameras(&scratch);
    let source = read(&path).unwrap();
    let all = lerobot::description(&path, &source).unwrap();
    assert!(all.videos.missing.is_empty(), "{:?}", all.videos.missing);
    let rate = f64::from(all.steps_per_sec);

    // The first and the last; and of these, which are of version 3.0 now, the last.
    let kept: Vec<_> = [0, 2].map(|place: usize| source.episodes[place].clone()).to_vec();
    let first = scratch.0.join("first");
    let described = lerobot::Described { videos: all.videos.of(&[0, 2]), ..all.clone() };
    lerobot::write(&first, &kept, None, &described).unwrap();
    let again = read(&first).unwrap();
    let found = lerobot::description(&first, &again).unwrap();
    assert!(found.videos.missing.is_empty(), "{:?}", found.videos.missing);
    let second = scratch.0.join("second");
    let described = lerobot::Described { videos: found.videos.of(&[1]), ..found.clone() };
    lerobot::write(&second, &again.episodes[1..], None, &described).unwrap();
    for camera in ["observation.images.top", "observation.images.wrist"] {
        for (path, episodes) in [(&first, &[0, 2][..]), (&second, &[2])] {
            let folder = path.join(format!("videos/{camera}/chunk-000"));
            let mut files: Vec<_> =
                fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
            files.sort();
            let films: Vec<_> = files.iter().map(|file| fs::read(file).unwrap()).collect();
            assert_eq!(films, episodes.iter().map(|&episode| film(camera, episode)).collect::<Vec<_>>());
        }
    }
    let info: serde_json::Value =
        serde_json::from_slice(&fs::read(second.join("meta/info.json")).unwrap()).unwrap();
    let feature = &info["features"]["observation.images.top"];
    assert_eq!((&feature["dtype"], &feature["shape"]), (&"video".into(), &vec![4, 6, 3].into()));
    assert_eq!(info["video_path"], "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4");
    assert_eq!(format!("{:?}", found.videos).matches(&format!("to_secs: {:?}", 5.0 / rate)).count(), 2);

    // One that is not there is named, and the other camera is passed on.
    fs::remove_file(path.join("videos/chunk-000/observation.images.top/episode_000001.mp4")).unwrap();
    let fewer = lerobot::description(&path, &source).unwrap().videos;
    let [missing] = &fewer.missing[..] else { panic!("{:?}", fewer.missing) };
    assert!(
        missing.contains("images.top") && missing.contains("episode_000001.mp4 is not there"),
        "{missing}"
    );
    assert_eq!(fewer.cameras.len(), 1);
    let wrong = lerobot::Described { videos: all.videos.of(&[0]), ..all };
    let error = lerobot::write(&scratch.0.join("wrong"), &kept, None, &wrong).unwrap_err();
    assert_says(&error, &["1 videos of observation.images.top", "each of the 2 episodes"]);
}

/// A name that leads elsewhere is no column of a data set.
#[test]
fn no_video_is_written_outside_of_the_folder() {
    let scratch = Scratch::new("videos-outside");
    let path = scratch.copy("lerobot_v2");
    let info = path.join("meta/info.json");
    let mut described: serde_json::Value = serde_json::from_slice(&fs::read(&info).unwrap()).unwrap();
    described["features"]["../../outside"] = serde_json::json!({ "dtype": "video", "shape": [1, 1, 3] });
    fs::write(info, described.to_string()).unwrap();
    let source = read(&path).unwrap();
    let found = lerobot::description(&path, &source).unwrap().videos;
    assert!(
        found.cameras.is_empty() && found.missing[0].contains("no name of a folder"),
        "{:?}",
        found.missing
    );
}

#[test]
fn a_filter_key_is_all_that_changes_in_a_robomimic_file() {
    let scratch = Scratch::new("key");
    let path = scratch.copy("robomimic.hdf5");
    let before = read(&path).unwrap();
    let hash = open::sha256(&before, &path).unwrap();
    let labels = ["demo_0".to_owned(), "demo_2".to_owned()];
    robomimic::add_filter_key(&path, "demosift", &labels).unwrap();
    robomimic::add_filter_key(&path, "second", &labels[1..]).unwrap();
    let after = read(&path).unwrap();
    assert_eq!(after, before);
    assert_eq!(open::sha256(&after, &path).unwrap(), hash, "a run on this file can go on");
    let file = hdf5_pure::File::open(&path).unwrap();
    assert_eq!(file.dataset("mask/demosift").unwrap().read_string().unwrap(), labels);
    assert_eq!(file.dataset("mask/second").unwrap().read_string().unwrap(), labels[1..]);
    let once_more = robomimic::add_filter_key(&path, "demosift", &labels).unwrap_err();
    assert_says(&once_more, &["'demosift' already", "another name", "robomimic.hdf5"]);
    assert_says(&robomimic::add_filter_key(&path, "a/b", &labels).unwrap_err(), &["'a/b'", "without '/'"]);
}

#[test]
fn a_minari_subset_holds_all_that_the_original_does() {
    let scratch = Scratch::new("subset");
    let path = scratch.0.join("subset");
    let original = fixture("minari_hdf5/data/main_data.hdf5");
    minari::write_subset(&path, &original, &["0".to_owned(), "2".to_owned()], "demosift/test-v0").unwrap();
    let (whole, subset) = (read(&original).unwrap(), read(&path).unwrap());
    for (place, kept) in [0, 2].into_iter().enumerate() {
        assert_eq!(subset.episodes[place].label, place.to_string());
        assert_eq!(subset.episodes[place].actions, whole.episodes[kept].actions);
    }
    let file = hdf5_pure::File::open(path.join("data/main_data.hdf5")).unwrap();
    assert_eq!(file.dataset("episode_1/rewards").unwrap().read_f64().unwrap(), vec![2.0; 5]);
    let error =
        minari::write_subset(&scratch.0.join("none"), &original, &["7".to_owned()], "x-v0").unwrap_err();
    assert!(error.is_bad_input(), "{error}");
    assert_eq!(fs::read_dir(&scratch.0).unwrap().count(), 1, "nothing is left of what failed");
}

#[test]
fn a_minari_subset_of_a_file_alone_describes_itself() {
    let scratch = Scratch::new("alone");
    let alone = scratch.0.join("main_data.hdf5");
    fs::copy(fixture("minari_hdf5/data/main_data.hdf5"), &alone).unwrap();
    let (path, labels) = (scratch.0.join("subset"), ["1".to_owned()]);
    minari::write_subset(&path, &alone, &labels, "demosift/test-v0").unwrap();
    let metadata = |folder: &Path| -> serde_json::Value {
        serde_json::from_slice(&fs::read(folder.join("data/metadata.json")).unwrap()).unwrap()
    };
    let (ours, minaris) = (metadata(&path), metadata(&fixture("minari_hdf5")));
    assert_eq!((&ours["total_episodes"], &ours["total_steps"]), (&1.into(), &3.into()));
    for key in ["data_format", "observation_space", "action_space"] {
        assert_eq!(ours[key], minaris[key], "as Minari itself describes the same tables");
    }
    assert_eq!(read(&path).unwrap().episodes[0].actions, read(&alone).unwrap().episodes[1].actions);
}

#[test]
fn what_points_into_its_own_file_is_not_copied_to_another() {
    use hdf5_pure::{CompoundTypeBuilder, FileBuilder};

    let scratch = Scratch::new("points");
    let write = |name: &str, kind: hdf5_pure::Datatype, bytes: usize| {
        let path = scratch.0.join(name);
        let mut file = FileBuilder::new();
        let mut episode = file.create_group("episode_0");
        episode.create_dataset("observations").with_f32_data(&[0.0; 4]).with_shape(&[2, 2]);
        episode.create_dataset("actions").with_f32_data(&[0.5]).with_shape(&[1, 1]);
        episode.create_dataset("log").with_raw_data(kind, vec![0; bytes], 1);
        file.add_group(episode.finish());
        file.write(&path).unwrap();
        path
    };
    let labels = ["0".to_owned()];
    let numbers = CompoundTypeBuilder::new().f64_field("force").i32_field("contacts").build().unwrap();
    let (path, copy) = (write("numbers.hdf5", numbers, 12), scratch.0.join("numbers"));
    minari::write_subset(&copy, &path, &labels, "demosift/test-v0").unwrap();
    let copied = hdf5_pure::File::open(copy.join("data/main_data.hdf5")).unwrap();
    assert_eq!(copied.dataset("episode_0/log").unwrap().read_raw().unwrap(), vec![0; 12]);

    let size = 8;
    let reference = || hdf5_pure::Datatype::Reference { size, ref_type: hdf5_pure::ReferenceType::Object };
    let pair = CompoundTypeBuilder::new().f64_field("force").field("of", reference()).build().unwrap();
    for (name, kind, bytes) in [("plain", reference(), 8), ("nested", pair, 16)] {
        let path = write(&format!("{name}.hdf5"), kind, bytes);
        let refused = scratch.0.join(name);
        let error = minari::write_subset(&refused, &path, &labels, "demosift/test-v0").unwrap_err();
        assert_says(&error, &["'log'", "object_ref", "cannot be copied", name]);
        assert!(!refused.exists(), "nothing is left of what failed");
    }
}
