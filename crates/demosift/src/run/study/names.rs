//! Names as they are typed in a list with commas, where a name may hold commas itself.

/// What stands between the commas.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Names(Vec<String>);

impl Names {
    /// The names of a list such as `MAML, cloning`.
    pub fn typed(list: &str) -> Self {
        Self(parts(list).map(str::to_owned).collect())
    }

    /// Whether a name stands in the list.
    pub fn hold(&self, name: &str) -> bool {
        let name: Vec<&str> = parts(name).collect();
        self.0.windows(name.len()).any(|typed| typed == name)
    }

    /// The first of what was typed that is no name, nor part of one that was typed as a whole.
    pub fn unknown(&self, known: &[&str]) -> Option<&str> {
        let known: Vec<Vec<&str>> = known.iter().map(|name| parts(name).collect()).collect();
        let mut rest = self.0.as_slice();
        while let [first, ..] = rest {
            let begins =
                known.iter().filter(|name| rest.len() >= name.len() && rest[..name.len()] == name[..]);
            let Some(longest) = begins.map(Vec::len).max() else { return Some(first) };
            rest = &rest[longest..];
        }
        None
    }
}

fn parts(list: &str) -> impl Iterator<Item = &str> {
    list.split(',').map(str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: [&str; 4] = ["MAML", "MAML, cloned", "cloning", "oracle"];

    #[test]
    fn a_name_may_hold_a_comma() {
        let names = Names::typed("MAML, cloned,oracle");
        assert!(names.hold("MAML, cloned") && names.hold("oracle") && !names.hold("cloning"));
        assert_eq!(names.unknown(&KNOWN), None);
    }

    #[test]
    fn what_is_no_name_is_found() {
        for (typed, unknown) in [("cloned", "cloned"), ("MAML,oracel", "oracel"), ("cloning,", "")] {
            assert_eq!(Names::typed(typed).unknown(&KNOWN), Some(unknown), "{typed}");
        }
    }
}
