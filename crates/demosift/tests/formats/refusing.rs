//! What is damaged, missing or of another tool is refused in plain words, or costs no more than it must.

use std::fs;
use std::path::Path;

use demosift::data::demonstration::choice::Choice;
use demosift::data::demonstration::episode::{Columns, Format, Source};
use demosift::data::demonstration::{minari, open};

use super::{FIXTURES, Scratch, assert_says, fixture, read};

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
    let table = file("hub/data/train-00000-of-00001.parquet", "PAR1");
    assert_says(&read(table.parent().unwrap()).unwrap_err(), &["as on a hub", "pd.read_parquet", "indices="]);
    let one = scratch.0.join("hub/data/train-00000-of-00001.parquet");
    assert_says(&read(&one).unwrap_err(), &["one parquet file", "pd.read_parquet"]);
    let flat = read(&fixture("flat.npz")).unwrap_err();
    assert_says(&flat, &["it holds: ", "f[\"timeouts\"]", "d[\"terminals\"].astype(bool)"]);
    let error = read(&fixture("starts_of_vectors.npz")).unwrap_err();
    assert_says(&error, &["'episode_starts' is an array of Python objects", "np.ravel(x)[0]"]);
    let error = read(&fixture("aloha/episode_0.hdf5")).unwrap_err();
    assert_says(&error, &["one episode", "the folder of all"]);
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
