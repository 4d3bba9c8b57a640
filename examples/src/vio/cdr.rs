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
