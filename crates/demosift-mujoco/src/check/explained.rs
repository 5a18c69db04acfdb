//! What seems to be behind actions that lead elsewhere, and what it leaves unexplained.

use demosift::data::demonstration::set_file::SetFile;

/// Something that explains what actions miss.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Explained {
    /// What seems to be so.
    pub(super) words: String,
    /// What a typical step misses then.
    pub(super) missed: f64,
    /// What makes it right; `None` where no `set.toml` can.
    pub(super) mend: Option<SetFile>,
}

impl Explained {
    /// What seems to be so, and what it leaves.
    pub(super) fn in_words(&self) -> String {
        format!("it seems that {} (then a typical step misses {})", self.words, percent_missed(self.missed))
    }
}

/// A share with a decimal; what is many times over says no more with all its digits.
pub fn percent_missed(share: f64) -> String {
    if share <= 10.0 { format!("{:.1} %", share * 100.0) } else { "over 1000 %".to_owned() }
}
