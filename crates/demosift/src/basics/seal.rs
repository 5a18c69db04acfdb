//! A file that contains its own SHA-256, so that a changed bit is an error and never a result.
//!
//! The digest stands in the file as hexadecimal digits, and is that of the whole file with zeros in their place.
//! File and digest are one write, so nothing has to be kept in step, no matter who else writes into the same folder, and a file
//! that is copied elsewhere stays whole.

use serde::Serialize;
use sha2::{Digest as _, Sha256};

use crate::basics::error::{Error, Result};
use crate::basics::files;

/// Digits of a digest.
pub const DIGITS: usize = 64;

/// What stands in the place of the digest until the file is sealed.
pub const OPEN: [u8; DIGITS] = [b'0'; DIGITS];

/// The first line of sealed JSON, around the digest.
const JSON_HEAD: &[u8] = b"{\n  \"sha256\": \"";
const JSON_TAIL: &[u8] = b"\",\n";

/// Puts the digest of all bytes to its place.
///
/// # Panics
/// If [`OPEN`] does not stand there: a bug of the caller.
pub fn seal(bytes: &mut [u8], place: usize) {
    assert_eq!(bytes[place..place + DIGITS], OPEN, "the place of the digest");
    let digest = digest(bytes, place);
    bytes[place..place + DIGITS].copy_from_slice(digest.as_bytes());
}

/// Whether bytes are those that were sealed; there may be no place where a digest stands.
///
/// # Errors
/// `is_bad_input`, which names the file and says the way out.
pub fn check(bytes: &[u8], place: Option<usize>, name: &str) -> Result<()> {
    let held = place.and_then(|place| Some((place, bytes.get(place..place + DIGITS)?)));
    match held {
        Some((place, held)) if held == digest(bytes, place).as_bytes() => Ok(()),
        Some(_) => Err(Error::bad_input(format!(
            "{name} is not as it was written: it is damaged, or was changed by hand"
        ))
        .with_hint(WAY_OUT)),
        None => {
            Err(Error::bad_input(format!("{name} holds no checksum, so it is damaged, or was made by hand"))
                .with_hint(WAY_OUT))
        }
    }
}

const WAY_OUT: &str = "delete this file and go on with --resume, which makes it again";

/// Plain data as JSON that is sealed in its first line.
pub fn to_json(content: &impl Serialize) -> Vec<u8> {
    to_json_with(content, |indented| format!("{indented}\n"))
}

/// The same written another way, of which the first line is the opening brace.
pub fn to_json_with(content: &impl Serialize, written: impl FnOnce(&str) -> String) -> Vec<u8> {
    let text = written(&serde_json::to_string_pretty(content).expect("plain data always serializes"));
    let body = text.strip_prefix("{\n").expect("what is sealed has fields").as_bytes();
    let mut bytes = [JSON_HEAD, &OPEN, JSON_TAIL, body].concat();
    seal(&mut bytes, JSON_HEAD.len());
    bytes
}

/// The JSON that was sealed, without the line of the digest.
///
/// # Errors
/// As those of [`check`].
pub fn of_json(bytes: &[u8], name: &str) -> Result<Vec<u8>> {
    check(bytes, bytes.starts_with(JSON_HEAD).then_some(JSON_HEAD.len()), name)?;
    Ok([b"{\n", &bytes[JSON_HEAD.len() + DIGITS + JSON_TAIL.len()..]].concat())
}

/// The same for JSON that may have been written before there were checksums.
///
/// # Errors
/// As those of [`check`], where the JSON is sealed.
pub fn of_json_if_sealed(bytes: Vec<u8>, name: &str) -> Result<Vec<u8>> {
    if bytes.starts_with(JSON_HEAD) { of_json(&bytes, name) } else { Ok(bytes) }
}

fn digest(bytes: &[u8], place: usize) -> String {
    let hash = Sha256::new().chain_update(&bytes[..place]).chain_update(OPEN);
    files::hexadecimal(&hash.chain_update(&bytes[place + DIGITS..]).finalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, Serialize, serde::Deserialize)]
    struct Noun {
        version: u32,
        names: Vec<String>,
    }

    #[test]
    fn every_flipped_bit_and_every_cut_is_told() {
        let noun = Noun { version: 3, names: vec!["a".to_owned(), "b".to_owned()] };
        let whole = to_json(&noun);
        let back: Noun = serde_json::from_slice(&of_json(&whole, "x").expect("whole")).expect("JSON");
        assert_eq!(back, noun);
        for bit in 0..8 * whole.len() {
            let mut bytes = whole.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let error = of_json(&bytes, "noun.json").expect_err("damaged");
            assert!(error.to_string().starts_with("noun.json ") && error.hint().is_some(), "{error}");
        }
        for length in 0..whole.len() {
            assert!(of_json(&whole[..length], "x").is_err(), "{length}");
        }
        assert!(of_json(&[&whole[..], b"\n"].concat(), "x").is_err());
    }

    /// What `sha256sum` says of the file with zeros in the place of the digest.
    #[test]
    fn the_digest_is_that_of_the_file_with_zeros_in_its_place() {
        let mut bytes = [b"id ", &OPEN[..], b" rest"].concat();
        let plain = files::sha256_of(&bytes);
        seal(&mut bytes, 3);
        assert_eq!(&bytes[3..3 + DIGITS], plain.as_bytes());
    }
}
