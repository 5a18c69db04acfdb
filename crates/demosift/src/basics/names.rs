//! Names that nobody knows: the error lists those there are, and first the one that was probably meant.

/// What is said of an unknown name: all known ones, after the nearest, if one is near.
///
/// Such as `did you mean 'elbow'? the model has: shoulder, elbow`.
pub fn instead(name: &str, whose: &str, known: &[String]) -> String {
    if known.is_empty() {
        return format!("{whose} has: none");
    }
    let nearest = nearest(name, known).map_or(String::new(), |nearest| format!("did you mean '{nearest}'? "));
    format!("{nearest}{whose} has: {}", known.join(", "))
}

/// A name and all others, such as `no task is called 'handstan'; did you mean 'handstand'? there are: half_cheetah, handstand`.
pub fn unknown(what: &str, name: &str, known: &[&str]) -> String {
    let known: Vec<String> = known.iter().map(|known| (*known).to_owned()).collect();
    let meant = nearest(name, &known).map_or(String::new(), |nearest| format!("did you mean '{nearest}'? "));
    format!("no {what} is called '{name}'; {meant}there are: {}", known.join(", "))
}

/// The known name that takes the fewest typing errors to become `name`, if these are few for its length.
pub fn nearest<'a>(name: &str, known: &'a [String]) -> Option<&'a str> {
    let plain = |name: &str| name.to_lowercase().replace(['-', ' ', '.'], "_");
    let wanted = plain(name);
    let distance = |known: &str| {
        let known = plain(known);
        // `right_hand` is near to `hand`, whatever it takes to type the rest.
        let part =
            wanted.len() >= 3 && known.len() >= 3 && (known.contains(&wanted) || wanted.contains(&known));
        if part { 1 } else { strsim::damerau_levenshtein(&wanted, &known) }
    };
    let (errors, nearest) = known.iter().map(|known| (distance(known), known.as_str())).min()?;
    let length = name.chars().count();
    // Every letter is near to every other one.
    (errors <= 1 + length / 4 && errors < length).then_some(nearest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> Vec<String> {
        ["shoulder", "elbow", "right_hand"].map(str::to_owned).to_vec()
    }

    #[test]
    fn the_nearest_name_comes_first_and_all_are_listed() {
        let all = "the model has: shoulder, elbow, right_hand";
        for (typed, meant) in [
            ("elbw", "elbow"),
            ("Shoulder", "shoulder"),
            ("right-hand", "right_hand"),
            ("hand", "right_hand"),
        ] {
            assert_eq!(instead(typed, "the model", &known()), format!("did you mean '{meant}'? {all}"));
        }
    }

    #[test]
    fn a_name_that_is_like_none_gets_the_list_alone() {
        assert_eq!(instead("x", "the model", &known()), "the model has: shoulder, elbow, right_hand");
        assert_eq!(instead("x", "the model", &[]), "the model has: none");
    }
}
