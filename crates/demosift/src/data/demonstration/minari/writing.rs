//! Writing a Minari data set in HDF5.

use std::path::Path;

use hdf5_pure::{AttrValue, EnumTypeBuilder, FileBuilder};
use serde_json::{Value, json};

use crate::basics::error::{Error, Result};
use crate::basics::files;
use crate::data::demonstration::episode::Episode;
use crate::math::rows::Rows;

/// The version of Minari whose layout this is.
const MINARI_VERSION: &str = "0.5.3";

/// Writes episodes as a Minari data set into a new folder, which appears whole or not at all.
///
/// `name` is its id in Minari, such as `reacher/demosift-v0`.
/// Minari wants an observation after the last action; where an episode has none, its last action is left out and its last
/// observation stands there.
/// Rewards were never read, so they are not a number; every episode counts as truncated at its end.
/// `bounds` says where actions lie, `[act]`; without them it is [−1, 1] where all do, as the tasks here have it.
/// Returns how many actions were written.
///
/// # Errors
/// `is_bad_input` if the folder exists, or an episode has no action left; `is_io` if a file cannot be written.
pub fn write(path: &Path, episodes: &[Episode], name: &str, bounds: Option<&[[f64; 2]]>) -> Result<usize> {
    let mut file = FileBuilder::new();
    let mut total_steps = 0;
    for (index, episode) in episodes.iter().enumerate() {
        let (observations, actions) = complete(episode)?;
        total_steps += actions.len();
        add(&mut file, index, &observations, &actions).map_err(cannot_encode)?;
    }
    if episodes.is_empty() {
        return Err(Error::bad_input("no episode to write; at least 1 is needed"));
    }
    let bytes = file.finish().map_err(cannot_encode)?;
    let mut metadata = json!({
        "total_episodes": episodes.len(),
        "total_steps": total_steps,
        "dataset_id": name,
        "dataset_size": (bytes.len() as f64 / 1e5).round() / 10.0,
        "description": "Written by demosift, which reads no rewards: they are not a number here.",
    });
    for (key, value) in layout(episodes, bounds, "float32") {
        metadata[key] = value;
    }
    let contents =
        [("data/main_data.hdf5", bytes), ("data/metadata.json", format!("{metadata:#}\n").into_bytes())];
    files::write_folder(path, &contents)?;
    Ok(total_steps)
}

/// What the description of a data set says of its layout, where `element` is numpy's name for the numbers in it.
pub(super) fn layout(
    episodes: &[Episode],
    bounds: Option<&[[f64; 2]]>,
    element: &str,
) -> [(&'static str, Value); 4] {
    let (observed, acted) = episodes.first().map_or((0, 0), Episode::sizes);
    let everywhere = |width: usize| vec![[f64::NEG_INFINITY, f64::INFINITY]; width];
    let bounds = bounds.filter(|bounds| bounds.len() == acted).map_or_else(
        || if all_are_inside(episodes) { vec![[-1.0, 1.0]; acted] } else { everywhere(acted) },
        <[_]>::to_vec,
    );
    [
        ("data_format", json!("hdf5")),
        ("observation_space", json!(space(&everywhere(observed), element))),
        ("action_space", json!(space(&bounds, element))),
        ("minari_version", json!(MINARI_VERSION)),
    ]
}

/// T+1 observations and T actions.
fn complete(episode: &Episode) -> Result<(Rows, Rows)> {
    let steps = episode.actions.len();
    let mut observations = episode.observations.clone();
    match &episode.last_observation {
        Some(last) if last.iter().any(|value| !value.is_finite()) => Err(Error::bad_input(format!(
            "the final observation of episode {} is {last:?}; wanted finite numbers",
            episode.label
        ))),
        Some(last) => {
            observations.push(last);
            Ok((observations, episode.actions.clone()))
        }
        None if steps > 1 => Ok((observations, episode.actions.head(steps - 1))),
        None => Err(Error::bad_input(format!(
            "episode {} has {steps} step and no final observation; wanted at least 2 steps",
            episode.label
        ))),
    }
}

fn add(
    file: &mut FileBuilder,
    index: usize,
    observations: &Rows,
    actions: &Rows,
) -> std::result::Result<(), hdf5_pure::Error> {
    let steps = actions.len();
    let mut group = file.create_group(&format!("episode_{index}"));
    for (name, rows) in [("observations", observations), ("actions", actions)] {
        let shape = [rows.len() as u64, rows.width() as u64];
        group.create_dataset(name).with_f32_data(rows.flat()).with_shape(&shape);
    }
    group.create_dataset("rewards").with_f64_data(&vec![f64::NAN; steps]);
    let mut truncations = vec![0; steps];
    truncations[steps - 1] = 1;
    for (name, marks) in [("terminations", vec![0; steps]), ("truncations", truncations)] {
        let boolean = EnumTypeBuilder::u8_based().u8_value("FALSE", 0).u8_value("TRUE", 1).build()?;
        group.create_dataset(name).with_enum_u8_data(boolean, &marks);
    }
    let infos = group.create_group("infos");
    group.add_group(infos.finish());
    group.set_attr("id", AttrValue::I64(index as i64));
    group.set_attr("total_steps", AttrValue::I64(steps as i64));
    file.add_group(group.finish());
    Ok(())
}

/// A box of numbers as Minari writes it: JSON in a string, in which infinity is a bare word.
fn space(bounds: &[[f64; 2]], element: &str) -> String {
    let word = |bound: f64| match bound {
        f64::INFINITY => "Infinity".to_owned(),
        f64::NEG_INFINITY => "-Infinity".to_owned(),
        finite => format!("{finite:?}"),
    };
    let end = |at: usize| bounds.iter().map(|bound| word(bound[at])).collect::<Vec<_>>().join(", ");
    let (low, high, width) = (end(0), end(1), bounds.len());
    format!(
        r#"{{"type": "Box", "dtype": "{element}", "shape": [{width}], "low": [{low}], "high": [{high}]}}"#
    )
}

/// Whether all actions lie in [−1, 1], as the tasks here have it.
fn all_are_inside(episodes: &[Episode]) -> bool {
    let inside = |action: &f32| (-1.0..=1.0).contains(action);
    episodes.iter().all(|episode| episode.actions.flat().iter().all(inside))
}

fn cannot_encode(source: impl std::fmt::Display) -> Error {
    Error::bad_input(format!("the episodes cannot be stored as HDF5: {source}"))
}
