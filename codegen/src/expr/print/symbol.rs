//! Names as they are typeset: `theta1` as a Greek letter with an index, `dc1` as d with the index c1.

/// A name with the number of its time derivatives.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FormulaSymbol {
    /// Identifier, as in the model file.
    pub name: String,
    /// How often it is derived by time: 0, 1 or 2.
    pub order: u8,
}

impl FormulaSymbol {
    /// A name without derivatives.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            order: 0,
        }
    }

    /// A time derivative of a name.
    pub fn time_derivative(name: impl Into<String>, order: u8) -> Self {
        Self {
            name: name.into(),
            order,
        }
    }

    /// As plain text: `theta1`, `theta1_d`, `theta1_dd`.
    pub fn text(&self) -> String {
        match self.order {
            0 => self.name.clone(),
            1 => format!("{}_d", self.name),
            _ => format!("{}_dd", self.name),
        }
    }
}

/// A stretch of a typeset name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum GlyphRun {
    /// A Greek letter: LaTeX command and character.
    Greek(&'static str, char),
    /// A letter, or letters and digits of an index.
    Italic(String),
    /// A word that is read as one.
    Word(String),
}

/// A letter or word with an index of several parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TypesetName {
    pub(crate) base: GlyphRun,
    pub(crate) index: Vec<Vec<GlyphRun>>,
}

const GREEK: [(&str, char); 29] = [
    ("alpha", 'α'),
    ("beta", 'β'),
    ("gamma", 'γ'),
    ("delta", 'δ'),
    ("epsilon", 'ε'),
    ("zeta", 'ζ'),
    ("eta", 'η'),
    ("theta", 'θ'),
    ("iota", 'ι'),
    ("kappa", 'κ'),
    ("lambda", 'λ'),
    ("mu", 'μ'),
    ("nu", 'ν'),
    ("xi", 'ξ'),
    ("pi", 'π'),
    ("rho", 'ρ'),
    ("sigma", 'σ'),
    ("tau", 'τ'),
    ("phi", 'φ'),
    ("chi", 'χ'),
    ("psi", 'ψ'),
    ("omega", 'ω'),
    ("Gamma", 'Γ'),
    ("Delta", 'Δ'),
    ("Theta", 'Θ'),
    ("Sigma", 'Σ'),
    ("Phi", 'Φ'),
    ("Psi", 'Ψ'),
    ("Omega", 'Ω'),
];

fn greek(word: &str) -> Option<GlyphRun> {
    GREEK
        .iter()
        .find(|(name, _)| *name == word)
        .map(|(name, letter)| GlyphRun::Greek(name, *letter))
}

/// Letters in a row up to this number are a letter with an index; more are a word, and so are as many small ones, such
/// as `rod`, `len` or `off`, which hold no capital that could be the symbol.
const LONGEST_SYMBOL: usize = 3;

/// Splits an identifier into its letter and its index.
pub(crate) fn typeset(name: &str) -> TypesetName {
    let (head, tail) = name.split_once('_').unwrap_or((name, ""));
    let letters_end = head
        .find(|c: char| !c.is_alphabetic())
        .unwrap_or(head.len());
    let (letters, digits) = head.split_at(letters_end);
    let mut index: Vec<Vec<GlyphRun>> = Vec::new();
    let upper = letters.len() > 1 && letters.chars().all(char::is_uppercase);
    let (base, rest) = if let Some(letter) = greek(letters) {
        (letter, "")
    } else if upper || is_word(letters) {
        (GlyphRun::Word(letters.to_owned()), "")
    } else {
        let first = letters.chars().next().map_or(0, char::len_utf8);
        let (first, rest) = letters.split_at(first);
        (GlyphRun::Italic(first.to_owned()), rest)
    };
    let first_part = format!("{rest}{digits}");
    if !first_part.is_empty() {
        index.push(vec![GlyphRun::Italic(first_part)]);
    }
    index.extend(
        tail.split('_')
            .filter(|part| !part.is_empty())
            .map(index_part),
    );
    TypesetName { base, index }
}

fn is_word(letters: &str) -> bool {
    match letters.chars().count() {
        LONGEST_SYMBOL => letters.chars().all(char::is_lowercase),
        n => n > LONGEST_SYMBOL,
    }
}

fn index_part(part: &str) -> Vec<GlyphRun> {
    let end = part
        .find(|c: char| !c.is_alphabetic())
        .unwrap_or(part.len());
    let (letters, digits) = part.split_at(end);
    if let Some(letter) = greek(letters) {
        let mut glyphs = vec![letter];
        if !digits.is_empty() {
            glyphs.push(GlyphRun::Italic(digits.to_owned()));
        }
        return glyphs;
    }
    if letters.chars().count() >= LONGEST_SYMBOL {
        return vec![GlyphRun::Word(part.to_owned())];
    }
    vec![GlyphRun::Italic(part.to_owned())]
}
