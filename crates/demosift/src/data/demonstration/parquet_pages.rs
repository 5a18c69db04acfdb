//! What the pages of a parquet column say of their own size, before anybody believes them.
//!
//! The decoder asks for as much memory as a page's header claims, which in a damaged file may be gigabytes.
//! So the headers, structs in Thrift's compact protocol, are looked through first.

use crate::data::demonstration::hdf5::MOST_COMPRESSION;

/// What a page header claims.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Claims {
    /// Numbers and gaps of all data pages.
    pub(super) values: u64,
    /// Numbers of the fullest page.
    pub(super) most_values: u64,
}

/// What a page's header says.
pub(super) struct Header {
    pub(super) kind: Kind,
    /// Bytes of the page when it is not compressed.
    pub(super) uncompressed: u64,
    /// Numbers and gaps.
    pub(super) values: u64,
    /// The number of the encoding in `parquet.thrift`.
    pub(super) encoding: u64,
}

/// What a page is.
pub(super) enum Kind {
    Dictionary,
    Data { definition: u64, repetition: u64 },
    DataV2 { gaps: u64, rows: u64, definition_len: u64, repetition_len: u64, is_compressed: bool },
    Other,
}

/// The header of the page at the start of `chunk`, the bytes of the page, and the length of both together.
pub(super) fn page(chunk: &[u8]) -> Option<(Header, &[u8], usize)> {
    const UNCOMPRESSED_BYTES: i16 = 2;
    const BYTES: i16 = 3;
    const DATA_PAGE: i16 = 5;
    const DICTIONARY_PAGE: i16 = 7;
    const DATA_PAGE_V2: i16 = 8;
    let mut rest = Bytes(chunk);
    let fields = rest.read_struct(DEEPEST)?;
    let number = |fields: &[(i16, Field)], id| find(fields, id).and_then(Field::number);
    let (len, uncompressed) = (number(&fields, BYTES)?, number(&fields, UNCOMPRESSED_BYTES)?);
    let mut header = Header { kind: Kind::Other, uncompressed, values: 0, encoding: 0 };
    for id in [DATA_PAGE, DICTIONARY_PAGE, DATA_PAGE_V2] {
        let Some(Field::Struct(page)) = find(&fields, id) else { continue };
        header.values = number(page, 1)?;
        let or_0 = |id| number(page, id).unwrap_or(0);
        header.encoding = or_0(if id == DATA_PAGE_V2 { 4 } else { 2 });
        header.kind = match id {
            DICTIONARY_PAGE => Kind::Dictionary,
            DATA_PAGE => Kind::Data { definition: or_0(3), repetition: or_0(4) },
            _ => Kind::DataV2 {
                gaps: or_0(2),
                rows: or_0(3),
                definition_len: or_0(5),
                repetition_len: or_0(6),
                is_compressed: !matches!(find(page, 7), Some(Field::Flag(false))),
            },
        };
    }
    let bytes = rest.take(usize::try_from(len).ok()?)?;
    Some((header, bytes, chunk.len() - rest.0.len()))
}

/// The claims of all pages of a column chunk; `None` if a header cannot be read, or claims more bytes than its page can hold.
///
/// A page may always claim `free` bytes: zstd makes a few of however many that are alike.
pub(super) fn claims(chunk: &[u8], free: u64) -> Option<Claims> {
    const BY_DICTIONARY: [u64; 2] = [2, 8];
    let mut claims = Claims { values: 0, most_values: 0 };
    let mut has_dictionary = false;
    let mut rest = chunk;
    while !rest.is_empty() {
        let (header, bytes, len) = page(rest)?;
        // A page of nothing but gaps is empty, and so are small pages before they are compressed.
        let most = (bytes.len() as u64).saturating_mul(MOST_COMPRESSION).saturating_add(MOST_COMPRESSION);
        if header.uncompressed > most.max(free) {
            return None;
        }
        has_dictionary |= matches!(header.kind, Kind::Dictionary);
        let is_of_data = matches!(header.kind, Kind::Data { .. } | Kind::DataV2 { .. });
        // The decoder panics where a page means words of a dictionary that never came.
        if is_of_data && BY_DICTIONARY.contains(&header.encoding) && !has_dictionary {
            return None;
        }
        claims.most_values = claims.most_values.max(header.values);
        // Claims of many pages may add up to more than there are numbers for.
        let of_data = if matches!(header.kind, Kind::Dictionary) { 0 } else { header.values };
        claims.values = claims.values.saturating_add(of_data);
        rest = &rest[len..];
    }
    Some(claims)
}

/// Page headers are not nested deeper.
const DEEPEST: usize = 6;

/// A field of a struct, as far as it is of interest.
enum Field {
    Number(i64),
    Struct(Vec<(i16, Field)>),
    Flag(bool),
    Other,
}

impl Field {
    /// A number that counts something.
    fn number(&self) -> Option<u64> {
        match self {
            Self::Number(number) => u64::try_from(*number).ok(),
            _ => None,
        }
    }
}

fn find(fields: &[(i16, Field)], id: i16) -> Option<&Field> {
    fields.iter().find(|(known, _)| *known == id).map(|(_, field)| field)
}

/// Bytes that are still to be read.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, len: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(len)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|byte| byte[0])
    }

    /// Seven bits a byte, the lowest first.
    fn varint(&mut self) -> Option<u64> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }

    /// Signs alternate: 0, −1, 1, −2, …
    fn signed(&mut self) -> Option<i64> {
        let number = self.varint()?;
        Some((number >> 1) as i64 ^ -((number & 1) as i64))
    }

    fn read_struct(&mut self, deepest: usize) -> Option<Vec<(i16, Field)>> {
        let mut fields = Vec::new();
        let mut id: i16 = 0;
        loop {
            let byte = self.byte()?;
            if byte == 0 {
                return Some(fields);
            }
            id = match byte >> 4 {
                0 => i16::try_from(self.signed()?).ok()?,
                step => id.checked_add(i16::from(step))?,
            };
            // Truth stands in the type itself.
            let field = match byte & 0x0f {
                kind @ (1 | 2) => Field::Flag(kind == 1),
                kind => self.read(kind, deepest)?,
            };
            fields.push((id, field));
        }
    }

    /// A value of one of the protocol's types.
    fn read(&mut self, kind: u8, deepest: usize) -> Option<Field> {
        let deeper = deepest.checked_sub(1)?;
        match kind {
            1..=3 => self.byte().map(|_| Field::Other),
            4..=6 => self.signed().map(Field::Number),
            7 => self.take(8).map(|_| Field::Other),
            8 => {
                let len = usize::try_from(self.varint()?).ok()?;
                self.take(len).map(|_| Field::Other)
            }
            9 | 10 => {
                let byte = self.byte()?;
                let count = if byte >> 4 == 15 { self.varint()? } else { u64::from(byte >> 4) };
                for _ in 0..count {
                    self.read(byte & 0x0f, deeper)?;
                }
                Some(Field::Other)
            }
            12 => self.read_struct(deeper).map(Field::Struct),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Written by hand after the compact protocol: type 0, uncompressed 40, compressed 3, then a data page of 10 values.
    const HEADER: [u8; 15] = [0x15, 0, 0x15, 80, 0x15, 6, 0x2c, 0x15, 20, 0x15, 0, 0x15, 6, 0, 0];

    #[test]
    fn headers_are_followed_from_page_to_page() {
        let page = [&HEADER[..], &[1, 2, 3]].concat();
        let chunk = [page.clone(), page].concat();
        assert_eq!(claims(&chunk, 0), Some(Claims { values: 20, most_values: 10 }));
        assert_eq!(claims(&chunk[..chunk.len() - 1], 0), None, "cut off");
    }

    #[test]
    fn a_claim_of_gigabytes_is_refused() {
        let mut page = [&HEADER[..], &[1, 2, 3]].concat();
        page.splice(3..4, [0xfe, 0xff, 0xff, 0xff, 0x0f]);
        assert_eq!(claims(&page, 0), None);
    }

    #[test]
    fn a_page_of_a_dictionary_that_never_came_is_refused() {
        let mut page = [&HEADER[..], &[1, 2, 3]].concat();
        // The encoding, in which a dictionary is number 8.
        page[10] = 16;
        assert_eq!(claims(&page, 0), None);
    }

    #[test]
    fn claims_that_overflow_together_stay_too_large() {
        let mut page = HEADER.to_vec();
        // The most that a signed number of 64 bits can be, in place of 10 values.
        page.splice(8..9, [0xfe, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01]);
        page.extend([1, 2, 3]);
        let most = i64::MAX.unsigned_abs();
        assert_eq!(claims(&page, 0), Some(Claims { values: most, most_values: most }));
        assert_eq!(claims(&page.repeat(3), 0), Some(Claims { values: u64::MAX, most_values: most }));
    }
}
