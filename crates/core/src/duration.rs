//! Times as people read them.

/// A duration for reading: `4.2 s`, `12 min 5 s`, `3 h 12 min`.
pub fn duration(s: f64) -> String {
    let whole = s.max(0.0).round() as u64;
    match whole {
        // What would be rounded to 60.0 s is a minute.
        _ if s < 59.95 => format!("{:.1} s", s.max(0.0)),
        ..3600 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_formatted_in_words() {
        let said = [0.0, 4.24, 59.94, 59.96, 725.2, 3599.6, 11_520.0].map(duration);
        assert_eq!(said, ["0.0 s", "4.2 s", "59.9 s", "1 min 0 s", "12 min 5 s", "1 h 0 min", "3 h 12 min"]);
        assert_eq!(duration(-1.0), "0.0 s");
    }
}
