//! What a reset or a step leads to, as the worker writes it.

const TERMINATED: u8 = 1;
const TRUNCATED: u8 = 2;
/// Flags and reward stand before the observation.
const HEAD: usize = 9;

/// What a reset or a step leads to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Turn {
    /// Whether the state is terminal.
    pub terminated: bool,
    /// Whether the environment stops here, though the state is not terminal.
    pub truncated: bool,
    /// The environment's reward; 0 after a reset.
    pub reward: f64,
    /// `[obs]`.
    pub observation: Vec<f32>,
    /// The numbers of info that are measured.
    pub info: Vec<f64>,
}

/// The sizes of a turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TurnSizes {
    /// Numbers in an observation.
    pub observation: usize,
    /// Numbers of info that are measured.
    pub info: usize,
}

impl Turn {
    /// Fills it with what the worker has written, which `python/demosift_worker/worker.py` describes; whether that was a turn.
    #[must_use]
    pub fn read(&mut self, payload: &[u8], sizes: TurnSizes) -> bool {
        if payload.len() != HEAD + 4 * sizes.observation + 8 * sizes.info {
            return false;
        }
        let (head, rest) = payload.split_at(HEAD);
        let (observation, info) = rest.split_at(4 * sizes.observation);
        self.terminated = head[0] & TERMINATED != 0;
        self.truncated = head[0] & TRUNCATED != 0;
        self.reward = f64s(&head[1..]).next().unwrap_or(f64::NAN);
        self.observation.clear();
        self.observation
            .extend(observation.chunks_exact(4).map(|of| f32::from_le_bytes([of[0], of[1], of[2], of[3]])));
        self.info.clear();
        self.info.extend(f64s(info));
        true
    }

    /// A row of measurements after a step: reward, terminated, numbers of info.
    pub(crate) fn row(&self) -> Vec<f32> {
        let terminated = if self.terminated { 1.0 } else { 0.0 };
        let mut row = vec![self.reward as f32, terminated];
        row.extend(self.info.iter().map(|number| *number as f32));
        row
    }
}

pub(crate) fn f64s(bytes: &[u8]) -> impl Iterator<Item = f64> {
    bytes
        .chunks_exact(8)
        .map(|of| f64::from_le_bytes([of[0], of[1], of[2], of[3], of[4], of[5], of[6], of[7]]))
}
