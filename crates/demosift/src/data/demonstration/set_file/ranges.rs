//! From the numbers of a set to those of the task, by what its `set.toml` says.

use crate::basics::error::{Error, Result};
use crate::data::demonstration::conversion::{Affine, Conversion, Term};
use crate::data::demonstration::numbers::Numbers;
use crate::data::demonstration::set_file::{Each, Meaning, SetFile, Unit, Units};

/// The ranges of a task's numbers, which some units are shares of.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ranges<'a> {
    /// What −1 and 1 of each action mean to its actuator, `[act]`; nothing where no task is known.
    pub controls: &'a [[f64; 2]],
    /// The range of the joint whose position an observed number is, `[obs]`; nothing where no task is known.
    pub observations: &'a [Option<[f64; 2]>],
}

/// Which side of a set is meant, and how many numbers it has there.
#[derive(Clone, Copy)]
struct Side<'a> {
    meaning: &'a Meaning,
    width: usize,
    ranges: Ranges<'a>,
    is_actions: bool,
}

impl SetFile {
    /// What becomes of a set whose observations and actions have so many numbers.
    ///
    /// # Errors
    /// `is_bad_config` if a list has another length, a place is not there, or a unit wants a range that is not known.
    pub fn conversion(&self, observed: usize, acted: usize, ranges: Ranges<'_>) -> Result<Conversion> {
        let of = |meaning, width, is_actions| Side { meaning, width, ranges, is_actions }.affine();
        let observations =
            of(&self.observations, observed, false).map_err(|error| error.during("observations"))?;
        let actions = of(&self.actions, acted, true).map_err(|error| error.during("actions"))?;
        Ok(Conversion { observations, actions })
    }
}

impl Side<'_> {
    fn affine(&self) -> Result<Option<Affine>> {
        let Side { meaning, width, .. } = *self;
        if meaning.is_none() || meaning.is_of_task() && meaning.has_only_units() {
            return Ok(None);
        }
        let order = meaning.order.clone().unwrap_or_else(|| (0..width).collect());
        if let Some(place) = order.iter().find(|place| **place >= width) {
            return Err(Error::bad_config(format!(
                "order holds {place}, and the set has {width} numbers, counted from 0"
            )));
        }
        let list = |key: &str, each: &Option<Each>, usual: f64| match each {
            None => Ok(vec![usual; order.len()]),
            Some(Each::All(number)) => Ok(vec![*number; order.len()]),
            Some(Each::Listed(numbers)) if numbers.len() == order.len() => Ok(numbers.clone()),
            Some(Each::Listed(numbers)) => Err(Error::bad_config(format!(
                "{key} has {} numbers; wanted {}, one for each",
                numbers.len(),
                order.len()
            ))),
        };
        let (signs, scales) = (list("sign", &meaning.sign, 1.0)?, list("scale", &meaning.scale, 1.0)?);
        let offsets = list("offset", &meaning.offset, 0.0)?;
        let units = units_of(meaning, order.len())?;
        let terms = (0..order.len()).map(|at| {
            let unit = self.term_of(units[at], at)?;
            let factor = unit.factor * signs[at] * scales[at];
            Ok(Term { from: order[at], factor, shift: unit.factor * offsets[at] + unit.shift })
        });
        terms.collect::<Result<_>>().map(|terms| Some(Affine(terms)))
    }
}

impl Meaning {
    fn has_only_units(&self) -> bool {
        Self { units: None, ..self.clone() }.is_none()
    }
}

/// The unit of each number.
fn units_of(meaning: &Meaning, count: usize) -> Result<Vec<Unit>> {
    let named = match &meaning.units {
        None => return Ok(vec![Unit::Task; count]),
        Some(Units::All(unit)) => return Ok(vec![*unit; count]),
        Some(Units::Some(named)) => named,
    };
    let mut units = vec![None; count];
    for (unit, numbers) in named {
        let beyond = |numbers: &Numbers| numbers.last().is_some_and(|last| last >= count as u64);
        if beyond(numbers) {
            return Err(Error::bad_config(format!(
                "units: {} = \"{numbers}\", and there are {count} numbers, counted from 0",
                unit.word()
            )));
        }
        for (at, known) in units.iter_mut().enumerate().filter(|(at, _)| numbers.hold(*at as u64)) {
            if let Some(before) = known.replace(*unit) {
                let before: Unit = before;
                return Err(Error::bad_config(format!(
                    "units: number {at} is in {} and in {}; wanted one unit for each",
                    before.word(),
                    unit.word()
                )));
            }
        }
    }
    Ok(units.into_iter().map(|unit| unit.unwrap_or(Unit::Task)).collect())
}

impl Side<'_> {
    /// From a unit to what the task takes, of its number `at`.
    fn term_of(&self, unit: Unit, at: usize) -> Result<Term> {
        let term = |factor: f64, shift: f64| Ok(Term { from: at, factor, shift });
        let of_range = |[low, high]: [f64; 2]| (0.5 * (low + high), 0.5 * (high - low));
        match (unit, self.is_actions) {
            (Unit::Task, _) => term(1.0, 0.0),
            (Unit::Controls, true) => {
                let (middle, half) = of_range(self.control(unit, at)?);
                term(1.0 / half, -middle / half)
            }
            (Unit::Degrees, true) => {
                let (middle, half) = of_range(self.control(unit, at)?);
                term(1.0_f64.to_radians() / half, -middle / half)
            }
            (Unit::Percent, true) => term(0.01, 0.0),
            (Unit::PercentFrom0, true) => term(0.02, -1.0),
            (Unit::Controls, false) => Err(Error::bad_config(
                "units = \"controls\" is for actions; wanted task, degrees, percent or percent_from_0",
            )),
            (Unit::Degrees, false) => term(1.0_f64.to_radians(), 0.0),
            (Unit::Percent, false) => {
                let (middle, half) = of_range(self.observed(unit, at)?);
                term(0.01 * half, middle)
            }
            (Unit::PercentFrom0, false) => {
                let [low, high] = self.observed(unit, at)?;
                term(0.01 * (high - low), low)
            }
        }
    }

    fn control(&self, unit: Unit, at: usize) -> Result<[f64; 2]> {
        self.ranges.controls.get(at).copied().filter(|[low, high]| low < high).ok_or_else(|| {
            let error = Error::bad_config(format!(
                "units = \"{}\" of number {at} wants the range of a control, and there is none",
                unit.word()
            ));
            self.without_a_task(error)
        })
    }

    fn observed(&self, unit: Unit, at: usize) -> Result<[f64; 2]> {
        self.ranges.observations.get(at).copied().flatten().ok_or_else(|| {
            let error = Error::bad_config(format!(
                "units = \"{}\" of number {at} is a share of the range of a joint, and the number is not the position of a \
                 joint with a range",
                unit.word()
            ));
            self.without_a_task(error)
        })
    }

    fn without_a_task(&self, error: Error) -> Error {
        if self.ranges.controls.is_empty() {
            return error.with_hint("the ranges are those of the task: add --task NAME");
        }
        error
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;
    use crate::math::rows::Rows;

    const RANGES: Ranges<'_> =
        Ranges { controls: &[[-2.0, 2.0], [0.0, 4.0]], observations: &[Some([-1.0, 3.0]), None] };

    fn made(text: &str) -> (Vec<f32>, Vec<f32>) {
        let conversion = SetFile::parse(text).unwrap().conversion(2, 2, RANGES).unwrap();
        let rows = |numbers: [f32; 2]| Rows::from_flat(numbers.to_vec(), 2).unwrap();
        (
            conversion.observations(&rows([90.0, -50.0])).flat().to_vec(),
            conversion.actions(&rows([1.0, 3.0])).flat().to_vec(),
        )
    }

    #[test]
    fn each_unit_means_what_it_says() {
        assert_eq!(made(""), (vec![90.0, -50.0], vec![1.0, 3.0]));
        assert_eq!(made("actions.units = 'task'").1, [1.0, 3.0]);
        assert_eq!(made("actions.units = 'controls'").1, [0.5, 0.5]);
        assert_eq!(made("actions.units = 'percent'").1, [0.01, 0.03]);
        assert_eq!(made("actions.units = { percent_from_0 = '1' }").1, [1.0, -0.94]);
        let degrees = made("actions.units = 'degrees'").1;
        let by_hand = [1.0_f64.to_radians() / 2.0, (3.0_f64.to_radians() - 2.0) / 2.0];
        assert!(degrees.iter().zip(by_hand).all(|(made, wanted)| (f64::from(*made) - wanted).abs() < 1e-7));
        let half_a_turn = std::f32::consts::FRAC_PI_2;
        assert_eq!(made("observations.units = { degrees = '0' }").0, [half_a_turn, -50.0]);
        // 90 of -100 to 100 over [-1, 3] is 95 % of the way.
        assert!((made("observations.units = { percent = '0' }").0[0] - 2.8).abs() < 1e-6);
        assert!((made("observations.units = { percent_from_0 = '0' }").0[0] - 2.6).abs() < 1e-6);
    }

    #[test]
    fn order_comes_first_then_sign_and_scale_then_offset_then_the_unit() {
        let text =
            "[actions]\norder = [1, 0]\nsign = [1, -1]\nscale = 2\noffset = [0, 1]\nunits = 'controls'";
        // (2 · 3 − 0) / 2 and (−2 · 1 + 1 − 2) / 2.
        assert_eq!(made(text).1, [3.0, -1.5]);
        assert_eq!(made("actions.order = [1]").1, [3.0]);
    }

    #[test]
    fn what_does_not_fit_the_set_or_the_task_is_an_error() {
        for (text, ranges, wanted) in [
            ("actions.order = [0, 2]", RANGES, "actions: order holds 2, and the set has 2 numbers"),
            ("actions.sign = [1, 1, -1]", RANGES, "actions: sign has 3 numbers; wanted 2"),
            ("actions.units = { degrees = '1-2' }", RANGES, "degrees = \"1-2\", and there are 2 numbers"),
            (
                "actions.units = { degrees = '0-1', percent = '1' }",
                RANGES,
                "number 1 is in degrees and in percent",
            ),
            ("observations.units = 'controls'", RANGES, "is for actions; wanted task, degrees"),
            ("observations.units = 'percent'", RANGES, "number 1 is a share of the range of a joint"),
            ("actions.units = 'controls'", Ranges::default(), "wants the range of a control"),
        ] {
            let error = SetFile::parse(text).unwrap().conversion(2, 2, ranges).unwrap_err();
            assert!(error.is_bad_config() && error.to_string().contains(wanted), "{text}: {error}");
            assert_eq!(error.hint().is_some(), ranges.controls.is_empty(), "{text}");
        }
    }
}
