//! What a run folder holds: the bytes as each of its files, as they are, and with the checksum of somebody who knows their
//! form.

use demosift::Result;
use demosift::basics::ledger::Ledger;
use demosift::basics::seal;
use demosift::data::likeness::TrainedOn;
use demosift::learning::adapt::MetaPrior;
use demosift::results::artifact::{self, Artifact as _};
use demosift::results::data_only::DataOnly;
use demosift::results::metrics as rows;
use demosift::results::metrics::Measured;
use demosift::results::panel::Panel;
use demosift::results::tensorboard;
use demosift::results::uncertainty::Uncertainty;
use demosift::stages::demonstrator::Stage;
use demosift::stages::imitate::{ImitationState, LearningCurve};
use demosift::stages::judge::{Judged, JudgingState};
use demosift::stages::meta_train::MetaState;
use demosift::stages::method::Spent;
use demosift::stages::referee::Verdict;
use demosift::stages::select::{Ranking, Subset};
use demosift::stages::subset_selection::Weighing;
use serde_json::Value;

/// As every result that is JSON.
pub(crate) fn json(bytes: &[u8]) {
    recall_json(bytes);
    // What is sealed has fields.
    if let Ok(Value::Object(fields)) = serde_json::from_slice(bytes)
        && !fields.is_empty()
    {
        recall_json(&seal::to_json(&fields));
    }
}

fn recall_json(bytes: &[u8]) {
    let all = Same { json: bytes, others: &[] };
    let _ = (Ranking::recall(&all, ""), Subset::recall(&all, ""), TrainedOn::recall(&all, ""));
    let _ = (Uncertainty::recall(&all, ""), DataOnly::recall(&all, ""), Spent::recall(&all, "judge"));
    let _ = (Weighing::recall(&all, ""), Panel::recall(&all, ""), Verdict::recall(&all, ""));
    let _ = (Judged::recall(&all, "paper"), LearningCurve::recall(&all, "all"));
}

/// As the tensors of a policy, of a prior, of adapted policies and of a learning curve.
pub(crate) fn tensors(bytes: &[u8]) {
    let scores = seal::to_json(&serde_json::from_slice::<Value>(SCORES).expect("written here"));
    let curve = seal::to_json(&serde_json::from_slice::<Value>(CURVE).expect("written here"));
    for bytes in [bytes.to_vec(), sealed(bytes)] {
        let beside = |json| Same { json, others: &bytes };
        let _ = artifact::read_policy(&bytes, "policy");
        let _ = MetaPrior::recall(&beside(&[]), "");
        let _ = Judged::recall(&beside(&scores), "paper");
        let _ = LearningCurve::recall(&beside(&curve), "all");
    }
}

/// A table of one demonstration, whose policy is to be found.
const SCORES: &[u8] =
    br#"{"version": 4, "suitabilities": [{"demo": 0, "variant": 0, "before": [[0.0]], "after": [[1.0]],
    "distances": [0.5], "curves": [[]]}]}"#;
/// A curve of one point.
const CURVE: &[u8] = br#"{"version": 4, "demos": [0], "points": [], "played": 1,
    "outcome": {"update": 1, "environment_steps": 1, "score": 0.5, "success": 0.0},
    "end": {"update": 1, "environment_steps": 1, "score": 0.5, "success": 0.0}}"#;

/// As the state of every stage that keeps one, and as the stages of a demonstrator.
pub(crate) fn checkpoints(bytes: &[u8]) {
    let version = artifact::FORMAT_VERSION.to_le_bytes();
    let mut whole = [&version[..], &seal::OPEN, bytes].concat();
    seal::seal(&mut whole, version.len());
    for bytes in [bytes, &whole] {
        let _ = artifact::read_checkpoint::<(u64, MetaState)>(bytes, "checkpoint");
        let _ = artifact::read_checkpoint::<(u64, JudgingState)>(bytes, "checkpoint");
        let _ = artifact::read_checkpoint::<(u64, ImitationState)>(bytes, "checkpoint");
        let _ = Vec::<Stage>::recall(&Same { json: &[], others: bytes }, "");
    }
}

/// As `metrics.jsonl`, behind some bytes of which a checkpoint vouches for the first half; and as what vouches.
pub(crate) fn metrics(bytes: &[u8]) {
    let whole = &bytes[..rows::whole_lines(bytes)];
    if let Ok(lines) = rows::read(whole) {
        let events = lines.iter().enumerate().map(|(place, line)| rows::event(place, line).len());
        assert!(events.sum::<usize>() < 100 * whole.len() + tensorboard::first_record().len());
    }
    let vouched = Measured::of(&whole[..whole.len() / 2]);
    assert!(vouched.vouches_for(whole));
    let json = seal::of_json_if_sealed(bytes.to_vec(), "measured.json");
    if let Some(measured) = json.ok().and_then(|json| serde_json::from_slice::<Measured>(&json).ok()) {
        let _ = measured.vouches_for(whole);
    }
}

/// The bytes with their checksum where a place for one is left open.
fn sealed(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    if let Some(place) = bytes.windows(seal::DIGITS).position(|window| window == seal::OPEN) {
        seal::seal(&mut bytes, place);
    }
    bytes
}

/// A run folder in which all files of a kind are the same.
struct Same<'a> {
    json: &'a [u8],
    others: &'a [u8],
}

impl Ledger for Same<'_> {
    fn recall(&self, name: &str) -> Result<Option<Vec<u8>>> {
        Ok(Some(if name.ends_with(".json") { self.json } else { self.others }.to_vec()))
    }

    fn store(&mut self, _: &str, _: &[u8]) -> Result<()> {
        Ok(())
    }

    fn forget(&mut self, _: &str) -> Result<()> {
        Ok(())
    }
}
