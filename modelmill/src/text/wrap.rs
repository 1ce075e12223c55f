//! Words in lines of a given length. A number and its unit stay on one line.

/// First words of units that follow numbers in texts.
const UNITS: [&str; 17] = [
    "%", "N", "m", "mm", "s", "ms", "rad", "rad/s", "rad/s^2", "m/s", "m/s^2", "kg", "Hz", "J", "W", "degrees", "times",
];
/// First letters of the words with which units such as `N m/rad` and `kg m^2` go on.
const UNIT_FACTORS: [&str; 2] = ["m", "s"];

/// Text in lines of at most `letters` letters. A longer word gets a line of its own.
pub fn wrap_words(text: &str, letters: usize) -> Vec<String> {
    let mut lines: Vec<String> = vec![String::new()];
    for group in unbroken_groups(text) {
        // Groups are appended to the last line as long as they fit.
        let line = lines.last_mut().expect("there is a line");
        if !line.is_empty() && line.chars().count() + 1 + group.chars().count() > letters {
            lines.push(group);
        } else {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(&group);
        }
    }
    lines
}

/// Words, and quantities such as `5.9 ± 0.2 N m/rad`, between which a line may end.
fn unbroken_groups(text: &str) -> Vec<String> {
    let mut groups: Vec<String> = Vec::new();
    let mut before = WordRole::Other;
    for word in text.split_whitespace() {
        let role = WordRole::from_word(word, before);
        match groups.last_mut() {
            Some(group) if role.continues(before) => {
                group.push(' ');
                group.push_str(word);
            }
            _ => groups.push(word.to_owned()),
        }
        // Punctuation ends a quantity.
        before = if word.ends_with([',', ';', '.', ':', ')']) {
            WordRole::Other
        } else {
            role
        };
    }
    groups
}

/// What a word is in a quantity.
#[derive(Clone, Copy, PartialEq, Eq)]
enum WordRole {
    /// A number.
    Number,
    /// The sign between a value and its standard deviation.
    PlusMinus,
    /// A unit, or a factor of it.
    Unit,
    /// Any other word.
    Other,
}

impl WordRole {
    /// The role of a word that follows one of the role `before`.
    fn from_word(word: &str, before: Self) -> Self {
        let bare = word.trim_start_matches('(').trim_end_matches([',', ';', '.', ':', ')']);
        let is_unit = match before {
            Self::Number => UNITS.contains(&bare),
            Self::Unit => UNIT_FACTORS.contains(&bare.split(['/', '^']).next().unwrap_or(bare)),
            Self::PlusMinus | Self::Other => false,
        };
        match bare {
            "±" => Self::PlusMinus,
            _ if is_unit => Self::Unit,
            _ if bare.parse::<f64>().is_ok() => Self::Number,
            _ => Self::Other,
        }
    }

    /// Whether a word of this role belongs to the word before it.
    fn continues(self, before: Self) -> bool {
        match self {
            Self::Unit => true,
            Self::PlusMinus => before == Self::Number,
            Self::Number => before == Self::PlusMinus,
            Self::Other => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::wrap_words;

    /// No line ends within a quantity, every line is short enough, and no word is lost.
    #[test]
    fn a_number_keeps_its_unit() {
        let text = "With it the error on the validation run falls from 27.1 % to 21.3 %. The estimate is 5.9929 ± 0.0063 N m/rad \
                    (rest = -1.0004 ± 0.0019 rad), or 8 kg m^2 after 0.5 s, of 12 samples in all.";
        for letters in 24..100 {
            let lines = wrap_words(text, letters);
            assert_eq!(
                lines.join(" ").split_whitespace().collect::<Vec<_>>(),
                text.split_whitespace().collect::<Vec<_>>()
            );
            for line in &lines {
                assert!(line.chars().count() <= letters, "{letters}: {line}");
                let first = line.split_whitespace().next().unwrap();
                for unit in ["%", "%.", "±", "N", "m/rad", "rad),", "kg", "m^2", "s,"] {
                    assert_ne!(first, unit, "{letters}: {lines:?}");
                }
            }
        }
        // Other words may begin a line, also after a number.
        assert_eq!(wrap_words("of 12 samples", 5), ["of 12", "samples"]);
    }
}
