//! As much of the encoding of ROS 2 messages (CDR) as images and inertial samples need.

use vio_ekf::Stamp;

/// Reads values one after the other; `None` at the end of the bytes.
pub(super) struct Cdr<'a> {
    /// After the four bytes that name the encoding: alignment counts from here.
    bytes: &'a [u8],
    at: usize,
    little: bool,
}

impl<'a> Cdr<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Option<Self> {
        let (head, body) = bytes.split_at_checked(4)?;
        // The plain encoding only: 0 for big, 1 for little endian.
        (head[0] == 0 && head[1] <= 1).then_some(Self { bytes: body, at: 0, little: head[1] == 1 })
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(count)?;
        let bytes = self.bytes.get(self.at..end)?;
        self.at = end;
        Some(bytes)
    }

    /// A number of `N` bytes, which lies at a multiple of `N`, in little endian.
    fn scalar<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.at = self.at.checked_next_multiple_of(N)?;
        let mut bytes: [u8; N] = self.take(N)?.try_into().ok()?;
        if !self.little {
            bytes.reverse();
        }
        Some(bytes)
    }

    pub(super) fn byte(&mut self) -> Option<u8> {
        self.scalar::<1>().map(|[byte]| byte)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.scalar().map(u32::from_le_bytes)
    }

    pub(super) fn f64s<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = f64::from_le_bytes(self.scalar()?);
        }
        Some(values)
    }

    pub(super) fn blob(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()? as usize;
        self.take(count)
    }

    pub(super) fn string(&mut self) -> Option<&'a str> {
        let bytes = self.blob()?;
        std::str::from_utf8(bytes.strip_suffix(&[0]).unwrap_or(bytes)).ok()
    }

    /// `std_msgs/Header`: time and frame.
    pub(super) fn header(&mut self) -> Option<(Stamp, &'a str)> {
        let seconds = i64::from(i32::from_le_bytes(self.scalar()?));
        let nanos = i64::from(self.u32()?);
        Some((Stamp::from_nanos(seconds * 1_000_000_000 + nanos), self.string()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A header, a byte and a number, in both orders of bytes: from the rules of the encoding, not from our writer.
    #[test]
    fn both_byte_orders_are_read_and_alignment_counts_from_the_fifth_byte() {
        // The number lies at the sixteenth byte of the body, the twentieth of all: no padding, if counted rightly.
        let text = [b'a', b'b', 0, 5];
        let little = [&[0, 1, 0, 0, 7, 0, 0, 0, 9, 0, 0, 0, 3, 0, 0, 0], &text[..], &1.5_f64.to_le_bytes()].concat();
        let big = [&[0, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0, 9, 0, 0, 0, 3], &text[..], &1.5_f64.to_be_bytes()].concat();
        for bytes in [little, big] {
            let mut cdr = Cdr::new(&bytes).unwrap_or_else(|| panic!("no encoding"));
            assert_eq!(cdr.header(), Some((Stamp::from_nanos(7_000_000_009), "ab")));
            assert_eq!(cdr.byte(), Some(5));
            assert_eq!(cdr.f64s::<1>().map(|[v]| v), Some(1.5));
            assert_eq!(cdr.byte(), None);
        }
        assert!(Cdr::new(&[0, 3, 0, 0]).is_none() && Cdr::new(&[0]).is_none());
        // A length beyond the end.
        assert_eq!(Cdr::new(&[0, 1, 0, 0, 255, 255, 255, 255, 1]).and_then(|mut cdr| cdr.string()), None);
    }
}
