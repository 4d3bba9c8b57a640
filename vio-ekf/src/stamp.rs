//! Time in integer nanoseconds.

use std::fmt;
use std::str::FromStr;

/// A text is no decimal number of seconds that fits 64-bit nanoseconds.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is not a time in seconds between -9.2e9 and 9.2e9: check the first column")]
pub struct InvalidStamp {
    /// The text, or the number, as given.
    pub text: String,
}

/// A time in integer nanoseconds; the epoch is whatever the recording uses.
///
/// Seconds since 1970 need 61 bits at this resolution, more than the 53 of an `f64`, hence the integer. Text in decimal
/// seconds is converted digit by digit, never through an `f64`.
///
/// ```
/// use vio_ekf::Stamp;
/// let stamp: Stamp = "1403636580.838555574".parse()?;
/// assert_eq!(stamp.nanos(), 1_403_636_580_838_555_574);
/// assert_eq!("1.403636580838555574e+09".parse(), Ok(stamp));
/// assert_eq!(stamp.to_string(), "1403636580.838555574");
/// # Ok::<(), vio_ekf::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Stamp(i64);

impl Stamp {
    /// From nanoseconds.
    pub const fn from_nanos(nanos: i64) -> Self {
        Self(nanos)
    }

    /// From seconds, rounded to the nearest nanosecond. Refuses NaN and what does not fit.
    pub fn from_secs(secs: f64) -> Result<Self, InvalidStamp> {
        let nanos = (secs * 1e9).round();
        // 2^63 is exact in f64, the largest i64 is not.
        if (-9_223_372_036_854_775_808.0..9_223_372_036_854_775_808.0).contains(&nanos) {
            Ok(Self(nanos as i64))
        } else {
            Err(InvalidStamp { text: secs.to_string() })
        }
    }

    /// Nanoseconds.
    pub const fn nanos(self) -> i64 {
        self.0
    }

    /// Seconds, to the resolution of an `f64` (about 0.2 µs for dates of this century).
    pub fn as_secs(self) -> f64 {
        self.0 as f64 / 1e9
    }

    /// A time some seconds later, rounded to the nearest nanosecond; at the ends of the range it stays there.
    #[must_use]
    pub fn plus_secs(self, secs: f64) -> Self {
        Self(self.0.saturating_add((secs * 1e9).round() as i64))
    }

    /// Seconds from `earlier` to `self`, negative if `earlier` is later; formed from the exact integer difference.
    pub fn secs_since(self, earlier: Self) -> f64 {
        (i128::from(self.0) - i128::from(earlier.0)) as f64 / 1e9
    }
}

impl fmt::Display for Stamp {
    /// Decimal seconds with all nine decimals.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let magnitude = self.0.unsigned_abs();
        let sign = if self.0 < 0 { "-" } else { "" };
        write!(f, "{sign}{}.{:09}", magnitude / 1_000_000_000, magnitude % 1_000_000_000)
    }
}

impl FromStr for Stamp {
    type Err = InvalidStamp;

    /// Reads decimal seconds, with or without a power of ten.
    fn from_str(text: &str) -> Result<Self, InvalidStamp> {
        scaled_integer(text, 9).map(Self).ok_or_else(|| InvalidStamp { text: text.to_owned() })
    }
}

/// `text · 10^power` rounded to the nearest integer (halves away from zero), without any loss on the way.
pub(crate) fn scaled_integer(text: &str, power: i32) -> Option<i64> {
    let (mantissa, exponent) = match text.find(['e', 'E']) {
        Some(at) => (&text[..at], text[at + 1..].parse::<i32>().ok().filter(|e| e.abs() < 100)?),
        None => (text, 0),
    };
    let (negative, digits) = match mantissa.as_bytes().first()? {
        b'-' => (true, &mantissa[1..]),
        b'+' => (false, &mantissa[1..]),
        _ => (false, mantissa),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    if whole.is_empty() && fraction.is_empty() {
        return None;
    }
    let mut value = 0_i128;
    for byte in whole.bytes().chain(fraction.bytes()) {
        if !byte.is_ascii_digit() {
            return None;
        }
        value = value.checked_mul(10)?.checked_add(i128::from(byte - b'0'))?;
    }
    let shift = exponent + power - i32::try_from(fraction.len()).ok()?;
    let magnitude = if shift >= 0 {
        if value == 0 { 0 } else { value.checked_mul(10_i128.checked_pow(shift.unsigned_abs())?)? }
    } else {
        // A divisor beyond 10^38 leaves nothing of any i128.
        10_i128
            .checked_pow(shift.unsigned_abs())
            .map_or(0, |divisor| value / divisor + i128::from(value % divisor >= divisor - divisor / 2))
    };
    i64::try_from(if negative { -magnitude } else { magnitude }).ok()
}
