//! A difference with its interval, as pages of experiments write it.

use demosift::run::study::estimate::Difference;

use super::Scale;

/// In a unit, with its sign.
pub(crate) fn signed(difference: &Difference, unit: &str) -> String {
    let ends = difference.interval.into_iter().flatten();
    let scale = Scale::of([difference.mean].into_iter().chain(ends), unit);
    format!("{} {unit}", with_ends(difference, |value| scale.signed(value))).trim_end().to_owned()
}

/// As `written` writes each of its numbers.
pub(crate) fn with_ends(
    Difference { mean, interval, .. }: &Difference,
    written: impl Fn(f64) -> String,
) -> String {
    let ends =
        interval.map_or(String::new(), |[low, high]| format!(" [{}, {}]", written(low), written(high)));
    format!("{}{ends}", written(*mean))
}

/// Bold where enough pairs leave no 0 in the interval.
pub(crate) fn marked(difference: &Difference, words: &str) -> String {
    let is_sure = difference.can_decide() && difference.is_separable();
    if is_sure { format!("**{words}**") } else { words.to_owned() }
}
