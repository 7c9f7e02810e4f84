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

/// Of the names in a message "unknown field `a`, expected one of `b`, `c`" those that differ from the first by case, or
/// by one or two characters: the nearest, at most three; else those that begin with it, or that it begins with.
pub(super) fn meant(message: &str) -> Vec<&str> {
    let mut names = message.split('`').skip(1).step_by(2);
    let Some(given) = names.next() else { return Vec::new() };
    let lower = given.to_lowercase();
    let begins = |long: &str, short: &str| short.len() >= 3 && long.starts_with(short);
    let alike = names.clone().filter(|name| begins(name, &lower) || begins(&lower, name)).take(3);
    let letters = |text: &str| {
        let mut letters: Vec<char> = text.chars().collect();
        letters.sort_unstable();
        letters
    };
    // Letters that changed places are one slip.
    let swapped = letters(&lower);
    let distance = |name: &str| match letters(name) == swapped {
        true => 0,
        false => edits(given, name).min(edits(&lower, &name.to_lowercase())),
    };
    let known: Vec<&str> = names.clone().collect();
    if let Some(unit) = crate::units::meant(given, &known) {
        return vec![unit];
    }
    let near: Vec<(usize, &str)> = names.clone().map(|name| (distance(name), name)).filter(|(n, _)| *n <= 2).collect();
    let least = near.iter().map(|(n, _)| *n).min();
    let nearest = near.into_iter().filter(|(n, name)| Some(*n) == least && *n < name.len() / 2);
    let nearest: Vec<&str> = nearest.map(|(_, name)| name).take(3).collect();
    if nearest.is_empty() { alike.collect() } else { nearest }
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
        assert_eq!(meant(&of("PITCH")), ["pitch"]);
        assert_eq!(meant(&of("cel")), ["cell"]);
        assert_eq!(meant("unknown variant `dfx`, expected one of `dxf`, `csv`"), ["dxf"]);
        assert_eq!(meant("unknown variant `hatching`, expected one of `hatch`, `dots`"), ["hatch"]);
        assert_eq!(meant("unknown variant `millimeters`, expected one of `mm`, `cm`, `in`"), ["mm"]);
        assert_eq!(meant("unknown field `direct`, expected `direction` or `x`"), ["direction"]);
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
