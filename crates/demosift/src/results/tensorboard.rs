//! Measurements as records of a TensorBoard event file.
//!
//! An event file is a row of framed records: the length of an event, a checksum of the length, the event, a checksum of
//! the event (TensorFlow, `record_writer.h`); an event is a protocol buffer (`event.proto`, `summary.proto`).
//!
//! An event wants to know when it happened. The library has no clock, and a run of the same seed is to leave the same
//! bytes, so the clock of an event is its place in the file: one second a measurement. Step is the horizontal axis that
//! means something; "relative" and "wall" count measurements.

use crate::results::protobuf::Message;

/// What an event file begins with: the version of its events.
pub fn first_record() -> Vec<u8> {
    framed(&Message::default().text(3, "brain.Event:2").into_bytes())
}

/// One measurement as a record; `place` is how many measurements the file holds before it.
///
/// Each number has the tag `stage/part/number`, or `stage/number` for a stage of one part, since TensorBoard puts what
/// agrees up to the first slash into one group. A number that is not finite was not measured, and has no point.
pub fn record<'a>(
    place: usize,
    stage: &str,
    part: &str,
    iteration: u64,
    numbers: impl IntoIterator<Item = (&'a str, f64)>,
) -> Vec<u8> {
    let prefix = if part.is_empty() { stage.to_owned() } else { format!("{stage}/{part}") };
    let measured = numbers.into_iter().filter(|(_, value)| value.is_finite());
    let points = measured
        .map(|(name, value)| Message::default().text(1, &format!("{prefix}/{name}")).float(2, value as f32));
    let summary = Message::default().messages(1, points);
    let event = Message::default().double(1, (place + 1) as f64).integer(2, iteration).message(5, &summary);
    framed(&event.into_bytes())
}

fn framed(event: &[u8]) -> Vec<u8> {
    let length = (event.len() as u64).to_le_bytes();
    let checksum = |bytes| masked(crc32c(bytes)).to_le_bytes();
    [&length, &checksum(&length)[..], event, &checksum(event)].concat()
}

/// So that a checksum of bytes that hold checksums is no trivial one.
fn masked(crc: u32) -> u32 {
    crc.rotate_right(15).wrapping_add(0xa282_ead8)
}

/// The cyclic redundancy check of Castagnoli's polynomial, lowest bit first (RFC 3720, section 12.1).
fn crc32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, byte| crc >> 8 ^ CRC_OF_BYTE[usize::from(crc as u8 ^ byte)])
}

/// What each lowest byte does to a checksum.
const CRC_OF_BYTE: [u32; 256] = {
    const POLYNOMIAL: u32 = 0x82f6_3b78;
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ POLYNOMIAL } else { crc >> 1 };
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 3720, appendix B.4, and the check value of the catalog of such codes.
    #[test]
    fn crc32c_agrees_with_published_vectors() {
        let count_up: Vec<u8> = (0..32).collect();
        let count_down: Vec<u8> = (0..32).rev().collect();
        assert_eq!(crc32c(&[0; 32]), 0x8a91_36aa);
        assert_eq!(crc32c(&[0xff; 32]), 0x62a8_ab43);
        assert_eq!(crc32c(&count_up), 0x46dd_794e);
        assert_eq!(crc32c(&count_down), 0x113f_db5c);
        assert_eq!(crc32c(b"123456789"), 0xe306_9283);
    }

    /// What TensorBoard's own writer makes of the same; tests/references/tensorboard_record.py prints it.
    #[test]
    fn records_are_those_that_tensorboard_writes() {
        let first = "0f000000000000006d532b091a0d627261696e2e4576656e743a32fc985129";
        let measured = "53000000000000000d7d4e91090000000000d0724010e8072a450a220a1b6a756467652f64656d6f6e737472617469\
                        6f6e20332f73636f726515cdcccc3d0a1f0a186a756467652f64656d6f6e7374726174696f6e20332f6b6c15caf249\
                        f16b8f7fa7";
        let hexadecimal = |bytes: Vec<u8>| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        assert_eq!(hexadecimal(first_record()), first);
        let numbers = [("score", 0.1), ("success", f64::NAN), ("kl", -1e30)];
        assert_eq!(hexadecimal(record(300, "judge", "demonstration 3", 1000, numbers)), measured);
    }

    #[test]
    fn a_stage_of_one_part_has_no_part_in_its_tags() {
        let record = record(0, "meta_train", "", 7, [("kl", 0.5)]);
        let tag = b"\x0dmeta_train/kl\x15";
        assert!(record.windows(tag.len()).any(|bytes| bytes == tag), "{record:?}");
    }
}
