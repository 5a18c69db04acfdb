//! What a `set.toml` says, in sentences for people.

use crate::data::demonstration::set_file::{Each, Meaning, SetFile, Unit, Units};

impl SetFile {
    /// A sentence for the rate, and for each row of numbers of which the same is said; `observed` and `acted` are how many
    /// numbers the set has. None where nothing is said.
    pub fn in_words(&self, observed: usize, acted: usize) -> Vec<String> {
        let rate = self
            .rate
            .map(|rate| format!("It was recorded at {rate} steps a second, whatever it says itself."));
        let actions = self.actions.in_words("action", acted);
        rate.into_iter().chain(actions).chain(self.observations.in_words("observation", observed)).collect()
    }
}

/// What is said of one number of the task.
#[derive(PartialEq)]
struct Said {
    /// Its place in the set.
    from: usize,
    /// What is done with that number.
    done: String,
}

impl Meaning {
    fn in_words(&self, what: &str, width: usize) -> Vec<String> {
        if self.is_none() {
            return Vec::new();
        }
        let order = self.order.clone().unwrap_or_else(|| (0..width).collect());
        let said: Vec<Said> =
            order.iter().enumerate().map(|(place, &from)| Said { from, done: self.done(place) }).collect();
        let mut sentences = Vec::new();
        let mut first = 0;
        while first < said.len() {
            let goes_on = |&place: &usize| {
                said[place].done == said[first].done && said[place].from == said[first].from + place - first
            };
            let end = (first + 1..said.len()).take_while(goes_on).last().unwrap_or(first) + 1;
            let Said { from, done } = &said[first];
            sentences.push(match end - first {
                1 => format!("Number {first} of an {what} is number {from} of the set{done}."),
                more => format!(
                    "Numbers {first} to {} of an {what} are numbers {from} to {} of the set{done}.",
                    end - 1,
                    from + more - 1
                ),
            });
            first = end;
        }
        sentences
    }

    /// What is done with the number at a place of the task, behind a comma.
    fn done(&self, place: usize) -> String {
        let number = |each: &Option<Each>| match each {
            None => None,
            Some(Each::All(number)) => Some(*number),
            Some(Each::Listed(numbers)) => numbers.get(place).copied(),
        };
        let sign = number(&self.sign).filter(|sign| *sign < 0.0).map(|_| "with the other sign".to_owned());
        let scale = number(&self.scale).filter(|scale| *scale != 1.0).map(|scale| format!("times {scale}"));
        let offset =
            number(&self.offset).filter(|offset| *offset != 0.0).map(|offset| format!("plus {offset}"));
        let unit = match &self.units {
            None => None,
            Some(Units::All(unit)) => Some(*unit),
            Some(Units::Some(units)) => {
                units.iter().find(|(_, numbers)| numbers.hold(place as u64)).map(|(unit, _)| *unit)
            }
        };
        let unit = unit.and_then(Unit::in_words).map(str::to_owned);
        let done: Vec<String> = [sign, scale, offset, unit].into_iter().flatten().collect();
        done.iter().map(|done| format!(", {done}")).collect()
    }
}

impl Unit {
    /// How a number in this unit is taken; `None` where it is what the task takes.
    fn in_words(self) -> Option<&'static str> {
        match self {
            Self::Task => None,
            Self::Controls => Some("taken as a control of the model, in the unit of its range"),
            Self::Degrees => Some("taken as degrees"),
            Self::Percent => Some("taken as percent, from -100 to 100 over its range"),
            Self::PercentFrom0 => Some("taken as percent, from 0 to 100 over its range"),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use super::*;

    fn words(text: &str) -> Vec<String> {
        SetFile::parse(text).unwrap().in_words(4, 3)
    }

    #[test]
    fn numbers_of_which_the_same_is_said_share_a_sentence() {
        assert_eq!(words(""), Vec::<String>::new());
        assert_eq!(
            words("rate = 25\nactions.units = 'degrees'"),
            [
                "It was recorded at 25 steps a second, whatever it says itself.",
                "Numbers 0 to 2 of an action are numbers 0 to 2 of the set, taken as degrees.",
            ]
        );
        assert_eq!(
            words(
                "[actions]\norder = [1, 2, 0]\nsign = [1, 1, -1]\nscale = 2\noffset = [0.5, 0.5, 0]\nunits = 'task'"
            ),
            [
                "Numbers 0 to 1 of an action are numbers 1 to 2 of the set, times 2, plus 0.5.",
                "Number 2 of an action is number 0 of the set, with the other sign, times 2.",
            ]
        );
        assert_eq!(
            words("observations.units = { degrees = '0-1', percent = '3' }"),
            [
                "Numbers 0 to 1 of an observation are numbers 0 to 1 of the set, taken as degrees.",
                "Number 2 of an observation is number 2 of the set.",
                "Number 3 of an observation is number 3 of the set, taken as percent, from -100 to 100 over its range.",
            ]
        );
    }

    #[test]
    fn an_order_of_fewer_numbers_says_how_many_there_are() {
        assert_eq!(words("actions.order = [2]"), ["Number 0 of an action is number 2 of the set."]);
    }
}
