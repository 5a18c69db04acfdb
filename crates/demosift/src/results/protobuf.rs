//! Protocol buffers, written: what ONNX and TensorBoard store their files in.
//!
//! A message is its fields one after the other, each behind a key that holds its number and its wire type
//! (<https://protobuf.dev/programming-guides/encoding>).
//! The same fields in the same order are the same bytes.

/// How the value of a field is stored.
#[derive(Clone, Copy)]
enum Wire {
    Varint = 0,
    Fixed64 = 1,
    Length = 2,
    Fixed32 = 5,
}

/// A message; each method appends one field by its number in the schema.
#[derive(Clone, Debug, Default, PartialEq)]
#[must_use]
pub(crate) struct Message(Vec<u8>);

impl Message {
    /// A field of type `int64`, `int32` or an enumeration, not negative.
    pub(crate) fn integer(mut self, field: u64, value: u64) -> Self {
        self.key(field, Wire::Varint);
        self.varint(value);
        self
    }

    /// A field of type `float`.
    pub(crate) fn float(mut self, field: u64, value: f32) -> Self {
        self.key(field, Wire::Fixed32);
        self.0.extend(value.to_le_bytes());
        self
    }

    /// A field of type `double`.
    pub(crate) fn double(mut self, field: u64, value: f64) -> Self {
        self.key(field, Wire::Fixed64);
        self.0.extend(value.to_le_bytes());
        self
    }

    /// A field of type `string`.
    pub(crate) fn text(self, field: u64, value: &str) -> Self {
        self.bytes(field, value.as_bytes())
    }

    /// A field of type `bytes`.
    pub(crate) fn bytes(mut self, field: u64, value: &[u8]) -> Self {
        self.key(field, Wire::Length);
        self.varint(value.len() as u64);
        self.0.extend_from_slice(value);
        self
    }

    /// A field that is a message itself.
    pub(crate) fn message(self, field: u64, value: &Message) -> Self {
        self.bytes(field, &value.0)
    }

    /// A repeated field, one message after the other.
    pub(crate) fn messages(self, field: u64, values: impl IntoIterator<Item = Message>) -> Self {
        values.into_iter().fold(self, |whole, value| whole.message(field, &value))
    }

    /// The message as it is stored.
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.0
    }

    fn key(&mut self, field: u64, wire: Wire) {
        self.varint(field << 3 | wire as u64);
    }

    /// Seven bits a byte, the lowest first; the highest bit of a byte says that more follow.
    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of the encoding's own documentation: 150 in field 1, "testing" in field 2, and the first inside field 3.
    #[test]
    fn messages_are_those_of_the_documentation() {
        let number = Message::default().integer(1, 150);
        assert_eq!(number.0, [0x08, 0x96, 0x01]);
        let word = Message::default().text(2, "testing");
        assert_eq!(word.0, [0x12, 0x07, b't', b'e', b's', b't', b'i', b'n', b'g']);
        assert_eq!(Message::default().message(3, &number).0, [0x1a, 0x03, 0x08, 0x96, 0x01]);
    }

    #[test]
    fn varints_of_every_length_and_fixed_numbers_are_little_endian() {
        let varint = |value| Message::default().integer(1, value).0[1..].to_vec();
        assert_eq!(varint(0), [0]);
        assert_eq!(varint(127), [0x7f]);
        assert_eq!(varint(128), [0x80, 1]);
        assert_eq!(varint(u64::MAX), [[0xff; 9].as_slice(), &[1]].concat());
        assert_eq!(Message::default().float(5, 1.0).0, [0x2d, 0, 0, 0x80, 0x3f]);
        assert_eq!(Message::default().double(1, -2.0).0, [0x09, 0, 0, 0, 0, 0, 0, 0, 0xc0]);
        // From field 16 on the key takes two bytes.
        assert_eq!(Message::default().integer(16, 1).0, [0x80, 1, 1]);
    }
}
