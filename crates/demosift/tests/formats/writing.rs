//! What is written is read again, and holds all that the original does.

use std::fs;
use std::path::{Path, PathBuf};

use demosift::data::demonstration::episode::Format;
use demosift::data::demonstration::{self, lerobot, minari, open, robomimic};
use demosift::data::trajectory::StateLog;
use demosift::math::rows::Rows;

use super::{LENGTHS, Scratch, assert_says, fixture, read};

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

/// LeRobot takes a shape of [1] for a plain column, and its reader fails on a list there.
#[test]
fn one_number_a_step_is_written_to_lerobot_as_a_plain_column() {
    let scratch = Scratch::new("one-number");
    let mut original = read(&fixture("minari_hdf5")).unwrap();
    let first = |rows: &Rows| Rows::from_flat(rows.iter().map(|row| row[0]).collect(), 1).unwrap();
    for episode in &mut original.episodes {
        episode.observations = first(&episode.observations);
        episode.actions = first(&episode.actions);
        episode.last_observation = None;
    }
    let states: Vec<StateLog> = LENGTHS
        .iter()
        .map(|&len| StateLog { qpos: (0..len).map(|at| at as f64 / 3.0).collect(), qvel: vec![0.1; 2 * len] })
        .collect();
    let path = scratch.0.join("lerobot");
    let described = lerobot::Described { steps_per_sec: 50, ..Default::default() };
    lerobot::write(&path, &original.episodes, Some(&states), &described).unwrap();
    let again = read(&path).unwrap();
    let columns = open::columns(&path, &again).unwrap();
    let kind = |name: &str| columns.iter().find(|column| column.name == name).unwrap().kind.as_str();
    assert_eq!(
        ["observation.state", "action", "simulator.qpos", "simulator.qvel", "timestamp"].map(kind),
        ["f32", "f32", "f64", "list of f64", "f32"]
    );
    assert_eq!(again.set().unwrap(), original.set().unwrap());
    assert_eq!(open::read_states(&path, None).unwrap().unwrap(), states);
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
    let statistics = path.join("meta/episodes_stats.jsonl");
    let lines = fs::read_to_string(&statistics).unwrap();
    let lines = lines.lines().enumerate().map(|(episode, line)| {
        let mut line: serde_json::Value = serde_json::from_str(line).unwrap();
        for camera in ["observation.images.top", "observation.images.wrist"] {
            line["stats"][camera] = brightness(episode);
        }
        format!("{line}\n")
    });
    let lines: String = lines.collect();
    fs::write(statistics, lines).unwrap();
    path
}

/// What LeRobot 0.3 says of an episode whose pictures have one frame of 0.2 and the rest of 0.8, in its shape.
fn brightness(episode: usize) -> serde_json::Value {
    let frames = LENGTHS[episode] as f64;
    let mean = (0.2 + 0.8 * (frames - 1.0)) / frames;
    let std = (((0.2 - mean).powi(2) + (0.8 - mean).powi(2) * (frames - 1.0)) / frames).sqrt();
    let shaped = |number: f64| serde_json::json!([[[number]], [[number]], [[number]]]);
    serde_json::json!({
        "min": shaped(0.2), "max": shaped(0.8), "mean": shaped(mean), "std": shaped(std), "count": [LENGTHS[episode]],
    })
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

    // Of all frames: 3 of 12 are dark. What version 2.1 says of each episode is taken together, and then handed on.
    for folder in [&first, &second] {
        let text = fs::read(folder.join("meta/stats.json")).unwrap();
        let statistics: serde_json::Value = serde_json::from_slice(&text).unwrap();
        let of_camera = &statistics["observation.images.wrist"];
        assert_eq!((&of_camera["count"][0], &of_camera["min"][2][0][0]), (&12.into(), &0.2.into()));
        for (name, wanted) in [("mean", 0.65), ("std", 0.6 * (0.25_f64 * 0.75).sqrt())] {
            let found = of_camera[name][2][0][0].as_f64().unwrap();
            assert!((found - wanted).abs() < 1e-12, "{name} {found}, wanted {wanted}");
        }
    }

    // One that is not there is named, and the other camera is passed on.
    fs::remove_file(path.join("videos/chunk-000/observation.images.top/episode_000001.mp4")).unwrap();
    let fewer = lerobot::description(&path, &source).unwrap().videos;
    let [missing] = &fewer.missing[..] else { panic!("{:?}", fewer.missing) };
    assert!(
        missing.contains("images.top") && missing.contains("episode_000001.mp4 is not there"),
        "{missing}"
    );
    assert_eq!(fewer.cameras.len(), 1);
    fs::remove_file(path.join("meta/episodes_stats.jsonl")).unwrap();
    let without = lerobot::description(&path, &source).unwrap().videos.missing;
    let says =
        |missing: &String| missing.contains("the statistics of observation.images.wrist are not passed on");
    assert!(without.iter().any(says), "{without:?}");
    let wrong = lerobot::Described { videos: all.videos.of(&[0]), ..all };
    let error = lerobot::write(&scratch.0.join("wrong"), &kept, None, &wrong).unwrap_err();
    assert_says(&error, &["1 videos of observation.images.top", "each of the 2 episodes"]);
}

#[test]
fn one_episode_with_two_sentences_takes_no_other_with_it() {
    let scratch = Scratch::new("sentences");
    for (name, list) in
        [("lerobot_v3", "episodes/chunk-000/file-000.parquet"), ("lerobot_v2", "episodes.jsonl")]
    {
        let path = scratch.copy(name);
        let list = path.join("meta").join(list);
        let source = read(&path).unwrap();
        let all = lerobot::description(&path, &source).unwrap();
        assert_eq!(
            (&all.tasks[..], &all.untold[..]),
            (&["reach", "reach", "reach"].map(str::to_owned)[..], &[][..])
        );
        if name == "lerobot_v3" {
            fs::copy(fixture("lerobot_sentences.parquet"), &list).unwrap();
        } else {
            let line = |(episode, tasks): (usize, &str)| {
                format!(
                    "{{\"episode_index\": {episode}, \"tasks\": {tasks}, \"length\": {}}}\n",
                    LENGTHS[episode]
                )
            };
            let lines = ["[\"reach\"]", "[\"grasp\", \"lift\"]", "[]"].into_iter().enumerate().map(line);
            fs::write(&list, lines.collect::<String>()).unwrap();
        }
        let found = lerobot::description(&path, &source).unwrap();
        assert_eq!(found.tasks, ["reach", "grasp", ""], "{name}");
        let [untold] = &found.untold[..] else { panic!("{:?}", found.untold) };
        assert!(
            untold.contains("1 episode without a sentence") && untold.contains("such as episode 2"),
            "{untold}"
        );

        // A list that cannot be read is told.
        fs::write(&list, "{\"episode_index\": 0, \"tasks\"").unwrap();
        let found = lerobot::description(&path, &source).unwrap();
        assert_eq!(found.tasks.len(), 0, "{name}");
        let [untold] = &found.untold[..] else { panic!("{:?}", found.untold) };
        assert!(untold.contains("meta/episodes") && untold.contains("cannot be read"), "{untold}");
    }
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

/// Half floats, other orders of bytes, bytes without a meaning and truth are copied as they are; what cannot be is told.
#[test]
fn a_minari_subset_holds_infos_of_every_plain_kind() {
    let scratch = Scratch::new("infos");
    let (original, path) = (fixture("minari_infos.hdf5"), scratch.0.join("subset"));
    let labels = ["1".to_owned(), "2".to_owned()];
    let changed = minari::write_subset(&path, &original, &labels, "demosift/test-v0").unwrap();
    let (whole, subset) =
        [original, path.join("data/main_data.hdf5")].map(|file| hdf5_pure::File::open(file).unwrap()).into();
    for (from, to) in [(1, 0), (2, 1)] {
        for name in ["infos/half", "infos/big", "infos/flags", "infos/raw", "infos/once"] {
            let [from, to] = [(&whole, from), (&subset, to)]
                .map(|(file, episode)| file.dataset(&format!("episode_{episode}/{name}")).unwrap());
            assert_eq!(to.datatype().unwrap(), from.datatype().unwrap(), "{name}");
            assert_eq!(to.read_raw().unwrap(), from.read_raw().unwrap(), "{name}");
            assert_eq!(to.shape().unwrap(), from.shape().unwrap(), "{name}");
        }
        let episode = subset.group(&format!("episode_{to}")).unwrap();
        assert_eq!(
            episode.group("infos").unwrap().datasets().unwrap().len(),
            5,
            "nothing is left out but what is nothing"
        );
        let of_table = episode.dataset("infos/half").unwrap().attrs().unwrap();
        assert_eq!(of_table["unit"].as_str(), Some("m"));
        let attributes = episode.attrs().unwrap();
        assert_eq!(attributes["id"], hdf5_pure::AttrValue::I64(to));
        assert_eq!(attributes["seed"].as_i64(), Some(7 + from));
        assert_eq!(attributes["success"].as_i64(), Some(i64::from(from == 2)));
    }
    assert_eq!(
        changed.iter().map(|words| words.split(',').next().unwrap()).collect::<Vec<_>>(),
        [
            "'infos/nothing' holds no value and is left out",
            "the attribute 'half' is of a kind that cannot be copied and is left out",
            "the attribute 'success' is written as its number",
        ]
    );
    assert!(changed.iter().all(|words| words.ends_with(", in 2 episodes")), "{changed:?}");
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
