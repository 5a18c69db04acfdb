//! Names as they are typed in a list with commas, where a name may hold commas itself.

/// The names of a list such as `MAML, cloned, oracle`, of which the longest that is known is taken each time; what is not known
/// stays as it was typed between two commas.
pub fn names(typed: &str, known: &[&str]) -> Vec<String> {
    let known: Vec<(&str, Vec<&str>)> = known.iter().map(|name| (*name, parts(name).collect())).collect();
    let typed: Vec<&str> = parts(typed).collect();
    let (mut names, mut rest) = (Vec::new(), typed.as_slice());
    while let [first, ..] = rest {
        let begin = known.iter().filter(|(_, name)| rest.starts_with(name));
        let longest = begin.max_by_key(|(_, name)| name.len());
        names.push(longest.map_or(*first, |(name, _)| name).to_owned());
        rest = &rest[longest.map_or(1, |(_, name)| name.len())..];
    }
    names
}

fn parts(list: &str) -> impl Iterator<Item = &str> {
    list.split(',').map(str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_may_hold_a_comma_and_begin_like_another() {
        let known = ["MAML", "MAML, cloned", "cloning"];
        for (typed, wanted) in [
            ("MAML, cloned,oracle", vec!["MAML, cloned", "oracle"]),
            ("MAML,cloned", vec!["MAML, cloned"]),
            ("MAML,cloning", vec!["MAML", "cloning"]),
            ("MAML,", vec!["MAML", ""]),
            ("cloned", vec!["cloned"]),
        ] {
            assert_eq!(names(typed, &known), wanted, "{typed}");
        }
    }
}
