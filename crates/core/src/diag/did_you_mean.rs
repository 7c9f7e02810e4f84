//! Which known name is meant by one that is not known.

/// How many characters must be put in, left out or changed to make one text of the other (Wagner and Fischer 1974).
pub fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    // Row i holds the distances of the first i characters of `a` to all beginnings of `b`.
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, &y) in b.iter().enumerate() {
            let change = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = change.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

/// Of the names in a message "unknown field `a`, expected one of `b`, `c`" those that differ from the first by one or
/// two characters: the nearest, at most three.
pub(super) fn meant(message: &str) -> Vec<&str> {
    let mut names = message.split('`').skip(1).step_by(2);
    let Some(given) = names.next() else { return Vec::new() };
    let near: Vec<(usize, &str)> = names.map(|name| (edits(given, name), name)).filter(|(n, _)| *n <= 2).collect();
    let least = near.iter().map(|(n, _)| *n).min();
    let nearest = near.into_iter().filter(|(n, name)| Some(*n) == least && *n < name.len() / 2);
    nearest.map(|(_, name)| name).take(3).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_name_is_answered_with_the_nearest_that_is_known() {
        let of =
            |given: &str| format!("unknown field `{given}`, expected one of `pitch`, `pen`, `pens`, `unit`, `cell`");
        assert_eq!(meant(&of("pitsh")), ["pitch"]);
        assert_eq!(meant(&of("Unit")), ["unit"]);
        assert_eq!(meant(&of("penn")), ["pens"]);
        assert!(meant(&of("speed")).is_empty());
        assert!(meant("unknown field").is_empty());
    }

    #[test]
    fn edits_are_counted() {
        for (a, b, n) in
            [("", "", 0), ("abc", "abc", 0), ("abc", "", 3), ("sample", "sampel", 2), ("kitten", "sitting", 3)]
        {
            assert_eq!((edits(a, b), edits(b, a)), (n, n), "{a} {b}");
        }
    }
}
