//! Lines over the numbers of a set as a `set.toml` would say them: an order, signs, a unit, or a scale and an offset.

use demosift::data::demonstration::numbers::Numbers;
use demosift::data::demonstration::set_file::{Each, Meaning, Ranges, SetFile, Unit, Units};
use demosift::math::rows::Rows;

use super::needed::Line;

/// A factor that is off by at most this share is that of a unit.
const NEAR: f64 = 0.02;
/// The same of a shift, in units of the task.
const NEAR_SHIFT: f64 = 0.02;
/// Decimals of a number that no unit explains: enough for a thousandth.
const DIGITS: f64 = 1000.0;

/// Actions or observations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Side {
    Actions,
    Observations,
}

impl Side {
    /// A file that says this of the side, and nothing else.
    pub(super) fn file(self, meaning: Meaning) -> SetFile {
        match self {
            Self::Actions => SetFile { actions: meaning, ..SetFile::default() },
            Self::Observations => SetFile { observations: meaning, ..SetFile::default() },
        }
    }

    pub(super) fn of(self, file: &SetFile) -> &Meaning {
        match self {
            Self::Actions => &file.actions,
            Self::Observations => &file.observations,
        }
    }

    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Actions => "actions",
            Self::Observations => "observations",
        }
    }
}

/// What lines over `width` recorded numbers mean.
pub(super) fn name(lines: &[Line], width: usize, side: Side, ranges: Ranges<'_>) -> Meaning {
    let places: Vec<usize> = lines.iter().map(|line| line.from).collect();
    let order = (!places.iter().copied().eq(0..width)).then_some(places);
    let units: Vec<[Option<Line>; Unit::ALL.len()]> = (0..lines.len())
        .map(|at| Unit::ALL.map(|unit| unit_line(unit, at, lines.len(), side, ranges)))
        .collect();
    let sign_in = |at: usize, unit: usize| sign_of(lines[at], units[at][unit]?);
    let all = |unit: &usize| (0..lines.len()).all(|at| sign_in(at, *unit).is_some());
    // The first unit that fits all, or else the first of each.
    let chosen: Option<Vec<usize>> = match (0..Unit::ALL.len()).find(all) {
        Some(unit) => Some(vec![unit; lines.len()]),
        None => {
            let first = |at: usize| (0..Unit::ALL.len()).find(|unit| sign_in(at, *unit).is_some());
            (0..lines.len()).map(first).collect()
        }
    };
    let Some(chosen) = chosen else {
        return Meaning { order, ..scaled(lines) };
    };
    let signs: Vec<f64> =
        chosen.iter().enumerate().map(|(at, unit)| sign_in(at, *unit).unwrap_or(1.0)).collect();
    let chosen: Vec<Unit> = chosen.into_iter().map(|unit| Unit::ALL[unit]).collect();
    Meaning { order, sign: each(&signs, 1.0), units: in_units(&chosen), ..Meaning::default() }
}

/// Units of all numbers, in few words.
pub(super) fn in_units(chosen: &[Unit]) -> Option<Units> {
    let first = *chosen.first()?;
    if chosen.iter().all(|unit| *unit == first) {
        return (first != Unit::Task).then_some(Units::All(first));
    }
    let of = |unit: Unit| -> Numbers {
        let places = chosen.iter().enumerate().filter(|(_, other)| **other == unit);
        places.map(|(at, _)| at as u64).collect()
    };
    let named = chosen.iter().copied().filter(|unit| *unit != Unit::Task);
    Some(Units::Some(named.map(|unit| (unit, of(unit))).collect()))
}

/// One number if all are the same, and none if they are the usual one.
fn each(numbers: &[f64], usual: f64) -> Option<Each> {
    let first = *numbers.first()?;
    if numbers.iter().any(|number| *number != first) {
        return Some(Each::Listed(numbers.to_vec()));
    }
    (first != usual).then_some(Each::All(first))
}

fn scaled(lines: &[Line]) -> Meaning {
    let rounded: Vec<f64> = lines.iter().map(|line| short(line.factor)).collect();
    let shifts: Vec<f64> = lines
        .iter()
        .map(|line| if line.shift.abs() < NEAR_SHIFT { 0.0 } else { short(line.shift) })
        .collect();
    Meaning { scale: each(&rounded, 1.0), offset: each(&shifts, 0.0), ..Meaning::default() }
}

/// A number to three or four digits, or to two where that is as good.
fn short(number: f64) -> f64 {
    let magnitude = 10.0_f64.powf(number.abs().log10().floor());
    if !(magnitude > 0.0 && magnitude.is_finite()) {
        return number;
    }
    let to = |digits: f64| -> f64 {
        let rounded = (number / magnitude * digits).round();
        // Dividing twice brings digits that nobody wrote.
        format!("{:e}", rounded / digits).parse::<f64>().unwrap_or(rounded / digits) * magnitude
    };
    let (coarse, fine) = (to(10.0), to(DIGITS));
    let near = (coarse - number).abs() <= 0.005 * number.abs();
    let chosen = if near { coarse } else { fine };
    format!("{chosen:.9}").parse().unwrap_or(chosen)
}

/// What a unit makes of a number, without a sign; `None` where the unit means nothing for it.
fn unit_line(unit: Unit, at: usize, count: usize, side: Side, ranges: Ranges<'_>) -> Option<Line> {
    let only = Units::Some([(unit, [at as u64].into_iter().collect())].into());
    let file = side.file(Meaning { units: Some(only), ..Meaning::default() });
    let conversion = file.conversion(count, count, ranges).ok()?;
    let made = |number: f32| {
        let row = Rows::from_flat(vec![number; count], count).ok()?;
        let made = match side {
            Side::Actions => conversion.actions(&row),
            Side::Observations => conversion.observations(&row),
        };
        Some(f64::from(made.row(0)[at]))
    };
    let shift = made(0.0)?;
    Some(Line { from: at, factor: made(1.0)? - shift, shift })
}

/// 1 or −1 if the line is that of the unit, times this.
fn sign_of(line: Line, unit: Line) -> Option<f64> {
    let is_near = (line.shift - unit.shift).abs() <= NEAR_SHIFT * (1.0 + unit.shift.abs());
    let sign = line.factor.signum() * unit.factor.signum();
    let is_it = (line.factor - sign * unit.factor).abs() <= NEAR * unit.factor.abs();
    (is_near && is_it).then_some(sign)
}

/// What a meaning says of the numbers of a set, in words; `None` if it says nothing.
pub(super) fn in_words(meaning: &Meaning, side: Side) -> Option<String> {
    let numbers = side.word();
    let mut words = Vec::new();
    if let Some(order) = &meaning.order {
        words.push(format!("the recorded {numbers} stand in another order: {order:?}"));
    }
    match &meaning.sign {
        Some(Each::All(_)) => words.push(format!("all recorded {numbers} have the other sign")),
        Some(Each::Listed(signs)) => {
            let other: Numbers =
                signs.iter().enumerate().filter(|(_, sign)| **sign < 0.0).map(|(at, _)| at as u64).collect();
            words.push(format!("number {other} of the {numbers} has the other sign"));
        }
        None => {}
    }
    match &meaning.scale {
        Some(scale) if side == Side::Actions => words.push(format!(
            "the recorded actions times {scale} are what the model takes (or its gears or ctrlrange differ by that)"
        )),
        Some(scale) => words.push(format!("the recorded observations times {scale} are what the task observes")),
        None => {}
    }
    if let Some(offset) = &meaning.offset {
        words.push(format!("the recorded {numbers} are shifted: {offset} is to be added"));
    }
    match &meaning.units {
        Some(Units::All(unit)) => words.push(format!("the recorded {numbers} are {}", in_unit(*unit))),
        Some(Units::Some(units)) => words.extend(
            units
                .iter()
                .map(|(unit, those)| format!("number {those} of the {numbers} is {}", in_unit(*unit))),
        ),
        None => {}
    }
    (!words.is_empty()).then(|| words.join(", and "))
}

fn in_unit(unit: Unit) -> &'static str {
    match unit {
        Unit::Task => "as the task takes them",
        Unit::Controls => "controls in the units of ctrlrange",
        Unit::Degrees => "in degrees",
        Unit::Percent => "in percent of the range, -100 to 100",
        Unit::PercentFrom0 => "in percent of the range, 0 to 100",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RANGES: Ranges<'_> =
        Ranges { controls: &[[-2.0, 2.0], [0.0, 4.0]], observations: &[Some([-1.0, 3.0]), None] };

    fn named(lines: &[[f64; 3]]) -> String {
        let line =
            |[from, factor, shift]: &[f64; 3]| Line { from: *from as usize, factor: *factor, shift: *shift };
        let lines: Vec<Line> = lines.iter().map(line).collect();
        let meaning = name(&lines, 2, Side::Actions, RANGES);
        Side::Actions.file(meaning).to_string()
    }

    #[test]
    fn lines_are_named_by_order_sign_and_unit_or_else_by_scale_and_offset() {
        let degrees = 1.0_f64.to_radians() / 2.0;
        for (lines, wanted) in [
            ([[0.0, 1.0, 0.0], [1.0, 1.001, 0.0]], ""),
            ([[0.0, -1.0, 0.0], [1.0, 1.0, 0.0]], "actions.sign = [-1, 1]\n"),
            ([[1.0, 1.0, 0.0], [0.0, 1.0, 0.0]], "actions.order = [1, 0]\n"),
            ([[0.0, 0.5, 0.0], [1.0, 0.5, -1.0]], "actions.units = \"controls\"\n"),
            ([[0.0, degrees, 0.0], [1.0, degrees, -1.0]], "actions.units = \"degrees\"\n"),
            ([[0.0, 0.01, 0.0], [1.0, -0.01, 0.0]], "actions.sign = [1, -1]\nactions.units = \"percent\"\n"),
            (
                [[0.0, 0.5, 0.0], [1.0, 0.02, -1.0]],
                "actions.units = { controls = \"0\", percent_from_0 = \"1\" }\n",
            ),
            ([[0.0, 2.0004, 0.0], [1.0, 1.9996, 0.001]], "actions.scale = 2\n"),
            (
                [[0.0, 0.3333, 0.0], [1.0, -3.7482, 0.7]],
                "actions.scale = [0.3333, -3.748]\nactions.offset = [0, 0.7]\n",
            ),
        ] {
            assert_eq!(named(&lines), wanted);
        }
    }

    #[test]
    fn a_share_of_the_range_is_told_only_where_there_is_one() {
        let line = |from: usize, factor: f64, shift: f64| Line { from, factor, shift };
        let lines = [line(0, 0.02, 1.0), line(1, 1.0, 0.0)];
        let meaning = name(&lines, 2, Side::Observations, RANGES);
        assert_eq!(
            Side::Observations.file(meaning).to_string(),
            "observations.units = { percent = \"0\" }\n"
        );
    }
}
