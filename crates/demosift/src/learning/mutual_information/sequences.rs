//! What the posterior reads of trajectories.

use crate::math::rows::Rows;

/// Trajectories as the posterior reads them: the filtered observations at evenly spread times, as many of each.
#[derive(Clone, Debug)]
pub struct Sequences {
    values: Vec<f32>,
    /// Numbers of one sequence.
    size: usize,
}

impl Sequences {
    /// Reads episodes `[N, obs]` of `lengths` (they sum to N) at `readings` times or fewer, evenly spread from the first
    /// step to the last one of the horizon; an episode that ended early is held at its last observation.
    ///
    /// Observations without actions: a sampled action is mostly the policy's own noise, and what it comes to shows in the
    /// observations, of which the encoding is made.
    /// Not each of them: neighbors a fiftieth of a second apart say the same, and a recurrent network forgets over
    /// hundreds of steps.
    pub fn read(observations: &Rows, lengths: &[usize], horizon: usize, readings: usize) -> Self {
        let readings = readings.clamp(1, horizon);
        let mut values = Vec::with_capacity(lengths.len() * readings * observations.width());
        let mut start = 0;
        for length in lengths {
            for reading in 0..readings {
                let time = reading * (horizon - 1) / (readings - 1).max(1);
                values.extend_from_slice(observations.row(start + time.min(length - 1)));
            }
            start += length;
        }
        Self { values, size: readings * observations.width() }
    }

    /// Number of trajectories.
    pub fn len(&self) -> usize {
        self.values.len() / self.size
    }

    /// Whether there is no trajectory.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// One trajectory, `[readings, obs]` flat.
    pub fn get(&self, index: usize) -> &[f32] {
        &self.values[index * self.size..(index + 1) * self.size]
    }

    /// The mean trajectory, as the only one.
    #[must_use]
    pub fn averaged(&self) -> Self {
        Self { values: self.mean().iter().map(|value| *value as f32).collect(), size: self.size }
    }

    /// The mean over the trajectories, `[readings, obs]` flat.
    pub fn mean(&self) -> Vec<f64> {
        let mut mean = vec![0.0; self.size];
        for sequence in self.values.chunks_exact(self.size) {
            for (mean, value) in mean.iter_mut().zip(sequence) {
                *mean += f64::from(*value) / self.len() as f64;
            }
        }
        mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_spread_from_the_first_to_the_last_and_held_where_an_episode_ended() {
        let observations = Rows::from_flat((0..14).map(|value| value as f32).collect(), 1).expect("rows");
        let read = |readings| Sequences::read(&observations, &[9, 5], 9, readings);
        let five = read(5);
        assert_eq!(five.len(), 2);
        assert_eq!(five.get(0), [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert_eq!(five.get(1), [9.0, 11.0, 13.0, 13.0, 13.0]);
        assert_eq!(five.mean(), [4.5, 6.5, 8.5, 9.5, 10.5]);
        assert_eq!(read(100).get(0), &observations.flat()[..9]);
        assert_eq!(read(1).get(1), [9.0]);
    }
}
