//! What other tools wrote (`make.py`, `docs/formats.md`) is read, whatever it is called and however it is packed.

use std::fs;

use demosift::data::demonstration::episode::{Columns, Format};
use demosift::data::demonstration::listing::Used;
use demosift::data::demonstration::{self, open, robomimic};

use super::{
    FIXTURES, LENGTHS, Scratch, action, assert_close, assert_says, columns, fixture, observation, read,
};

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
fn pictures_and_words_beside_numbers_are_left_out_of_an_observation() {
    let scratch = Scratch::new("pictures");
    let path = scratch.0.join("rgbd.h5");
    let mut file = hdf5_pure::FileBuilder::new();
    for name in ["traj_0", "traj_1"] {
        let mut episode = file.create_group(name);
        episode.create_dataset("actions").with_f32_data(&[0.5; 4]).with_shape(&[2, 2]);
        let mut obs = episode.create_group("obs");
        obs.create_dataset("qpos").with_f32_data(&[0.25; 9]).with_shape(&[3, 3]);
        obs.create_dataset("rgb").with_u8_data(&[7; 36]).with_shape(&[3, 2, 2, 3]);
        episode.add_group(obs.finish());
        file.add_group(episode.finish());
    }
    file.write(&path).unwrap();
    let source = read(&path).unwrap();
    assert_eq!(
        (source.format, source.columns.observations.as_slice()),
        (Format::ManiSkill, &["obs/qpos".to_owned()][..])
    );
    assert!(source.not_read[0].contains("obs/rgb (an image"), "{:?}", source.not_read);
}

#[test]
fn an_observation_of_isaac_lab_may_be_one_table() {
    let scratch = Scratch::new("isaac");
    let path = scratch.0.join("isaac.hdf5");
    let mut file = hdf5_pure::FileBuilder::new();
    let mut data = file.create_group("data");
    for name in ["demo_0", "demo_1"] {
        let mut demo = data.create_group(name);
        demo.create_dataset("actions").with_f32_data(&[0.5; 4]).with_shape(&[2, 2]);
        demo.create_dataset("obs").with_f32_data(&[0.25; 6]).with_shape(&[2, 3]);
        data.add_group(demo.finish());
    }
    file.add_group(data.finish());
    file.write(&path).unwrap();
    let source = read(&path).unwrap();
    assert_eq!(
        (source.format, source.columns.observations.as_slice()),
        (Format::Robomimic, &["obs".to_owned()][..])
    );
    assert_eq!(source.episodes[0].observations.width(), 3);
}
