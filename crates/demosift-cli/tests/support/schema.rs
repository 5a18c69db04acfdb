//! Holds what the command writes against `docs/schema`, by the words of JSON Schema that stand there; any other word is a failure.

use std::collections::BTreeMap;
use std::sync::Mutex;

use serde_json::{Map, Value};

use super::in_repository;

/// Words that say nothing about what is valid.
const WORDS_FOR_PEOPLE: [&str; 8] =
    ["$schema", "$defs", "title", "description", "default", "format", "examples", "deprecated"];

/// Fails unless the value is as the schema of this name says, below `docs/schema`.
#[track_caller]
pub(crate) fn assert_valid(name: &str, value: &Value) {
    let schema = read(name);
    if let Err(why) = check(&schema, &schema, value, "$") {
        panic!("docs/schema/{name}.json: {why}");
    }
}

/// Fails unless an answer is as the schema of the command says that was typed.
#[track_caller]
pub(crate) fn assert_answer(arguments: &str, answer: &Value) {
    let words: Vec<&str> = arguments.split_whitespace().collect();
    let name = match (words[0], words.get(1)) {
        ("task", Some(second)) => format!("task-{second}"),
        (first, _) => first.to_owned(),
    };
    let has = |field: &str| answer.get(field).is_some();
    let name = match name.as_str() {
        "study" | "reproduce" if has("dry_run") => "study-dry-run",
        _ if has("dry_run") => "dry-run",
        _ if has("part") => "part",
        "judge" if has("prior") => "judge-prior",
        "imitate" if has("demonstrations") => "imitate-named",
        "task-check" if has("environment") => "task-check-env",
        name => name,
    };
    match answer.get("goals").and_then(Value::as_object) {
        Some(goals) => {
            assert_valid("goals", answer);
            goals.values().for_each(|of_goal| assert_valid(name, of_goal));
        }
        None => assert_valid(name, answer),
    }
}

fn read(name: &str) -> Value {
    static READ: Mutex<BTreeMap<String, Value>> = Mutex::new(BTreeMap::new());
    let mut read = READ.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let schema = read.entry(name.to_owned()).or_insert_with(|| {
        let path = in_repository("docs/schema").join(format!("{name}.json"));
        let text = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        serde_json::from_slice(&text).unwrap()
    });
    schema.clone()
}

/// Whether a value is valid; the error says where it is not, and why.
fn check(root: &Value, schema: &Value, value: &Value, place: &str) -> Result<(), String> {
    let Some(schema) = schema.as_object() else {
        return if *schema == Value::Bool(false) { Err(format!("{place} may not be there")) } else { Ok(()) };
    };
    let one = |schema: &Value| check(root, schema, value, place);
    for (word, wanted) in schema {
        let holds = match word.as_str() {
            "$ref" => {
                let pointer = wanted.as_str().and_then(|reference| reference.strip_prefix('#'));
                one(root.pointer(pointer.unwrap()).unwrap_or_else(|| panic!("{wanted} leads nowhere")))?;
                true
            }
            "type" => list(wanted).iter().any(|kind| is_of_type(value, kind.as_str().unwrap())),
            "enum" => list(wanted).contains(value),
            "const" => wanted == value,
            "anyOf" => list(wanted).iter().any(|schema| one(schema).is_ok()),
            "oneOf" => list(wanted).iter().filter(|schema| one(schema).is_ok()).count() == 1,
            "allOf" => {
                list(wanted).iter().try_for_each(one)?;
                true
            }
            "minimum" => value.as_f64().is_none_or(|value| value >= wanted.as_f64().unwrap()),
            "maximum" => value.as_f64().is_none_or(|value| value <= wanted.as_f64().unwrap()),
            "minItems" => value.as_array().is_none_or(|items| items.len() as u64 >= wanted.as_u64().unwrap()),
            "maxItems" => value.as_array().is_none_or(|items| items.len() as u64 <= wanted.as_u64().unwrap()),
            "uniqueItems" => value.as_array().is_none_or(|items| {
                items.iter().enumerate().all(|(place, item)| !items[..place].contains(item))
            }),
            "required" => value.as_object().is_none_or(|object| {
                list(wanted).iter().all(|name| object.contains_key(name.as_str().unwrap()))
            }),
            "properties" | "additionalProperties" | "prefixItems" | "items" => true,
            word if WORDS_FOR_PEOPLE.contains(&word) => true,
            word => panic!("the test does not know {word}, which a schema says"),
        };
        if !holds {
            return Err(format!("{place} breaks {word}: {wanted}\n{value}"));
        }
    }
    check_fields(root, schema, value, place)?;
    check_items(root, schema, value, place)
}

/// A field that the schema does not name is wrong too, unless the schema names none or says what others are.
fn check_fields(root: &Value, schema: &Map<String, Value>, value: &Value, place: &str) -> Result<(), String> {
    let Some(fields) = value.as_object() else { return Ok(()) };
    let (named, others) = (schema.get("properties"), schema.get("additionalProperties"));
    for (name, value) in fields {
        let place = format!("{place}.{name}");
        match (named.and_then(|named| named.get(name)), others) {
            (Some(schema), _) | (None, Some(schema)) => check(root, schema, value, &place)?,
            (None, None) if named.is_some() => return Err(format!("{place} is not in the schema")),
            (None, None) => {}
        }
    }
    Ok(())
}

fn check_items(root: &Value, schema: &Map<String, Value>, value: &Value, place: &str) -> Result<(), String> {
    let Some(items) = value.as_array() else { return Ok(()) };
    let first = schema.get("prefixItems").map_or(&[][..], list);
    for (index, item) in items.iter().enumerate() {
        if let Some(schema) = first.get(index).or(schema.get("items")) {
            check(root, schema, item, &format!("{place}[{index}]"))?;
        }
    }
    Ok(())
}

/// A list, or the one thing that stands for a list of one.
fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(std::slice::from_ref(value), Vec::as_slice)
}

fn is_of_type(value: &Value, kind: &str) -> bool {
    match kind {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("{other} is no type of JSON"),
    }
}

#[test]
fn what_breaks_a_schema_is_found_where_it_is() {
    let schema = serde_json::json!({
        "type": "object",
        "required": ["kept"],
        "properties": {
            "kept": { "type": "array", "items": { "$ref": "#/$defs/id" } },
            "gain": { "type": ["number", "null"] },
            "pair": { "type": "array", "prefixItems": [{ "type": "string" }, {}], "minItems": 2, "maxItems": 2 },
            "end": { "oneOf": [{ "const": "steady" }, { "enum": ["rounds"] }] },
            "any": { "type": "object", "additionalProperties": { "type": "boolean" } }
        },
        "$defs": { "id": { "type": "integer", "minimum": 0, "format": "uint" } }
    });
    let found = |text: &str| check(&schema, &schema, &serde_json::from_str(text).unwrap(), "$");
    let right = r#"{"kept": [0, 3], "gain": null, "pair": ["a", 1], "end": "rounds", "any": {"x": true}}"#;
    assert_eq!(found(right), Ok(()));
    for (wrong, wanted) in [
        ("[]", "$ breaks type"),
        ("{}", "$ breaks required"),
        (r#"{"kept": [0, -1]}"#, "$.kept[1] breaks minimum"),
        (r#"{"kept": [0.5]}"#, "$.kept[0] breaks type"),
        (r#"{"kept": [], "gain": "high"}"#, "$.gain breaks type"),
        (r#"{"kept": [], "pair": ["a"]}"#, "$.pair breaks minItems"),
        (r#"{"kept": [], "pair": [1, 2]}"#, "$.pair[0] breaks type"),
        (r#"{"kept": [], "end": "never"}"#, "$.end breaks oneOf"),
        (r#"{"kept": [], "any": {"x": 1}}"#, "$.any.x breaks type"),
        (r#"{"kept": [], "more": 1}"#, "$.more is not in the schema"),
    ] {
        let why = found(wrong).unwrap_err();
        assert!(why.starts_with(wanted), "{wrong}: {why}");
    }
}
