//! What results look like as JSON, as JSON Schema of the draft 2020-12, made from the types that are written.

use schemars::generate::SchemaSettings;
use schemars::transform::transform_subschemas;
use schemars::{JsonSchema, Schema};
use serde_json::{Value, json};

use super::CurveFile;
use crate::data::likeness::TrainedOn;
use crate::results::data_only::DataOnly;
use crate::results::panel::Panel;
use crate::results::uncertainty::Uncertainty;
use crate::stages::judge::ScoreTable;
use crate::stages::method::Spent;
use crate::stages::referee::{ByTrainer, Verdict};
use crate::stages::select::{Ranking, Subset};
use crate::stages::subset_selection::Weighing;

/// A sealed file that says its format version, such as every result of the library.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "only its schema is used")]
struct Stored<T> {
    /// Of the whole file, with zeros in the place of these digits.
    sha256: String,
    /// Of the format.
    version: u32,
    #[serde(flatten)]
    content: T,
}

/// A sealed file without one: the command writes such files, and `run.json` says the version for all.
#[derive(JsonSchema)]
#[allow(dead_code, reason = "only its schema is used")]
struct Sealed<T> {
    /// Of the whole file, with zeros in the place of these digits.
    sha256: String,
    #[serde(flatten)]
    content: T,
}

/// The schema of each file of results, by its name without what tells several of a kind apart.
pub fn of_results() -> Vec<(&'static str, Schema)> {
    vec![
        ("data_only", of::<Stored<DataOnly>>("data_only.json")),
        ("learning_curve", of::<Stored<CurveFile>>("learning_curve_PART.json")),
        ("panel", of::<Stored<Panel>>("panel.json")),
        ("ranking", of::<Stored<Ranking>>("ranking.json")),
        ("scores", without_nulls(of::<Stored<ScoreTable>>("scores_JUDGE.json"))),
        ("spent", of::<Stored<Spent>>("spent_STAGE.json")),
        ("subset", of::<Stored<Subset>>("subset.json")),
        ("trained_on", of::<Stored<TrainedOn>>("trained_on.json")),
        ("training", of::<Stored<ByTrainer>>("training_PART.json")),
        ("uncertainty", of::<Stored<Uncertainty>>("uncertainty.json")),
        ("verdict", of::<Stored<Verdict>>("verdict.json")),
        ("weights", of::<Stored<Weighing>>("weights.json")),
    ]
}

/// The schema of a sealed file of the command.
pub fn of_sealed<T: JsonSchema>(title: &str) -> Schema {
    of::<Sealed<T>>(title)
}

/// The schema of what is written of a type.
pub fn of<T: JsonSchema>(title: &str) -> Schema {
    let settings = SchemaSettings::draft2020_12().for_serialize().with_transform(not_a_number_is_null);
    let mut schema = settings.into_generator().into_root_schema_for::<T>();
    schema.insert("title".to_owned(), title.into());
    schema
}

/// JSON has no infinity and nothing for what is not a number; `null` is written in their place.
fn not_a_number_is_null(schema: &mut Schema) {
    if schema.get("type").is_some_and(|kind| kind == "number") {
        schema.insert("type".to_owned(), json!(["number", "null"]));
    }
    transform_subschemas(&mut not_a_number_is_null, schema);
}

/// What may be `null` may be missing too.
fn without_nulls(mut schema: Schema) -> Schema {
    optional_where_null(&mut schema);
    schema
}

fn optional_where_null(schema: &mut Schema) {
    let properties = schema.get("properties").cloned().unwrap_or_default();
    if let Some(required) = schema.get_mut("required").and_then(Value::as_array_mut) {
        required.retain(|name| name.as_str().is_none_or(|name| !may_be_null(&properties[name])));
    }
    transform_subschemas(&mut optional_where_null, schema);
}

fn may_be_null(schema: &Value) -> bool {
    let is_null = |kind: &Value| kind == "null";
    let in_type =
        is_null(&schema["type"]) || schema["type"].as_array().is_some_and(|all| all.iter().any(is_null));
    in_type || schema["anyOf"].as_array().is_some_and(|all| all.iter().any(may_be_null))
}
