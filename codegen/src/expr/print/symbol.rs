//! Names as they are typeset: `theta1` as a Greek letter with index 1, `dc1` as d with the index c1.

/// A name with the number of its time derivatives.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FormulaSymbol {
    /// Identifier, as in the model file.
    pub name: String,
    /// Number of time derivatives: 0, 1 or 2.
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

/// A part of a typeset name in one style.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum GlyphRun {
    /// A Greek letter: LaTeX command without backslash, and character.
    Greek(&'static str, char),
    /// A single letter, or letters and digits of an index, in italics.
    Italic(String),
    /// A word of several letters, upright.
    Word(String),
}

/// A letter or word with an index of several parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TypesetName {
    /// The letter or word itself.
    pub(crate) base: GlyphRun,
    /// Parts of the index, each as runs of one style.
    pub(crate) index: Vec<Vec<GlyphRun>>,
}

/// Names of Greek letters that are recognised.
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

/// The Greek letter of this name, if there is one.
fn greek(word: &str) -> Option<GlyphRun> {
    GREEK
        .iter()
        .find(|(name, _)| *name == word)
        .map(|(name, letter)| GlyphRun::Greek(name, *letter))
}

/// More letters than these in a row are a word; so are exactly this many small letters, such as `rod`, `len` or `off`,
/// in which no capital letter could be the symbol.
const LONGEST_SYMBOL: usize = 3;

/// Splits an identifier into its letter and its index.
pub(crate) fn typeset(name: &str) -> TypesetName {
    // The part before the first underscore has the letter; the parts after it are parts of the index.
    let (head, tail) = name.split_once('_').unwrap_or((name, ""));
    let letters_end = head.find(|c: char| !c.is_alphabetic()).unwrap_or(head.len());
    let (letters, digits) = head.split_at(letters_end);
    let mut index: Vec<Vec<GlyphRun>> = Vec::new();
    // A Greek letter, a word, or a letter whose other letters begin the index.
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
    index.extend(tail.split('_').filter(|part| !part.is_empty()).map(index_part));
    TypesetName { base, index }
}

/// Whether a run of letters is read as a word.
fn is_word(letters: &str) -> bool {
    match letters.chars().count() {
        LONGEST_SYMBOL => letters.chars().all(char::is_lowercase),
        n => n > LONGEST_SYMBOL,
    }
}

/// The style runs of one part of an index: a Greek letter with digits, a word, or italics.
fn index_part(part: &str) -> Vec<GlyphRun> {
    let end = part.find(|c: char| !c.is_alphabetic()).unwrap_or(part.len());
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
