//! Length: who is good at a task is done sooner.
//!
//! In robomimic's sets of several operators the better ones' demonstrations are shorter (Mandlekar et al. 2021, "What
//! matters in learning from offline human demonstrations for robot manipulation"), and cleaning tools score short
//! episodes higher for that reason. Where a task is to last, as running is, the sign is wrong, and with a fixed horizon
//! there is nothing to read.

use crate::basics::error::Result;
use crate::data::demonstration::DemonstrationSet;

/// Minus the number of steps; always there.
pub fn length(set: &DemonstrationSet) -> Result<Option<Vec<f64>>> {
    Ok(Some(set.iter().map(|(_, demonstration)| -(demonstration.steps() as f64)).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::demonstration::Demonstration;
    use crate::math::rows::Rows;

    #[test]
    fn the_shorter_is_the_higher() {
        let of = |steps: usize| {
            let rows = || Rows::from_flat(vec![0.5; steps], 1).unwrap();
            Demonstration::new(rows(), rows()).unwrap()
        };
        let set = DemonstrationSet::new(vec![of(7), of(2)]).unwrap();
        assert_eq!(length(&set).unwrap().unwrap(), [-7.0, -2.0]);
    }
}
