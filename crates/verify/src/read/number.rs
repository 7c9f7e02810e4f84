//! Numbers of text files, read exactly: a decimal in mm is a whole number of nanometres or a fault.

use terrace_core::geom::{MAX_NM, Nm};

/// Decimals of a millimetre that make a nanometre.
const DECIMALS: usize = 6;

/// An integer with an optional sign; None for anything else, also beyond i64.
pub(crate) fn integer(text: &[u8]) -> Option<i64> {
    let (negative, digits) = match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    };
    if digits.is_empty() {
        return None;
    }
    let mut value: i64 = 0;
    for &c in digits {
        if !c.is_ascii_digit() {
            return None;
        }
        value = value.checked_mul(10)?.checked_add(i64::from(c - b'0'))?;
    }
    Some(if negative { -value } else { value })
}

/// A coordinate in mm as nm; None where it is not finite or beyond 4 m.
pub(crate) fn nm_from_mm(mm: f64) -> Option<i64> {
    Nm::from_mm(mm).map(|Nm(nm)| nm)
}

/// A plain decimal in mm as nm; None where it is not a plain decimal, finer than 1 nm or beyond 4 m.
pub(crate) fn nm_from_decimal(text: &[u8]) -> Option<i64> {
    millionths(text).filter(|nm| nm.abs() <= MAX_NM.0)
}

/// A plain decimal in millionths; None where it is not one, or finer.
pub(crate) fn millionths(text: &[u8]) -> Option<i64> {
    let (negative, digits) = match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    };
    let mut value: i64 = 0;
    let mut decimals = None;
    let mut seen = false;
    for &c in digits {
        match (c, decimals) {
            (b'.', None) => decimals = Some(0),
            (b'0', Some(DECIMALS)) => {}
            (b'0'..=b'9', _) if decimals.is_none_or(|d| d < DECIMALS) => {
                seen = true;
                decimals = decimals.map(|d| d + 1);
                value = value.checked_mul(10)?.checked_add(i64::from(c - b'0'))?;
            }
            _ => return None,
        }
    }
    for _ in decimals.unwrap_or(0)..DECIMALS {
        value = value.checked_mul(10)?;
    }
    seen.then_some(if negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_are_exact_nanometres_or_refused() {
        for (text, nm) in [
            ("20.000000", 20_000_000),
            ("-0.000001", -1),
            ("-0.0", 0),
            ("+3", 3_000_000),
            (".5", 500_000),
            ("7.", 7_000_000),
            ("1.12345600", 1_123_456),
            ("4000", MAX_NM.0),
        ] {
            assert_eq!(nm_from_decimal(text.as_bytes()), Some(nm), "{text}");
        }
        for text in ["", ".", "-", "1e3", "1.2.3", "0.0000001", "nan", "4000.000001", "99999999999999999999", "1,5"] {
            assert_eq!(nm_from_decimal(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn integers_refuse_what_overflows() {
        assert_eq!(integer(b"-42"), Some(-42));
        for text in ["", "-", "4x", "9223372036854775808", "1.0"] {
            assert_eq!(integer(text.as_bytes()), None, "{text}");
        }
    }
}
